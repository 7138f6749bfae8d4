"""Where a person can stand and where something is in the way: a sparse lattice of blocks with points, built once for a scan.

Frame: the upright world (viewer.work.places.up_axis), file units.  Each block keeps the mean height of its points, so that a
floor is known to millimetres though blocks are a decimetre wide.  Queries look up blocks by binary search: a few thousand of
them, and no point is read after the map is built.  Points that are clipped away or of a hidden station are not in anyone's way.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...common.progress import progress
from ...grid.scene import unpack
from ..selection import Selection

if TYPE_CHECKING:
    from ...grid.scene import Scene

SAMPLE = 4_000_000
"""Points of the coarse layers, at most, from which the map is built; about a second on one core."""
BLOCK = 0.1
"""Metres: least side of a block."""
SPACINGS = 3.0
"""Side of a block in spacings of the sample, at least: a surface then has no gaps between blocks."""
COARSEST = 0.35
"""Metres: a wider block cannot tell a step from a wall."""
FEWEST = 0.2
"""Points that a block of a surface holds, as a share of what a flat surface across it holds; below, they are outlier points."""
CLEARANCE = 1.2
"""Metres of free height above a block on which a person can stand."""
STEP = 0.4
"""Metres: highest step up, and down without looking for a lower floor."""
FOOT, BODY = 0.15, 0.22
"""Metres: radii of the disc that finds the floor, and of the body, which fits through a door of 0.7 m."""
HEIGHT = 1.75
"""Metres from the floor to the top of the head."""
HOLE = 1.6
"""Metres: a gap in the floor, as under a tripod, is walked over where floor lies within this radius all around."""
DROP = 6.0
"""Metres below the feet down to which a lower floor is looked for."""
_SECTORS, _SURROUNDED = 8, 6  # directions around a gap, and in how many of them there must be floor
_BITS = 21  # of a key for each axis


@dataclass(frozen=True, eq=False)
class WalkMap:
    """keys: (B,) int64 of blocks with points, ascending, the height lowest; heights: (B,) float64 mean height of their points;
    floor: (B,) bool, whether a person can stand on top.  origin: (3,) upright coordinates of block (0, 0, 0).  side: of a
    block.  metre: file units in a metre."""

    keys: np.ndarray
    heights: np.ndarray
    floor: np.ndarray
    origin: np.ndarray
    side: float
    metre: float

    def floor_below(self, x: float, y: float, feet: float) -> float | None:
        """Height of the floor for feet at (x, y) that are at height ``feet``; None where there is none.

        The highest floor a step away; else, over a gap in the floor, the height around it; else a lower floor, down to DROP.
        """
        step, foot = STEP * self.metre, max(FOOT * self.metre, 0.75 * self.side)
        near, _ = self._floors(x, y, foot, feet - step, feet + step)
        if len(near):
            return float(near.max())
        around, away = self._floors(x, y, HOLE * self.metre, feet - step, feet + step)
        sectors = ((np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5) * _SECTORS).astype(int) % _SECTORS
        if len(np.unique(sectors)) >= _SURROUNDED:
            nearest = np.argsort((away**2).sum(axis=1))[: 4 * _SECTORS]
            return float(np.median(around[nearest]))
        lower, _ = self._floors(x, y, foot, feet - DROP * self.metre, feet - step)
        return float(lower.max()) if len(lower) else None

    def blocking(self, place: np.ndarray, feet: float) -> np.ndarray:
        """(n, 2) horizontal offsets from ``place`` (2,) to the blocks that a body there, with its feet at ``feet``, touches."""
        low, high = feet + STEP * self.metre, feet + HEIGHT * self.metre
        heights, _, away = self._blocks(float(place[0]), float(place[1]), max(BODY * self.metre, 0.75 * self.side), low, high)
        return away[(heights > low) & (heights < high)]

    def _floors(self, x: float, y: float, radius: float, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
        """Heights (n,) of floor blocks between ``low`` and ``high`` within ``radius``, and their offsets (n, 2)."""
        heights, floor, away = self._blocks(x, y, radius, low, high)
        kept = floor & (heights >= low) & (heights <= high)
        return heights[kept], away[kept]

    def _blocks(self, x: float, y: float, radius: float, low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights (n,), floor (n,) and offsets (n, 2) of the blocks whose middle lies within ``radius`` of (x, y), and whose
        extent meets ``low`` to ``high``."""
        at = (np.array([x, y]) - self.origin[:2]) / self.side
        reach = radius / self.side
        ranges = [np.arange(np.floor(c - reach), np.floor(c + reach) + 1) for c in at]
        columns = np.stack(np.meshgrid(*ranges), -1).reshape(-1, 2)
        columns = columns[((columns + 0.5 - at) ** 2).sum(axis=1) <= reach**2]
        bottom, top = (np.floor((edge - self.origin[2]) / self.side) for edge in (low, high))
        most = float(1 << _BITS)
        columns = columns[((columns >= 0) & (columns < most)).all(axis=1)]
        if len(columns) == 0 or top < 0 or bottom >= most or len(self.keys) == 0:
            return np.zeros(0), np.zeros(0, bool), np.zeros((0, 2))
        base = (columns[:, 0].astype(np.int64) << 2 * _BITS) | (columns[:, 1].astype(np.int64) << _BITS)
        first = np.searchsorted(self.keys, base + int(max(bottom, 0)))
        last = np.searchsorted(self.keys, base + int(min(top, most - 1)), side="right")
        count = last - first
        rows = np.repeat(first - np.concatenate([[0], np.cumsum(count)[:-1]]), count) + np.arange(count.sum())
        return self.heights[rows], self.floor[rows], np.repeat((columns + 0.5 - at) * self.side, count, axis=0)


