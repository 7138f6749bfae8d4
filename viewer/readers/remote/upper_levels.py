"""Which levels of an octree are read first, so that a picture comes soon."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

FIRST_POINTS = 200_000
"""Points of the first picture at most, 2.3 MB of a COPC file at hand: 0.4 s at 50 Mbit/s."""
_LEAST = 10_000
"""Points that the first picture has at least, where the octree holds as many: five times those of a preview."""


@dataclass(frozen=True)
class UpperLevels:
    """A scan of which the upper levels are there.  points: those of these levels; a sample of exactly as many reads nothing
    else.  finer: whether they are more than those of a picture before."""

    path: Path
    points: int
    finer: bool


def whole_levels(levels: np.ndarray, points: np.ndarray, most: int, before: int = 0) -> tuple[np.ndarray, int, bool]:
    """Numbers of the nodes of the levels from the root down that hold ``most`` points together at most, but _LEAST at least,
    with their points, and whether they are more than those for ``before`` points; 0: there were none before.

    Whole levels: of a part of one, all nodes would have to be read.  levels: (n,) of each node, 0 at the root.  points: (n,)
    those it holds."""
    ends = np.unique(levels)
    held = np.cumsum([points[levels == level].sum() for level in ends])
    least = int((held < _LEAST).sum()) + 1
    count, shown = (min(len(ends), max(int((held <= limit).sum()), least)) for limit in (most, before))
    return np.flatnonzero(np.isin(levels, ends[:count])), int(held[count - 1]), not before or count > shown
