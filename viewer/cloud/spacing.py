"""Point spacing: how far apart neighbouring points are on the surfaces of a scan.

For points spread evenly over a surface with density d, the k-th nearest neighbour lies at r_k with d * pi * r_k**2 = k
in the mean, so the spacing 1/sqrt(d) is r_8 * sqrt(pi / 8).  Everything is computed in packed steps and scaled at the
end: scaling a scan by a power of two scales the result exactly.
"""

from concurrent.futures import Executor

import numpy as np

from viewer.cloud import kernels

_CELLS, _QUERIES, _CANDIDATES, _NEIGHBOURS = 64, 24, 20_000, 8


def measure_spacing(points, cells, offsets, layers: int, pool: Executor) -> tuple[float, float]:
    """Median spacing in packed steps over about 1500 points, in 64 cells chosen in proportion to their points.

    points, cells, offsets, layers: as in Scene.  Returns the spacing, 0.0 where no two different points are near each
    other, and the share of points whose eight nearest are packed into the very same place, which says nothing of a spacing.
    """
    count = int(offsets[-1])
    if count <= _CANDIDATES:
        everything = _steps(points, np.repeat(np.tile(np.arange(len(cells)), layers), np.diff(offsets)), cells)
        sets = [(everything, 1.0)]
        queries, weights = _CELLS * _QUERIES, np.ones(1)
    else:
        runs = offsets.reshape(-1)[:-1].reshape(layers, -1)
        sizes = np.diff(offsets).reshape(layers, -1)
        share = sizes.sum(axis=0).cumsum()
        places = np.searchsorted(share, (np.arange(_CELLS) + 0.5) / _CELLS * share[-1], side="right")
        chosen, weights = np.unique(places, return_counts=True)
        sets = [_candidates(points, runs[:, cell], sizes[:, cell]) for cell in chosen]
        queries = _QUERIES
    jobs = [pool.submit(_median_distances, xyz, queries) for xyz, _ in sets]
    found = [job.result() * scale for job, (_, scale) in zip(jobs, sets, strict=True)]
    distances = np.concatenate(found)
    apart = distances[distances > 0]
    coinciding = np.average([(d == 0).mean() if len(d) else 0.0 for d in found], weights=weights)
    return float(np.median(apart)) if len(apart) else 0.0, float(coinciding)


def _candidates(points, starts: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, float]:
    """Points of one cell, coarse layers first, up to a limit; and sqrt(share taken), which undoes the thinning."""
    room, parts = _CANDIDATES, []
    for start, size in zip(starts, sizes, strict=True):
        parts.append(points[start : start + min(size, room)])
        room -= len(parts[-1])
    words = np.concatenate(parts)
    xyz = _steps(words, np.zeros(len(words), np.int64), np.zeros((1, 3)))
    return xyz, float(np.sqrt(len(words) / sizes.sum()))


def _steps(words, cell_of_points, cells) -> np.ndarray:
    """(n, 3) float64 positions in packed steps from the grid's origin."""
    words = np.asarray(words)
    q = np.stack([words[:, 0] & 0xFFFF, words[:, 0] >> 16, words[:, 1] & 0xFFFF], axis=1)
    return np.asarray(cells, np.float64)[cell_of_points] * 65536.0 + q


def _median_distances(xyz: np.ndarray, queries: int) -> np.ndarray:
    k = min(_NEIGHBOURS, len(xyz) - 1)
    if k < 1:
        return np.zeros(0)
    chosen = np.unique(np.linspace(0, len(xyz) - 1, min(queries, len(xyz))).astype(np.int64))
    squared = np.empty(len(chosen))
    kernels.neighbour_distances(np.ascontiguousarray(xyz), chosen, k, squared)
    return np.sqrt(squared * (np.pi / k))
