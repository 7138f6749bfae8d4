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
    return len(np.unique(cells @ np.array([1, 1 << 21, 1 << 42])))


def thinned(xyz: np.ndarray, voxel: float) -> list[Thinned]:
    """The levels of a scan, the coarsest first; ``voxel``: of the finest."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(xyz)))
    levels = []
    for level in range(LEVELS):
        cloud = cloud.voxel_down_sample(voxel * 2**level)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(_NEIGHBOURS))
        levels.append(Thinned(np.array(cloud.points), np.array(cloud.normals), voxel * 2**level))
    return levels[::-1]
