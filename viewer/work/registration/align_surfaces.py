"""Aligns a scan to another by their surfaces: point-to-plane ICP by Open3D from coarse to fine, then robust least squares.

The start must be near: within about three of the coarsest voxels (half a metre in a room) and ten degrees, as after three pairs
of points.  Chen and Medioni, Object modelling by registration of multiple range images, 1992.
Frame: file coordinates of each scan, float64, one unit of length for both.  Uncertainties are expanded to 95 %; errors that
both scans have everywhere, as of the instrument's scale, are not in them.
"""

from dataclasses import dataclass

import numpy as np

from ...common.errors import InputError
from ...common.progress import progress
from ...common.rigid_transform import IDENTITY, Rows, combined, inverse, moved_points, rigid
from .final_fit import FinalFit, final_fit
from .icp_clouds import LEVELS, Thinned, finite_points, thinned, voxel_of

LEAST_OVERLAP = 0.1
"""Of the smaller scan: less is usually another place that happens to be near."""
LEAST_AGREEING = 0.5
"""Of the means that are near each other.  0.94 of those of synthetic rooms agree at the right place; at a wrong one, where a
corner lies in another, it was 0.8: this refuses the worst only.  The pairs of points are what tells the place."""
_WEAKEST = 0.004
"""Least share of the surfaces that must hold the alignment in each direction: 0.4 % of them are a door frame in a corridor."""
_NOISY = 8.0
"""The same, as a multiple of the variance of the normals, by which one flat wall seems to hold in its own plane."""
_LOOSEST = 0.25
"""Voxels: an alignment that repeats no better than this holds only here and there.  Right ones of five real scans repeat to
0.04 voxels, a wrong one to 0.7."""
_BOUND = 1 / 30
"""Voxels: systematic error of a place, because two stations see rough surfaces and edges differently and voxels average them.
Halves of five real scans, aligned again, were off by 0.006 to 0.016 voxels in three rooms, 0.026 in a street, and 0.055, of
which 0.024 is in the random part, in airborne data."""
_REACH = 3.0
"""Coarsest voxels within which ICP looks for a neighbour at first; one of the level in the later ones."""
_STEPS = 40
"""Of ICP, per level."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """transform: from the moving to the fixed scan.  rms: of the distances between the surfaces where they agree, units.
    overlap: share of the moving scan's surface that agrees with the fixed one, 0..1.
    uncertainty: of a place in the overlap, units: ``repeatability``, its random part, and a bound of the systematic one.
    turn_uncertainty: degrees, likewise.  moved: how far the start was off in the overlap, root mean square.  count: means of
    voxels that were compared.  voxel: their size."""

    transform: Rows
    rms: float
    overlap: float
    uncertainty: float
    repeatability: float
    turn_uncertainty: float
    moved: float
    count: int
    voxel: float


def align_surfaces(moving: np.ndarray, fixed: np.ndarray, start: Rows = IDENTITY) -> Alignment:
    """The transformation of a scan, (n, 3) points, to another, (m, 3), from ``start``.

    Raises InputError, in one line with a remedy, where a scan has too few points, they overlap too little, do not agree, or
    their common surfaces leave a motion undetermined (one wall, a pipe); Cancelled where progress is cancelled.
    """
    with progress(LEVELS + 4, "aligning surfaces", "step") as steps:
        moving, fixed = finite_points(moving, "moving"), finite_points(fixed, "fixed")
        centre = fixed.mean(axis=0)
        here = moving.mean(axis=0)
        # Relative to a centre near the points of each: map coordinates cost digits in the products.
        to_centre, from_here = rigid(np.eye(3), -centre), rigid(np.eye(3), here)
        local = combined(combined(to_centre, start), from_here)
        voxel = max(voxel_of(moving), voxel_of(fixed))
        steps.update(1)
        levels = [thinned(moving - here, voxel)]
        steps.update(1)
        levels.append(thinned(fixed - centre, voxel))
        steps.update(1)
        found = local
        for level, (one, other) in enumerate(zip(*levels)):
            found = _icp(one, other, found, _REACH * (1.0 if level == 0 else 0.5) * one.voxel)
            steps.update(1)
        fit = final_fit(levels[0][-1], levels[1][-1], found)
        steps.update(1)
    _check(fit, voxel)
    assert fit is not None
    transform = combined(combined(rigid(np.eye(3), centre), fit.transform), rigid(np.eye(3), -here))
    before = moved_points(local, moved_points(inverse(fit.transform), fit.points))
    moved = float(np.sqrt(((before - fit.points) ** 2).sum(axis=1).mean()))
    random, turn = uncertainty_of(fit)
    bound = _BOUND * voxel
    return Alignment(transform, float(np.sqrt((fit.residuals**2).mean())), fit.agreeing, random + bound, random,
                     turn + float(np.degrees(bound / fit.radius)), moved, len(fit.residuals), voxel)


def _icp(moving: Thinned, fixed: Thinned, start: Rows, reach: float) -> Rows:
    """One level of Open3D's ICP."""
    import open3d as o3d

    clouds = []
    for level in (moving, fixed):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(level.xyz))
        cloud.normals = o3d.utility.Vector3dVector(level.normals)
        clouds.append(cloud)
    registration = o3d.pipelines.registration
    estimation = registration.TransformationEstimationPointToPlane(registration.TukeyLoss(k=reach / 2))
    criteria = registration.ICPConvergenceCriteria(1e-7, 1e-7, _STEPS)
    result = registration.registration_icp(*clouds, reach, np.array(start), estimation, criteria)
    matrix = np.array(result.transformation)
    u, _, v = np.linalg.svd(matrix[:3, :3])  # its products of rotations drift by rounding
    return rigid(u @ v, matrix[:3, 3])


