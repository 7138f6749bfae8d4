"""Faults from outside, any number of times: ``python -m tests.faults`` (``make faults``).

Interrupts and kills at random times, full disks, little memory, closed pipes, folders that cannot be written, and two processes
on one scan.  Each kind is a generator of cases; a case is a line of text, "" where all was as promised.
"""
