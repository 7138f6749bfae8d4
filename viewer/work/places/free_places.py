"""Places above a floor with nothing in the way, all over a scan: on every storey, in streets, and in the air above open ground.

Frame: the upright world, +z up, file units; ``metre`` is file units in a metre.
"""

import numpy as np

from .standing_place import EYE_HEIGHT

ABOVE_GROUND = (EYE_HEIGHT, 5.0, 12.0)
"""Metres above a floor without a ceiling at which places are looked for: of a person, a lamp post and a house."""
_BLOCK = 0.3
"""Metres: side of the blocks in which points are entered, at least: narrower than a door, wider than a pole."""
_SPACINGS = 1.5
"""The same in spacings of the sample: a floor then has few blocks without a point."""
_MOST_BLOCKS = 600_000
"""Of the whole scan; larger scans have larger blocks.  Chosen for time: 20 ms."""
_HEAD = 0.3
"""Metres of free space above the eye."""
_CLEAR = 0.6
"""Metres around a person in which nothing is."""


def free_places(points: np.ndarray, spacing: float, metre: float, count: int) -> np.ndarray:
    """(n, 3) places, at most ``count`` at each height: a quarter of them where most was measured, the others spread evenly.

    points: (n, 3) float64 or float32.  spacing: of these points.
    """
    if len(points) == 0:
        return np.zeros((0, 3))
    low, extent = points.min(axis=0), np.ptp(points, axis=0).astype(np.float64)
    side = max(_BLOCK * metre, _SPACINGS * spacing, float(np.prod(np.maximum(extent, metre)) / _MOST_BLOCKS) ** (1 / 3))
    shape = (extent / side).astype(int) + 1
    at = ((points - low) / side).astype(np.int64)
    index = (at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2]
    held = np.bincount(index, minlength=int(np.prod(shape))).reshape(shape)
    found = [_at_height(held, low, side, height * metre, metre, count) for height in ABOVE_GROUND]
    return np.concatenate(found)


def _at_height(held: np.ndarray, low: np.ndarray, side: float, height: float, metre: float, count: int) -> np.ndarray:
    """Places this far above floors; as :func:`free_places`.  held: (x, y, z) points in each block."""
    reach, around = max(1, round(_CLEAR * metre / side)), held > 0
    way = around.copy()  # something within arm's length, in the plane
    for axis in (0, 1):
        way = np.logical_or.reduce([_moved(way, k, axis) for k in range(-reach, reach + 1)])
    up = max(1, int(np.ceil((height + _HEAD * metre) / side)))
    if up >= held.shape[2]:
        up = held.shape[2] - 1
    ground = around.copy()  # a floor may have a gap: the blind circle under a scanner
    for axis in (0, 1):
        ground = ground | _moved(ground, 1, axis) | _moved(ground, -1, axis)
    blocked = np.cumsum(way, axis=2, dtype=np.int32)
    step = max(1, round(0.3 * metre / side))  # feet stand beside what is lower than this
    top = np.minimum(np.arange(held.shape[2]) + up, held.shape[2] - 1)
    first = np.minimum(np.arange(held.shape[2]) + step, held.shape[2] - 1)
    free = ground & ~_moved(ground, -1, 2) & (blocked[:, :, top] == blocked[:, :, first])
    places = np.argwhere(free)
    if len(places) == 0:
        return np.zeros((0, 3))
    kept = _chosen(places, held, max(1, round(3.0 * metre / side)), count)
    return low + (kept + 0.5) * side + np.array([0.0, 0.0, height])


def _chosen(places: np.ndarray, held: np.ndarray, region: int, count: int) -> np.ndarray:
    """Of places (n, 3), blocks, one in the middle of each region, ``count``: a quarter of them with most points, the others
    evenly spread."""
    key = places // region
    _, first, of_place = np.unique(key, axis=0, return_index=True, return_inverse=True)
    of_place = of_place.ravel()
    number = len(first)
    size = np.bincount(of_place)
    middle = np.stack([np.bincount(of_place, places[:, k]) / size for k in range(3)], axis=1)
    away = ((places - middle[of_place]) ** 2).sum(axis=1)
    order = np.lexsort((away, of_place))
    central = places[order[np.searchsorted(of_place[order], np.arange(number))]]
    low = np.maximum(central - region, 0)
    high = np.minimum(central + region + 1, np.array(held.shape))
    total = np.pad(held.astype(np.int64), ((1, 0),) * 3).cumsum(0).cumsum(1).cumsum(2)
    corners = ((total[*(np.where(pick, high, low).T)], (-1) ** (3 - sum(pick))) for pick in np.ndindex(2, 2, 2))
    near = sum((value * sign for value, sign in corners), np.zeros(number, np.int64))
    rank = np.argsort(-near, kind="stable")
    dense = rank[: count // 4]
    rest = np.sort(rank[count // 4 :])
    spread = rest[np.linspace(0, len(rest) - 1, min(count - len(dense), len(rest))).astype(int)] if len(rest) else rest
    return central[np.concatenate([dense, spread])]


def _moved(values: np.ndarray, by: int, axis: int) -> np.ndarray:
    """Values moved along an axis, False where none come from."""
    out = np.zeros_like(values)
    here, there = [slice(None)] * values.ndim, [slice(None)] * values.ndim
    if by > 0:
        here[axis], there[axis] = slice(by, None), slice(None, -by)
    elif by < 0:
        here[axis], there[axis] = slice(None, by), slice(-by, None)
    out[tuple(here)] = values[tuple(there)]
    return out