def build_walk_map(sight: Selection, upright: np.ndarray, metre: float) -> WalkMap | None:
    """The map of the points in sight; None where they are too far apart to tell a step from a wall, or none is left.

    upright: (3, 3) as in viewer.work.places.up_axis.  metre: file units in a metre.  Raises Cancelled where the progress is
    stopped.
    """
    scene = sight.scene
    head = scene.coarse_points(SAMPLE)
    every = max(1, -(-head // SAMPLE))
    number = -(-head // every)
    if number == 0:
        return None
    spacing = scene.spacing * float(np.sqrt(scene.count / number))
    side = max(BLOCK * metre, SPACINGS * spacing)
    low, high = _corners(scene, upright)
    side = max(side, float((high - low).max()) / ((1 << _BITS) - 4))
    if side > COARSEST * metre:
        return None
    points = []
    with progress(head, "Finding the floor") as meter:
        for start in range(0, head, 1 << 20):
            stop = min(start + (1 << 20), head)
            xyz, _, _, station = unpack(scene, slice(start, stop, every))
            points.append(xyz[sight.keeps(xyz, station, slice(start, stop, every))] @ upright)
            meter.update(stop - start)
    if not any(len(part) for part in points):
        return None
    lowest = low - 1.5 * side  # a level floor at the bottom lies in the middle of its blocks
    return map_of(np.concatenate(points), lowest, side, metre, spacing)


def _corners(scene: "Scene", upright: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) each: lowest and highest upright coordinates of the scan's bounding box."""
    corners = np.array(np.meshgrid(*np.asarray(scene.bounds).T)).reshape(3, -1).T @ upright
    return corners.min(axis=0), corners.max(axis=0)


def map_of(points: np.ndarray, origin: np.ndarray, side: float, metre: float, spacing: float) -> WalkMap:
    """The map of points (N, 3), upright coordinates, ``spacing`` apart; ``origin`` (3,) lies below all of them."""
    blocks = ((points - origin) / side).astype(np.int64)
    keys, index, count = np.unique(
        (blocks[:, 0] << 2 * _BITS) | (blocks[:, 1] << _BITS) | blocks[:, 2], return_inverse=True, return_counts=True)
    heights = np.bincount(index, points[:, 2] - origin[2], len(keys)) / np.maximum(count, 1) + origin[2]
    kept = count >= max(FEWEST * (side / spacing) ** 2, 1.0) if spacing > 0 else count > 0
    keys, heights = keys[kept], heights[kept]
    # a floor is the top of a run of blocks with free height above: the next block of the column, if any, is far enough
    above = np.append(keys[1:] - keys[:-1], np.iinfo(np.int64).max)  # in another column: more than any height
    return WalkMap(keys, heights, above * side >= CLEARANCE * metre, np.asarray(origin, np.float64), side, metre)
