"""Aligns a mesh to a scan: from coarse to fine as two scans are (align_surfaces), then the scan's points to the triangles.

The last step needs no sampling: each point near the mesh pulls along the normal of its nearest triangle (Chen and Medioni
1992), weighted by how well it agrees (Tukey).  Frame: the document's coordinates, float64.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from ...common.progress import progress
from ...common.rigid_transform import IDENTITY, Rows, combined, inverse, moved_points, rigid
from .align_surfaces import Alignment, align_surfaces

SAMPLES = 1_000_000
"""Places on a mesh that stand for its surface in the coarse part."""
_MOST = 200_000
"""Points of the scan in the last step: an even choice of them."""
_STEPS = 12
_STILL = 1e-7
"""Of the extent: a step that moves no point by more ends the last part."""
_TUKEY = 4.685
"""Standard deviations at which a residual has no weight: 95 % efficient for normal errors."""


@dataclass(frozen=True, eq=False)
class MeshAlignment:
    """transform: to be done after the mesh's present one.  surfaces: the coarse part, with overlap and uncertainty; its share
    is that of the mesh's surface.  rms: of the distances of the points from the triangles where they agree, units.
    count: of these points.  share: of the points within a voxel of the mesh, 0..1."""

    transform: Rows
    surfaces: Alignment
    rms: float
    count: int
    share: float


def surface_places(vertices: np.ndarray, faces: np.ndarray, count: int = SAMPLES) -> np.ndarray:
    """(count, 3) places spread evenly over triangles; the same in each call."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    random = np.random.default_rng(0)
    ends = np.cumsum(area)
    chosen = corners[np.minimum(np.searchsorted(ends, random.random(count) * ends[-1]), len(faces) - 1)]
    root, share = np.sqrt(random.random((count, 1))), random.random((count, 1))
    return (1 - root) * chosen[:, 0] + root * (1 - share) * chosen[:, 1] + root * share * chosen[:, 2]


def align_mesh(vertices: np.ndarray, faces: np.ndarray, fixed: np.ndarray, start: Rows = IDENTITY) -> MeshAlignment:
    """The motion of a mesh, (V, 3) vertices and (F, 3) indices, to a scan, (m, 3) points, from ``start``.  Raises InputError as
    align_surfaces does; Cancelled where progress is cancelled."""
    found = align_surfaces(surface_places(vertices, faces), fixed, start)
    points = fixed[np.isfinite(fixed).all(axis=1)]
    points = points[:: max(1, len(points) // _MOST)]
    return _to_triangles(vertices, faces, points, found)


def _to_triangles(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray, found: Alignment) -> MeshAlignment:
    import open3d as o3d

    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    corners = (vertices - middle)[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    tensor, rays = cast(Any, o3d.core.Tensor), o3d.t.geometry.RaycastingScene()
    rays.add_triangles(tensor((vertices - middle).astype(np.float32)), tensor(faces.astype(np.uint32)))
    here = moved_points(combined(rigid(np.eye(3), -middle), inverse(found.transform)), points)
    reach, still = found.voxel, _STILL * float(np.ptp(here, axis=0).max())
    residuals, near, spread = np.zeros(0), np.zeros(len(here), bool), 0.0
    with progress(_STEPS, "aligning to the triangles", "step") as steps:
        for _ in range(_STEPS):
            triangle = rays.compute_closest_points(tensor(here.astype(np.float32)))
            place = triangle["points"].numpy().astype(np.float64)
            number = triangle["primitive_ids"].numpy()
            near = ((here - place) ** 2).sum(axis=1) < reach**2
            some, normal = here[near], across[number[near]]
            residuals = ((some - corners[number[near], 0]) * normal).sum(axis=1)
            spread = 1.4826 * float(np.median(np.abs(residuals))) + 1e-12
            weight = np.maximum(1 - (residuals / (_TUKEY * spread)) ** 2, 0.0) ** 2
            rows = np.concatenate([np.cross(some, normal), normal], axis=1)
            step = np.linalg.lstsq((rows * weight[:, None]).T @ rows, -(rows * weight[:, None]).T @ residuals, rcond=None)[0]
            motion = rigid(_rotation(step[:3]), step[3:])
            after = moved_points(motion, here)
            moved, here = float(np.abs(after - here).max()), after
            steps.update(1)
            if moved < still:
                break
    # the mesh moves as the points were moved, backwards: from where they were measured to where they lie on the mesh
    back = _rigid_between(here, points - middle)
    transform = combined(combined(rigid(np.eye(3), middle), back), rigid(np.eye(3), -middle))
    agree = np.abs(residuals) < _TUKEY * spread
    rms = float(np.sqrt((residuals[agree] ** 2).mean()))
    return MeshAlignment(transform, found, rms, int(agree.sum()), float(near.mean()))


def _rotation(turn: np.ndarray) -> np.ndarray:
    """(3, 3) of a rotation vector, radians."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(turn).as_matrix()


def _rigid_between(one: np.ndarray, other: np.ndarray) -> Rows:
    """The motion that brings (n, 3) points to where the same ones are in another frame (Kabsch)."""
    a, b = one.mean(axis=0), other.mean(axis=0)
    u, _, v = np.linalg.svd((other - b).T @ (one - a))
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    return rigid(turn, b - turn @ a)


def mesh_words(found: MeshAlignment, unit: str) -> str:
    """What is known of an alignment, in lines."""
    surfaces = found.surfaces
    return (f"points lie {found.rms:.2g} {unit} from its surfaces (RMS of {found.count:,})\n"
            f"{100 * surfaces.overlap:.0f} % of its surfaces overlap\n"
            f"place certain to {surfaces.uncertainty:.1g} {unit} (95 %)")
