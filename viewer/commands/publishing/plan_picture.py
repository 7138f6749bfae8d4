"""Plans of a publication: where walls are on each storey that has places, as pictures that the page colours itself.

Frame: the upright world relative to the publication's origin, file units; row 0 is at the largest y.
"""

from dataclasses import dataclass

import numpy as np

_LONGEST = 640
"""Pixels of the longer side."""
_SLAB = (0.5, 2.0)
"""Metres above the floor: walls and furniture, neither floor nor lamps."""
_STOREY = 1.8
"""Metres between the floors of two storeys, at least."""
_MARGIN = 1.0
"""Metres around what is shown."""
_REACH = 4.0
"""Metres around the places that are shown, at most."""
_CELL = 0.25
"""Metres of the squares whose points are counted to find what stands around the places."""
_STANDS = 0.05
"""Share of the points of a usual square from which on something stands in a square: what a scanner sees through a window is
sparser.  From 0.02 to 0.1 it changes no side by more than 0.3 m (demo, studio, plant_room) or 0.5 m (street_corner)."""
_FULL = 0.985
"""Quantile of the counts of occupied pixels that is drawn fully opaque."""


@dataclass(frozen=True, eq=False)
class Plan:
    """alpha: (H, W) uint8, how much was measured.  low, high: (2,) corners of the picture.  floor: height, median of its
    places; None: a plan of points at all heights."""

    alpha: np.ndarray
    low: np.ndarray
    high: np.ndarray
    floor: float | None


def storeys(floors: np.ndarray, metre: float) -> np.ndarray:
    """Number of the storey of each place, lowest first, by the heights of the floors under them (n,)."""
    order = np.argsort(floors, kind="stable")
    steps = np.diff(floors[order]) > _STOREY * metre
    out = np.zeros(len(floors), int)
    out[order] = np.concatenate([[0], np.cumsum(steps)])
    return out


def plan_of(points: np.ndarray, places: np.ndarray, floor: float | None, metre: float) -> Plan:
    """The plan of a storey; where ``floor`` is None, of all points.  points: (N, 3).  places: (n, 3), which lie inside the
    picture."""
    low, high = (-np.inf, np.inf) if floor is None else (floor + _SLAB[0] * metre, floor + _SLAB[1] * metre)
    between = points[(points[:, 2] > low) & (points[:, 2] < high), :2]
    first, last = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    if floor is not None:
        (low, high), margin = _around(between, first, last, metre), _MARGIN * metre
    else:
        enough = len(between) > 100
        low, high = np.percentile(between, [0.5, 99.5], axis=0) if enough else _box(np.concatenate([between, places[:, :2]]))
        margin = 0.05 * float((high - low).max())
    low, high = np.minimum(low, first) - margin, np.maximum(high, last) + margin
    pixel = float((high - low).max()) / _LONGEST
    shape = np.maximum(np.ceil((high - low) / pixel).astype(int), 1)
    high = low + shape * pixel
    counts, _, _ = np.histogram2d(between[:, 0], between[:, 1], bins=tuple(shape), range=list(zip(low, high)))
    spread = (counts + 0.35 * sum(np.roll(counts, by, axis) for by in (-1, 1) for axis in (0, 1))).T[::-1]
    there = spread[spread > 0]
    full = float(np.quantile(there, _FULL)) if len(there) else 1.0
    alpha = np.rint(255 * np.clip(np.log1p(spread) / np.log1p(full), 0, 1)).astype(np.uint8)
    return Plan(alpha, low, high, floor)


def _around(between: np.ndarray, first: np.ndarray, last: np.ndarray, metre: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of what stands near the places, which lie between ``first`` and ``last``.  between: (N, 2), points of the
    storey."""
    reach = _REACH * metre
    near = between[((between > first - reach) & (between < last + reach)).all(axis=1)]
    if not len(near):
        return first, last
    cells = np.floor((near - first) / (_CELL * metre)).astype(np.int64)
    keys = cells[:, 0] * (np.ptp(cells[:, 1]) + 1) + cells[:, 1]
    _, square, counts = np.unique(keys, return_inverse=True, return_counts=True)
    of_square = counts[square]
    return _box(near[of_square >= _STANDS * np.median(of_square)])


def _box(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and the highest corner of points (N, 2)."""
    return points.min(axis=0), points.max(axis=0)
