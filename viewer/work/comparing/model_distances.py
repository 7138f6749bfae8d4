"""Signed distances of the points of a scan from a model of triangles, with the uncertainty of each.

Open3D finds the triangle nearest to each point; the distance to it is computed in float64.  Positive is the side to which the
triangle's normal points; at an edge the sum of the normals of its faces decides, at a corner the mean of those around it, by
their angles there (Baerentzen and Aanaes 2005).  Where
the triangles of a model are not oriented alike, the sign says nothing.
Frame: the scan's coordinates, float64; its units.
"""

from dataclasses import replace
from typing import Any, cast

import numpy as np

from ....model.common.process.processors import in_rows
from ...common.errors import InputError
from ...common.progress import progress
from ...picture.dates.date_comparison import FROM_MODEL
from .cloud_scale import CloudScale, scale_of, sizes_for
from .compare import COVERAGE, Distances
from .triangle_loops import nearest_weights

METHOD, RULE = FROM_MODEL, "model"
_BLOCK = 1 << 18
"""Points between two looks at progress."""
_LEAST_ROWS = 1 << 12
_AT_EDGE = 1e-9
"""Weight of a corner below which a place lies on the edge opposite of it: what rounding leaves there, 1e-16, and more.  Of two
faces float32 may name the one that is no nearer, whose own normal says nothing of the side."""


def distances_from_model(vertices: np.ndarray, faces: np.ndarray, xyz: np.ndarray, *, registration: float = 0.0) -> Distances:
    """Distances of (n, 3) points from the triangles ``faces`` (F, 3) of (V, 3) vertices.

    The uncertainty is that of the scan's noise and of the registration (95 %); the model counts as exact.  Each point has its
    distance, however far it is: see :func:`within`.  Raises Cancelled where progress is.
    """
    import open3d as o3d

    origin = (xyz.min(axis=0) + xyz.max(axis=0)) / 2
    points, corners = xyz - origin, (vertices - origin)[faces]
    scale = scale_of(points - points.min(axis=0))
    sizes, tensor = sizes_for(scale), cast(Any, o3d.core.Tensor)
    rays = o3d.t.geometry.RaycastingScene()
    rays.add_triangles(tensor((vertices - origin).astype(np.float32)), tensor(faces.astype(np.uint32)))
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    around, beside = mean_normals(vertices, faces, across), edge_normals(vertices, faces, across)
    distance = np.empty(len(points))
    with progress(len(points), "comparing", "point") as meter:
        for start in range(0, len(points), _BLOCK):
            some = points[start : start + _BLOCK]
            found = rays.compute_closest_points(tensor(some.astype(np.float32)))["primitive_ids"].numpy()
            distance[start : start + len(some)] = _signed(some, corners[found], across[found], around[faces[found]],
                                                          beside[found])  # fmt: skip
            meter.update(len(some))
    unsure = np.full(len(points), COVERAGE * scale.noise + registration)
    return Distances(distance, unsure, METHOD, sizes, CloudScale(0.0, 0.0), scale, len(points), registration, RULE)


def within(found: Distances, depth: float | None = None, limit: float | None = None) -> Distances:
    """The distances of a model up to ``depth``; points farther away have none: they are not of what was modelled.

    depth: file units; None: the search depth of two such scans, or ``limit``, where the colours end, if that is larger.
    Raises InputError where no point is so near.
    """
    depth = max(found.sizes.depth, limit or 0.0) if depth is None else depth
    size = np.abs(found.distance)
    distance = np.where(size <= depth, found.distance, np.nan)
    if not np.isfinite(distance).any():
        raise InputError(f"no point of the scan is within {depth:.3g} of the model, the nearest is at {np.nanmin(size):.3g}",
                         remedy="check that both have the same coordinates and up axis")
    return replace(found, distance=distance, sizes=replace(found.sizes, depth=depth))


def _signed(points: np.ndarray, corners: np.ndarray, across: np.ndarray, around: np.ndarray,
            beside: np.ndarray) -> np.ndarray:  # fmt: skip
    """(n,) distances from the triangles (n, 3, 3), positive along ``across`` (n, 3); around: (n, 3, 3) at their corners;
    beside: (n, 3, 3) at the edge that is opposite each corner."""
    weights = np.empty((len(points), 3))
    in_rows(len(points), _LEAST_ROWS, nearest_weights, points, np.ascontiguousarray(corners), weights)
    way = points - np.einsum("ij,ijk->ik", weights, corners)
    zero = weights < _AT_EDGE
    at_edge = np.take_along_axis(beside, zero.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    at_corner = np.einsum("ij,ijk->ik", weights, around)
    count = zero.sum(axis=1, keepdims=True)
    normal = np.where(count == 0, across, np.where(count == 1, at_edge, at_corner))
    return np.linalg.norm(way, axis=1) * np.where(np.einsum("ij,ij->i", way, normal) < 0, -1.0, 1.0)


def mean_normals(vertices: np.ndarray, faces: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(V, 3): at each vertex the mean of the unit normals (F, 3) of the faces around its place, by their angles there."""
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    place = place.reshape(-1)
    sums = np.zeros((int(place.max()) + 1, 3))
    for corner in range(3):
        here = vertices[faces[:, corner]]
        one, other = (vertices[faces[:, (corner + step) % 3]] - here for step in (1, 2))
        angle = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
        for axis in range(3):
            sums[:, axis] += np.bincount(place[faces[:, corner]], angle * across[:, axis], len(sums))
    return sums[place]


def edge_normals(vertices: np.ndarray, faces: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(F, 3, 3): at the edge opposite each corner of a face the sum of the unit normals (F, 3) of the faces that share its
    place."""
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    corners = place.reshape(-1)[faces].astype(np.int64)
    ends = np.sort(np.stack([corners[:, [1, 2]], corners[:, [2, 0]], corners[:, [0, 1]]], axis=1), axis=2)
    _, edge = np.unique(ends[..., 0] * (corners.max() + 1) + ends[..., 1], return_inverse=True)
    edge = edge.reshape(-1, 3)
    sums = np.zeros((int(edge.max()) + 1, 3))
    for corner in range(3):
        for axis in range(3):
            sums[:, axis] += np.bincount(edge[:, corner], across[:, axis], len(sums))
    return sums[edge]
