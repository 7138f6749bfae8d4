"""Fine-tuning of the shipped weights on one scan, in minutes: on the photographs in an E57, else on points withheld from it.

``photographs`` and ``withheld`` provide training and held-out data; ``tune`` trains, evaluates, and keeps the better weights.
"""
