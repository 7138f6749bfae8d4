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
"""Metres around the places that are shown: what is seen through a window would make the rooms small."""
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
    shown = np.concatenate([between, places[:, :2]])
    if len(between) > 100:
        low, high = np.percentile(between, [0.5, 99.5], axis=0)
    else:
        low, high = shown.min(axis=0), shown.max(axis=0)
    first, last = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    reach, margin = (np.inf, 0.05 * float((high - low).max())) if floor is None else (_REACH * metre, _MARGIN * metre)
    low = np.minimum(np.maximum(low, first - reach), first) - margin
    high = np.maximum(np.minimum(high, last + reach), last) + margin
    pixel = float((high - low).max()) / _LONGEST
    shape = np.maximum(np.ceil((high - low) / pixel).astype(int), 1)
    high = low + shape * pixel
    counts, _, _ = np.histogram2d(between[:, 0], between[:, 1], bins=tuple(shape), range=list(zip(low, high)))
    spread = (counts + 0.35 * sum(np.roll(counts, by, axis) for by in (-1, 1) for axis in (0, 1))).T[::-1]
    there = spread[spread > 0]
    full = float(np.quantile(there, _FULL)) if len(there) else 1.0
    alpha = np.rint(255 * np.clip(np.log1p(spread) / np.log1p(full), 0, 1)).astype(np.uint8)
    return Plan(alpha, low, high, floor)
