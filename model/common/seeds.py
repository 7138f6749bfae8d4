"""The range of random seeds on the command line."""

MAX_SEED = 2**32 - 1
"""Largest seed; the smallest is 0.  Every random generator in use accepts this range."""
