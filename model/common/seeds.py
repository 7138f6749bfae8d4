"""What a seed may be, wherever one is asked for."""

MOST_SEED = 2**32 - 1
"""From 0 to this: what every generator of random numbers in use takes."""