def _check(fit: FinalFit | None, voxel: float) -> None:
    """Raises InputError where the result is not to be used."""
    if fit is None or max(fit.agreeing, fit.of_fixed) < LEAST_OVERLAP:
        share = 0.0 if fit is None else 100 * max(fit.agreeing, fit.of_fixed)
        raise InputError(f"the scans have too little in common where they are now ({share:.0f} % of the surfaces)",
                         remedy="choose three pairs of points first, or better ones")
    if fit.agreeing < LEAST_AGREEING * fit.near:
        share = 100 * fit.agreeing / fit.near
        raise InputError(f"the surfaces of both scans are near each other, but only {share:.0f} % of them agree: a wrong place",
                         remedy="choose three pairs of points first, or better ones")
    shares, ways = np.linalg.eigh(fit.information)
    limit = max(_WEAKEST, _NOISY * fit.normal_noise)
    if shares[0] < limit:
        raise InputError(f"what the scans have in common does not hold the moving scan: it could still {_free(ways[:, 0])}",
                         remedy="add surfaces in other directions, or align it by pairs of points")
    if uncertainty_of(fit)[0] > _LOOSEST * voxel:
        raise InputError(f"the surfaces of both scans agree here and there only ({100 * fit.agreeing:.0f} % of them): a wrong "
                         "place", remedy="choose three pairs of points first, or better ones")


def _free(way: np.ndarray) -> str:
    """A motion (6,) that is not determined, in words; turns as lengths."""
    turn, shift = way[:3], way[3:]
    if np.linalg.norm(shift) >= np.linalg.norm(turn):
        return f"slide along ({', '.join(f'{value:.2f}' for value in shift / np.linalg.norm(shift))})"
    return f"turn about ({', '.join(f'{value:.2f}' for value in turn / np.linalg.norm(turn))})"


def uncertainty_of(fit: FinalFit) -> tuple[float, float]:
    """The random part of a place in the overlap (root mean square over it), and of the turn in degrees; at 95 %."""
    arms = fit.points - fit.middle
    spread = arms.T @ arms / len(arms)
    turn, shift = fit.covariance[:3, :3], fit.covariance[3:, 3:]
    # E |w x a|^2 = trace(W) trace(S) - trace(W S), of a turn w with covariance W and arms a with second moments S
    variance = float(np.trace(shift) + np.trace(turn) * np.trace(spread) - np.trace(turn @ spread))
    largest = float(np.linalg.eigvalsh(turn)[-1])
    return fit.coverage * float(np.sqrt(max(variance, 0.0))), fit.coverage * float(np.degrees(np.sqrt(max(largest, 0.0))))
