"""What the points say locally, before anything is fitted: spacing, noise, and normals.

Noise is the scatter around quadrics, not planes, so that the bend of a thin pipe is not taken for noise.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.spatial import KDTree

FEWEST = 12
"""Neighbours that a normal is told from, at least."""
MOST_NEIGHBOURS = 48
_QUADRICS = 48
"""Places at which noise is measured; their median is taken."""


def tree_of(points: np.ndarray) -> "KDTree":
    """Their KD tree, built in half the time of SciPy's default; searches take as long."""
    from scipy.spatial import KDTree

    return KDTree(points, balanced_tree=False, compact_nodes=False)


def spacing_of(points: np.ndarray, tree: "KDTree | None" = None) -> float:
    """About 1/sqrt(points per area), from the distance to the sixth nearest neighbour, at places that differ
    (viewer.work.fits.measured.distinct).  0 for fewer than two points.  tree: of the points; None: it is built."""
    if len(points) < 2:
        return 0.0
    some = points[:: max(len(points) // 512, 1)]
    k = min(7, len(points))
    away = (tree or tree_of(points)).query(some, k)[0][:, -1]
    return float(np.median(away)) * float(np.sqrt(np.pi / (k - 1)))


def noise_of(points: np.ndarray, tree: "KDTree", near: np.ndarray) -> float:
    """Standard deviation of points from the quadric through their neighbourhood, the median over places of ``near`` (n, 3)."""
    some = near[:: max(len(near) // _QUADRICS, 1)]
    k = min(40, len(points))
    if k < FEWEST:
        return 0.0
    found = []
    for neighbours in np.asarray(tree.query(some, k)[1]):
        patch = points[neighbours] - points[neighbours].mean(axis=0)
        _, _, axes = np.linalg.svd(patch, full_matrices=False)
        u, v, w = axes @ patch.T
        size = max(float(np.hypot(u, v).max()), 1e-300)
        u, v = u / size, v / size
        shape = np.stack([np.ones(k), u, v, u * u, u * v, v * v], axis=1)
        rest = w - shape @ np.linalg.lstsq(shape, w, rcond=None)[0]
        found.append(np.sqrt((rest @ rest) / (k - 6)))
    return float(np.median(found))


def normals_of(points: np.ndarray, tree: "KDTree", radius: float, spacing: float, at: np.ndarray | None = None) -> np.ndarray:
    """(n, 3) unit normals, of either sign, of the planes through the neighbours within about ``radius``.  at: (n, 3) places;
    None: at the points themselves."""
    k = int(np.clip(np.pi * (radius / max(spacing, 1e-300)) ** 2, FEWEST, MOST_NEIGHBOURS))
    around = points[np.asarray(tree.query(points if at is None else at, min(k, len(points)))[1])]
    around = around - around.mean(axis=1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]
