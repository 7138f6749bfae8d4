"""The shipped weights adapted to one scan, in minutes: by the photographs inside an E57, else by points withheld from it.

``photographs`` and ``withheld`` are the two kinds of material, ``tune`` trains on either, judges, and keeps what is better.
"""
