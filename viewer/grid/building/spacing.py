"""Point spacing: the distance between neighbouring points on the surfaces of a scan.

For points spread evenly over a surface with density d, the k-th nearest neighbour lies at r_k with d * pi * r_k**2 = k
in the mean, so the spacing 1/sqrt(d) is r_8 * sqrt(pi / 8).  Points at the same position count once: a scan given twice is
no denser.  Everything is computed in packed steps and scaled at the end, so scaling a scan by a power of two scales the result
exactly.

model.appearance.spacing measures the same for training data, which are arrays without a grid, with a search tree over all
points; here the cells of the grid make a search tree unnecessary.
"""

from concurrent.futures import Executor

import numpy as np

from ....model.appearance.spacing import NEIGHBOURS
from .spacing_kernels import gather_steps, neighbour_distances

CELLS, _QUERIES, _CANDIDATES = 64, 24, 20_000
"""Cells that are examined, queries in each, and points of a cell among which neighbours are searched.  The standard error of
the median of 1,536 distances is 3 % of their deviation; cells have up to 2 * TARGET points on average, 16,384
(viewer.grid.building.cell_layout)."""


def measure_spacing(points, cells, offsets, layers: int, pool: Executor) -> tuple[float, float]:
    """Median spacing in packed steps over about 1500 points, in 64 cells chosen in proportion to their points.

    points, cells, offsets, layers: as in Scene.  Returns the spacing, 0.0 where no two different points are near each other,
    and the share of points whose eight nearest neighbours are packed to the same position, which finer cells might separate.
    """
    count = int(offsets[-1])
    if count <= _CANDIDATES:
        cell = np.repeat(np.tile(np.arange(len(cells)), layers), np.diff(offsets))
        found, weights = [_distances(_steps(points, cells[cell]), CELLS * _QUERIES)], np.ones(1)
    else:
        runs = offsets.reshape(-1)[:-1].reshape(layers, -1)
        sizes = np.diff(offsets).reshape(layers, -1)
        share = sizes.sum(axis=0).cumsum()
        places = np.searchsorted(share, (np.arange(CELLS) + 0.5) / CELLS * share[-1], side="right")
        chosen, weights = np.unique(places, return_counts=True)
        jobs = [pool.submit(_of_cell, points, runs[:, cell].copy(), sizes[:, cell].copy()) for cell in chosen]
        found = [job.result() for job in jobs]
    distances = np.concatenate([distance for distance, _ in found])
    apart = distances[distances > 0]
    coinciding = np.average([share for _, share in found], weights=weights)
    return float(np.median(apart)) if len(apart) else 0.0, float(coinciding)


def _of_cell(points, starts: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, float]:
    """As _distances, in one cell, among at most _CANDIDATES of its points, those of coarse layers first."""
    taken = min(int(sizes.sum()), _CANDIDATES)
    xyz = np.empty((3, taken))
    gather_steps(points, starts, sizes, xyz)
    return _distances(xyz, _QUERIES, taken / int(sizes.sum()))


def of_candidates(words: np.ndarray) -> np.ndarray:
    """Spacings in packed steps around some of the points of one cell, (n, 3) packed."""
    some = np.random.default_rng(0).permutation(len(words))[:_CANDIDATES]
    some = words[np.sort(some)] if len(some) < len(words) else words
    return _distances(_steps(some, np.zeros((1, 3))), _QUERIES, len(some) / max(len(words), 1))[0]


def _steps(words, cells: np.ndarray) -> np.ndarray:
    """(3, n) float64 positions in packed steps from the grid's origin.  words: (n, 3) packed points.  cells: (n, 3)."""
    words = np.asarray(words)
    return cells.T * 65536.0 + np.stack([words[:, 0] & 0xFFFF, words[:, 0] >> 16, words[:, 1] & 0xFFFF])


def _distances(xyz: np.ndarray, queries: int, taken: float = 1.0) -> tuple[np.ndarray, float]:
    """For some of the points xyz (3, n): the spacing by the distance to the eighth nearest position, and the share of them that
    have eight others at their own position.  taken: which share of all points xyz is."""
    count = xyz.shape[1]
    k = min(NEIGHBOURS, count - 1)
    if k < 1:
        return np.zeros(0), 0.0
    chosen = np.unique(np.linspace(0, count - 1, min(queries, count)).astype(np.int64))
    found, tallies = np.empty(len(chosen)), np.empty((len(chosen), 3), np.int64)
    neighbour_distances(np.ascontiguousarray(xyz), chosen, k, np.empty(count), found, tallies)
    repeats, places, points = tallies.T
    kept = _places_kept(taken, points.sum() / max(places.sum(), 1))
    return np.sqrt(found * (np.pi / np.maximum(places, 1))) * float(np.sqrt(kept)), float((repeats >= k).mean())


def _places_kept(taken: float, each: float) -> float:
    """The share of the occupied positions that remain occupied when a random share ``taken`` of the points is kept.

    each: mean number of points at a remaining position.  A position with m points remains with probability 1 - (1 - taken)**m,
    with taken * m points in the mean: two equations for that share and m.
    """
    if taken == 1.0 or each <= 1.0:
        return taken
    from scipy.special import lambertw  # 0.1 s to import, which most scans do without

    a = -np.log1p(-taken) * each / taken
    return float(1.0 + lambertw(-a * np.exp(-a)).real / a)
