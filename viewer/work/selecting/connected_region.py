"""What hangs together with a point: cubes of space that hold points and touch, or one smooth surface of them.

Points nearer to each other than the gap are always joined, those farther apart than 3.5 times the gap never (two cubes that
touch at a corner).  A smooth surface goes on from cube to cube where its normal turns little and the points around are flat;
along its edges the points near its plane belong to it (region growing, Rabbani, van den Heuvel, Vosselman 2006, on cubes
instead of points).  Frame: file coordinates, float64.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ...common.errors import InputError
from ...common.progress import progress
from ...grid.gathered_rows import points_of
from ..selection import Selection
from .select_points import in_sight, pieces

if TYPE_CHECKING:
    from ...grid.scene import Scene

SPACINGS = 5.0
"""The usual gap in point spacings: 25 points of a surface in a cube.  Half of it leaves holes in a random sample of a surface
with as many points; chosen on synthetic rooms."""
TURN = 25.0
"""Degrees between the normals of neighbouring cubes, at most.  A pipe is whole where its radius is above 20 spacings (at 14,
one of twelve synthetic pipes came to 64 %); edges of 90 degrees are told by their neighbourhood, which is not flat."""
FLAT = 0.08
"""Of a flat neighbourhood of 3 x 3 x 3 cubes, the least variance over the middle one; of a right angle in it 0.25 and more."""
FEWEST = 6
"""Points around from which a plane is told."""
RINGS = 2
"""Cubes along an edge whose neighbourhood has points of both sides: the cube of the edge, and the one beside it."""
_SIGMAS = 3.0
"""Standard deviations from the plane within which a point at an edge belongs to it."""
_ROUGHEST = 2.0
"""Of a cube's deviation from its plane, times the surface's usual one."""
MOST = 200_000_000
"""Points that are looked at: 16 bytes of memory each."""


def usual_gap(scene: "Scene") -> float:
    """The gap where none is chosen, file units."""
    return SPACINGS * scene.spacing or scene.cell_size / 16


def connected_region(sight: Selection, place: np.ndarray, gap: float | None = None, *, smooth: bool = False) -> np.ndarray:
    """(N,) bool: the points in sight that hang together with the one nearest to ``place``, (3,).

    gap: file units; None: the usual one.  smooth: one surface, which ends at edges.  Raises InputError where the scan has too
    many points, or is too large for the gap."""
    from .connected_kernels import LAST, cube_keys, grown

    scene, side = sight.scene, usual_gap(sight.scene) if gap is None else gap
    low, high = scene.bounds
    if scene.count > MOST:
        raise InputError(f"{scene.count:,} points: what hangs together is found among {MOST:,} at most",
                         remedy="use a lasso, or open a part of the scan")
    if float((high - low).max()) / side >= LAST - 4:
        raise InputError(f"a gap of {side:g} is too small for this scan", remedy="choose a larger one")
    shift = scene.origin - low + 2 * side
    coords = np.asarray(scene.cell_coords)
    with progress(4, "Finding what hangs together") as meter:
        keys = np.where(in_sight(sight, np.ones(scene.count, bool)), np.int64(0), np.int64(-1))
        for base, stop, some, offsets in pieces(scene):
            in_rows(stop - base, 64, cube_keys, points_of(scene, some.start, some.stop), offsets, coords, scene.cell_size,
                    shift, side, keys[some], base)  # fmt: skip
        meter.update(1)
        cubes, rows = np.unique(keys, return_inverse=True)
        rows = rows.reshape(-1)  # NumPy 2.0 gives it the shape of the keys
        if len(cubes) and cubes[0] < 0:
            cubes, rows = cubes[1:], rows - 1
        meter.update(1)
        hits = np.zeros(scene.count, bool)
        if len(cubes) == 0:
            return hits
        start = _nearest(cubes, (place - low + 2 * side) / side)
        if not smooth:
            joined = grown(cubes, start, np.empty((0, 3)), np.empty(0, bool), 0.0)
            meter.update(2)
            seen = rows >= 0
            hits[seen] = joined[rows[seen]]
            return hits
        _surface(scene, shift, side, cubes, rows, start, hits)
        meter.update(2)
    return hits


def _nearest(cubes: np.ndarray, at: np.ndarray) -> int:
    """Row of the cube nearest to a place, in cubes."""
    from .connected_kernels import BITS, LAST

    middles = np.stack([cubes >> 2 * BITS, cubes >> BITS & LAST, cubes & LAST], axis=1) + 0.5
    return int(((middles - at) ** 2).sum(axis=1).argmin())


def _surface(scene: "Scene", shift: np.ndarray, side: float, cubes: np.ndarray, rows: np.ndarray,
             start: int, hits: np.ndarray) -> None:
    """Marks the points of the smooth surface through a cube."""
    from ..point_moments import mean_and_covariance
    from .connected_kernels import BITS, LAST, add_moments, around, grown, near_planes, widened

    coords = np.asarray(scene.cell_coords)
    moments, near = np.zeros((len(cubes), 10)), np.zeros((len(cubes), 10))
    for base, stop, some, offsets in pieces(scene):
        add_moments(points_of(scene, some.start, some.stop), offsets, coords, scene.cell_size, shift, side, rows[some], moments,
                    base, stop)  # fmt: skip
    in_rows(len(cubes), 256, around, cubes, moments, side, near)
    means, covariances = mean_and_covariance(near)
    variances, axes = np.linalg.eigh(covariances)
    normals = np.ascontiguousarray(axes[:, :, 0])
    flat = (near[:, 0] >= FEWEST) & (variances[:, 0] <= FLAT * variances[:, 1])
    joined = grown(cubes, start, normals, flat, float(np.cos(np.radians(TURN))))
    corners = np.stack([cubes >> 2 * BITS, cubes >> BITS & LAST, cubes & LAST], axis=1) * side
    nearest = np.where(joined, np.arange(len(cubes)), -1)
    for _ in range(RINGS):
        nearest = widened(cubes, nearest)
    sigma = np.sqrt(np.maximum(variances[:, 0], 0.0))
    least = float(np.median(sigma[joined])) if joined.any() else 0.0
    least = max(least, scene.step)
    reach = _SIGMAS * np.clip(sigma, least, _ROUGHEST * least)  # where two surfaces meet, both are in a cube's deviation
    for base, stop, some, offsets in pieces(scene):
        near_planes(points_of(scene, some.start, some.stop), offsets, coords, scene.cell_size, shift, rows[some], nearest,
                    corners + means, normals, reach, hits[some], base, stop)  # fmt: skip
