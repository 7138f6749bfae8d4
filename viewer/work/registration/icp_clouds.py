"""Scans thinned for ICP: means of the points in voxels, with normals, at several sizes of the voxels.

The finest voxels hold about FINEST means: what ICP gains from more is less than what real surfaces and scanners are off by.
They are never finer than twice the point spacing, so that a mean has neighbours for its normal.
Frame: relative to a centre that the caller chooses near the points, float64, file units.
"""

from dataclasses import dataclass

import numpy as np

from ...common.errors import InputError

FINEST = 60_000
"""Means in the finest level, about; ICP of two such clouds takes 2 s on two cores (measured)."""
LEVELS = 3
"""Sizes of voxels, each twice the next."""
LEAST = 500
"""Points of a scan below which it is not aligned by ICP: they show no surfaces."""
_NEIGHBOURS = 12
"""Means around each from which its normal is found: two rings of a surface."""
_SAMPLED = 250_000
"""Points from which the size of voxels is found, four for each of FINEST."""


@dataclass(frozen=True, eq=False)
class Thinned:
    """xyz, normals: (n, 3) float64, of one level.  voxel: length of its edge."""

    xyz: np.ndarray
    normals: np.ndarray
    voxel: float


def finite_points(xyz: np.ndarray, which: str) -> np.ndarray:
    """The points (n, 3) without those that are not finite, float64.  Raises InputError where too few are left."""
    xyz = np.asarray(xyz, np.float64).reshape(-1, 3)
    finite = np.isfinite(xyz).all(axis=1)
    xyz = xyz if finite.all() else xyz[finite]
    if len(xyz) < LEAST:
        raise InputError(f"the {which} scan has {len(xyz):,} points there; aligning by surfaces takes {LEAST} or more")
    return xyz


def voxel_of(xyz: np.ndarray) -> float:
    """The edge of the voxels that about FINEST of which hold points, at least twice the point spacing."""
    step = max(1, len(xyz) // _SAMPLED)
    some = xyz[::step] - xyz.min(axis=0)
    high = float(some.max())
    if high <= 0:
        raise InputError("all points of a scan are at one place; it cannot be aligned")
    low = high / (1 << 20)
    target = min(FINEST, len(some) // 4)
    for _ in range(24):  # a factor of 1 << 20 to within 10 %
        middle = float(np.sqrt(low * high))
        if _occupied(some, middle) > target:
            low = middle
        else:
            high = middle
        if high < 1.1 * low:
            break
    spacing = high * float(np.sqrt(_occupied(some, high) / len(xyz)))
    return max(high, 2.0 * spacing)


def _occupied(xyz: np.ndarray, voxel: float) -> int:
    """Voxels that hold points of (n, 3), whose coordinates are at least 0."""
    cells = (xyz / voxel).astype(np.int64)
    # Not np.unique, whose hash table takes 40 times as long and holds the interpreter's lock: the window would not answer.
    keys = np.sort(cells @ np.array([1, 1 << 21, 1 << 42]))
    return 1 + int(np.count_nonzero(np.diff(keys)))


def thinned(xyz: np.ndarray, voxel: float) -> list[Thinned]:
    """The levels of a scan, the coarsest first; ``voxel``: of the finest.  Other threads run meanwhile, which they would not
    while Open3D thins points: the window answers keys."""
    levels = []
    for level in range(LEVELS):
        xyz = voxel_means(xyz, voxel * 2**level)
        levels.append(Thinned(xyz, normals_of(xyz), voxel * 2**level))
    return levels[::-1]


def voxel_means(xyz: np.ndarray, voxel: float) -> np.ndarray:
    """(m, 3): the mean of the points (n, 3) in each voxel that holds any."""
    cells = ((xyz - xyz.min(axis=0)) / voxel).astype(np.int64)
    keys = cells @ np.array([1, 1 << 21, 1 << 42])
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    return np.add.reduceat(xyz[order], starts, axis=0) / np.diff(starts, append=len(xyz))[:, None]


def normals_of(xyz: np.ndarray) -> np.ndarray:
    """(n, 3) unit normals, to either side, of the planes nearest to each point (n, 3) and its neighbours."""
    from scipy.spatial import cKDTree  # type: ignore[attr-defined]

    count = min(_NEIGHBOURS, len(xyz))
    _, index = cKDTree(xyz).query(xyz, count, workers=-1)
    around = xyz[index.reshape(len(xyz), count)]
    around = around - around.mean(axis=1, keepdims=True)
    return np.ascontiguousarray(np.linalg.eigh(around.transpose(0, 2, 1) @ around)[1][:, :, 0])
