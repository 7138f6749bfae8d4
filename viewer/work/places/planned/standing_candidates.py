"""Places where a person can stand, spread over the floors of a walk map, and which of them can be walked to from each other.

Frame: the upright world, file units, as the walk map's.
"""

import numpy as np

from ..standing_place import EYE_HEIGHT
from ..walk_map import HEIGHT, STEP, WalkMap

_APART = 0.6
"""Metres: side of the cells of which each holds one place, at most, on each storey."""
_MOST = 700
"""Places, at most; larger scans have larger cells."""
_CLEAR = (0.6, 0.35)
"""Metres around a place in which nothing is in the way: of a roomy place, and of any."""
_AROUND = 1.4
"""Metres around a place whose floor is looked at."""
_LEVEL, _TABLE = 0.15, 1.5
"""Metres by which that floor may rise or fall, and down to which what is lower is a floor beside furniture."""
_LEAST = 1.0
"""Square metres of level floor from which on it is enough: of a small bathroom."""
_SHARE = 0.6
"""Share of level and lower floor that must be level: above stairs half of it may be lower."""
_ROOF = 0.2
"""Worth of a place on a roof."""
_CEILING = 1.8
"""Metres from a floor down to what is the storey below."""
_STOREY = 1.0
"""Metres between floors that are taken for two storeys of a cell."""


def standing_candidates(walk: WalkMap) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Eyes (n, 3), the number of the area (n,) that each stands in, between whose places one can walk, how good the footing is
    there (n,), 0 to 1 (:func:`_footing`), and whether it is roomy (n,)."""
    from scipy.spatial import KDTree

    metre = walk.metre
    blocks = _centres(walk)
    floors = np.flatnonzero(walk.floor)
    if len(floors) == 0:
        return np.zeros((0, 3)), np.zeros(0, int), np.zeros(0), np.zeros(0, bool)
    areas = _areas(blocks[floors], walk.side, metre)
    tree = KDTree(blocks[:, :2])
    picked = _spread(blocks[floors], metre)
    roomy, free = (np.array([_is_free(blocks, tree, blocks[floors[at]], clear * metre, metre) for at in picked], bool)
                   for clear in _CLEAR)  # fmt: skip
    kept = picked[free]
    footing = np.array([_footing(blocks, walk, tree, blocks[floors[at]]) for at in kept])
    return blocks[floors[kept]] + np.array([0.0, 0.0, EYE_HEIGHT * metre]), areas[kept], footing, roomy[free]


def _centres(walk: WalkMap) -> np.ndarray:
    """(B, 3) middle of each block in the plane, mean height of its points."""
    bits = 21
    columns = np.stack([walk.keys >> 2 * bits, (walk.keys >> bits) & ((1 << bits) - 1)], axis=1)
    return np.column_stack([walk.origin[:2] + (columns + 0.5) * walk.side, walk.heights])


def _footing(blocks: np.ndarray, walk: WalkMap, tree, feet: np.ndarray) -> float:
    """How well one stands there, 0 to 1: by how much level floor is around, and how much of the surroundings is not a step down
    from it, as around a table or a tank.  On a roof, with nothing above and a storey below, _ROOF of that."""
    metre = walk.metre
    near = np.array(tree.query_ball_point(feet[:2], _AROUND * metre))
    rise, columns = (blocks[near, 2] - feet[2]) / metre, walk.keys[near] >> 21
    level = np.unique(columns[walk.floor[near] & (np.abs(rise) < _LEVEL)])
    lower = np.setdiff1d(columns[(rise < -_LEVEL) & (rise > -_TABLE)], level)
    area = len(level) * (walk.side / metre) ** 2
    share = min(area / _LEAST, 1.0) * min(len(level) / (len(level) + len(lower)) / _SHARE, 1.0)
    below, above = (len(np.unique(columns[far])) for far in (rise < -_CEILING, rise > HEIGHT))
    return share * (_ROOF if below > 0.3 * len(level) and above < 0.1 * len(level) else 1.0)


def _areas(floors: np.ndarray, side: float, metre: float) -> np.ndarray:
    """(F,) number of the connected area of each floor block: neighbours no more than a step apart."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(floors[:, :2]).query_pairs(1.5 * side, output_type="ndarray")
    near = pairs[np.abs(floors[pairs[:, 0], 2] - floors[pairs[:, 1], 2]) <= STEP * metre]
    graph = coo_matrix((np.ones(len(near), bool), (near[:, 0], near[:, 1])), shape=(len(floors),) * 2)
    return connected_components(graph, directed=False)[1]


def _spread(floors: np.ndarray, metre: float) -> np.ndarray:
    """Numbers of floor blocks: of each cell and storey the one nearest to the middle."""
    side = _APART * metre
    while True:
        cells = np.floor(floors / np.array([side, side, _STOREY * metre])).astype(np.int64)
        away = ((floors[:, :2] / side - cells[:, :2] - 0.5) ** 2).sum(axis=1)
        order = np.lexsort((away, cells[:, 2], cells[:, 1], cells[:, 0]))
        # np.unique of rows keeps the interpreter's lock while it sorts
        first = np.flatnonzero(np.diff(cells[order], axis=0, prepend=cells[order[:1]] - 1).any(axis=1))
        if len(first) <= _MOST:
            return order[first]
        side *= 1.3


def _is_free(blocks: np.ndarray, tree, feet: np.ndarray, radius: float, metre: float) -> bool:
    """Whether nothing is in the way of a body of this radius."""
    near = blocks[tree.query_ball_point(feet[:2], radius), 2] - feet[2]
    return not bool(((near > STEP * metre) & (near < HEIGHT * metre)).any())
