"""Which files have a grid each.

A few small files are converted into one grid: that takes seconds, and decisions on colours (exposures by flight line, the
range of a height ramp, noise) then see all points at once.
"""

from collections.abc import Sequence
from pathlib import Path

MOST_AS_ONE = 16
"""Files that may be converted into one grid; of more, some change while others stay."""
BYTES_AS_ONE = 32 << 20
"""Bytes of all files that are converted into one grid, at most: about 6 million points of LAZ, 3 to 5 s on two cores."""


def is_place(files: Sequence[Path]) -> bool:
    """Whether each of ``files`` gets a grid of its own."""
    if len(files) < 2:
        return False
    return len(files) > MOST_AS_ONE or sum(file.stat().st_size for file in files) > BYTES_AS_ONE
