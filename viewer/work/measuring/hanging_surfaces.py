"""Surfaces that hang above the ground, as a ceiling or a plate, are no part of a heap: they are found and left out.

Points hang together where the boxes of a coarse lattice that hold them touch.  A part that does not touch the base hangs where
points of another part lie beneath its inner cells.  Its outermost cells tell nothing: a heap whose upright walls were not
measured has ground beside its top in the same cells.  Nor do points of its own: noise spreads a level top over two boxes.
Frame: heights above the base, file units, float64.
"""

import numpy as np

from ....model.common.jit import compiled
from .surface_heights import Grid

_VOXEL, _VOXELS = 3.0, 10_000_000
"""Side of the boxes in which surfaces hang together, in cells; the number of boxes at most."""
_HANGING = 0.5
"""Share of the inner cells of a surface above another one from which on it hangs there."""
_CLOSED = np.ones((5, 5), bool)
"""Gaps of a part that are narrower than this, in cells, are chance: a tenth of the points leaves half of the cells empty."""
_BENEATH = 2
"""Points beneath the inner cells around a cell, _CLOSED, from which on a surface lies there: single points are often wrong."""


def hanging(cells: np.ndarray, above: np.ndarray, grid: Grid) -> np.ndarray:
    """(n,) bool: points of surfaces that do not touch the base, and hang above another one for the most part.

    cells: (n,) numbers of the cells of points, none below 0.  above: (n,) their heights."""
    parts, levels, touching = _parts(cells, above, grid)
    if len(touching) < 3:  # one part, besides number 0
        return np.zeros(len(cells), bool)
    count = len(touching)
    lowest = np.full(grid.inside.size, np.iinfo(np.int64).max)
    _lowest(cells, levels, parts, count, lowest)
    under = lowest % count  # the lowest part of each cell
    points = np.bincount(cells[under[cells] == parts], minlength=len(lowest))  # of it
    crossed = np.bincount(parts[under[cells] != parts], minlength=count) > 0
    found = np.zeros(count, bool)
    order = np.argsort(parts, kind="stable")
    first = np.searchsorted(parts[order], np.arange(count + 1))
    for part in np.flatnonzero(crossed & ~touching):
        own = order[first[part] : first[part + 1]]
        beneath = np.where((under != part) & (lowest // count < np.median(levels[own])), points, 0)
        found[part] = _hangs(cells[own], beneath.reshape(grid.shape), grid)
    return found[parts]


@compiled(nogil=True)
def _lowest(cells, levels, parts, count, lowest):
    """lowest: int64 of each cell, result: the least of level times ``count``, plus part, of the points there."""
    for i in range(cells.shape[0]):
        lowest[cells[i]] = min(lowest[cells[i]], levels[i] * count + parts[i])


def _hangs(cells: np.ndarray, beneath: np.ndarray, grid: Grid) -> bool:
    """Whether the part hangs whose points lie in these cells.  beneath: (grid.shape) points of lower parts."""
    from scipy.ndimage import binary_closing, binary_erosion, uniform_filter

    rows, columns = np.divmod(cells, grid.shape[1])
    low, margin = np.array([rows.min(), columns.min()]), len(_CLOSED)
    shape = np.array([rows.max(), columns.max()]) - low + 1
    mask = np.zeros(shape + 2 * margin, bool)
    mask[rows - low[0] + margin, columns - low[1] + margin] = True
    mask = np.asarray(binary_closing(mask, _CLOSED))
    # a profile is one cell wide
    inner: np.ndarray = np.asarray(binary_erosion(mask, np.ones(np.minimum(3, 2 * np.array(grid.shape) - 1), bool)), bool)
    inner = inner if inner.any() else mask  # a cable
    within = np.zeros(mask.shape)
    within[margin:-margin, margin:-margin] = beneath[low[0] : low[0] + shape[0], low[1] : low[1] + shape[1]]
    around: np.ndarray = np.asarray(uniform_filter(within * inner, len(_CLOSED), mode="constant")) * _CLOSED.size
    return bool((around[inner] > _BENEATH - 0.5).mean() > _HANGING)


def _parts(cells: np.ndarray, above: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n,) numbers of the parts of points, from 1; (n,) levels of their boxes; which parts touch the base."""
    from scipy.ndimage import label

    rows, columns = np.divmod(cells, grid.shape[1])
    low, side = float(above.min()), _VOXEL * grid.cell
    shape = [int(n // _VOXEL) + 1 for n in grid.shape]
    side = max(side, float(np.ptp(above)) * shape[0] * shape[1] / _VOXELS)
    levels = np.floor((above - low) / side).astype(np.int64)
    at = (rows // int(_VOXEL), columns // int(_VOXEL), levels)
    there = np.zeros((shape[0] + 1, shape[1] + 1, int(levels.max()) + 1), bool)
    there[at] = True
    parts = np.asarray(label(there, np.ones((3, 3, 3)))[0], np.int64)  # type: ignore[reportIndexIssue]
    touching, ground = np.zeros(int(parts.max()) + 1, bool), int(np.floor(-low / side))
    touching[parts[:, :, max(ground - 1, 0) : max(ground + 2, 0)]] = True
    return parts[at], levels, touching
