"""How many threads build a grid."""

from ....model.common.process.processors import usable_processors

MOST = 8
"""Threads; chosen by hand: with more, memory bandwidth is the limit."""


def processors() -> int:
    """Processors that this process may use, at most MOST."""
    return min(MOST, usable_processors())
