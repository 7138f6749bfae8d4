"""Distances of the points of one cloud from another one, with the uncertainty of each.

c2c: from each point to the plane through the other cloud's points around its foot, so each distance has the noise of its point.
m3c2: between the means of both clouds in a cylinder along the local normal; the points of a search cell share one distance.
Both leave a point without a distance (NaN) where the other cloud has no surface there.

Frame: file coordinates of both clouds, which must be the same; file units.  Positive: see viewer.work.comparing.facing.
Uncertainties are expanded to 95 %.  The error of the registration is what the caller says it is, and is added.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ....model.common.process.processors import in_rows
from ...common.errors import InputError
from ...common.progress import progress
from .cloud_scale import CloudScale, Sizes, scale_of, sizes_for
from .facing import Facing
from .point_cells import Cells, box_of, cells_of

METHODS = {"m3c2": "means of both scans in a cylinder along the local normal",
           "c2c": "each point to the local plane of the other scan"}  # fmt: skip
"""Method -> what it compares."""
_BLOCK = 1 << 17
"""Points between two looks at progress: about 0.2 s of two processors."""
_CORE_BLOCK = 1 << 14
"""Core points between two looks at progress, as long."""
_LEAST_ROWS = 1 << 10
"""A thread takes at least: some 2 ms."""
_FEWEST = 100
"""Points of a cloud that are compared, at least."""
COVERAGE = 1.959964
"""Standard deviations of a normal error that hold 95 %."""


@dataclass(frozen=True, eq=False)
class Distances:
    """Of the cloud after, in its order.

    distance: (n,) float64, NaN where a point has no counterpart.  uncertainty: (n,) float64, half the 95 % interval; for m3c2
    the level of detection.  method: a key of METHODS.  sizes, before, after: what was used.  cores: core points (m3c2), else
    points.  registration: in the uncertainty.  rule: a key of viewer.work.comparing.facing.TEXTS.
    """

    distance: np.ndarray
    uncertainty: np.ndarray
    method: str
    sizes: Sizes
    before: CloudScale
    after: CloudScale
    cores: int
    registration: float
    rule: str


def compare(before: np.ndarray, after: np.ndarray, facing: Facing, *, method: str = "m3c2", station: np.ndarray | None = None,
            registration: float = 0.0, depth: float | None = None, sizes: Sizes | None = None) -> Distances:  # fmt: skip
    """Distances of ``after`` from ``before``, (n, 3) and (m, 3) finite float64 in one frame.

    station: (n,) whole numbers, which of ``facing.places`` measured each point.  registration: uncertainty of the position of
    the clouds to each other, 95 %, file units.  sizes: None: derived from spacing and noise.  depth: how far a counterpart is
    looked for; None: that of the sizes.
    Raises InputError where a cloud has too few points or no extent, or they do not overlap; Cancelled where progress is.
    """
    for name, cloud in (("before", before), ("after", after)):
        if len(cloud) < _FEWEST:
            raise InputError(f"the scan {name} has {len(cloud):,} points, at least {_FEWEST} are compared")
    (least, most), (other_least, other_most) = box_of(before), box_of(after)
    low = np.minimum(least, other_least)
    with progress(4, "sorting points") as meter:
        scales = []
        for cloud, own in ((before, least), (after, other_least)):
            moved = cloud - low
            moved -= own - low
            scales.append(scale_of(moved))
            del moved
            meter.update(1)
        if not min(scale.spacing for scale in scales) > 0:
            raise InputError("a scan has all its points in one place")
        sizes = sizes_for(*scales) if sizes is None else sizes
        if depth is not None:  # farther than both reach, there is nothing
            sizes = replace(sizes, depth=min(depth, float(np.linalg.norm(np.maximum(most, other_most) - low))))
        if max((other_least - most).max(), (least - other_most).max()) > sizes.depth:
            raise InputError("the two scans do not overlap", remedy="check that both have the same coordinate system")
        side = sizes.diameter / 2 if method == "m3c2" else sizes.radius
        cells = []
        for cloud in (before, after):
            cells.append(cells_of(cloud - low, side))
            meter.update(1)
    found = (_m3c2 if method == "m3c2" else _c2c)(cells[0], cells[1], sizes, scales, low, facing, station)
    distance, uncertainty, cores = found
    uncertainty += registration
    return Distances(distance, uncertainty, method, sizes, scales[0], scales[1], cores, registration, facing.rule)


def core_points(cells: Cells) -> np.ndarray:
    """(c,) int64: of each cell the number, among the sorted points, of the one nearest to their mean."""
    found = np.empty(len(cells.keys), np.int64)
    for some in cells.in_blocks():
        begin, end = cells.first[some.start], cells.first[some.stop]
        first, counts, points = cells.first[some] - begin, cells.counts(some), cells.points[begin:end]
        mean = np.add.reduceat(points, first) / counts[:, None]
        away = ((points - np.repeat(mean, counts, axis=0)) ** 2).sum(axis=1)
        least = np.repeat(np.minimum.reduceat(away, first), counts)
        hit = np.flatnonzero(away <= least)
        found[some] = begin + hit[np.searchsorted(hit, first)]
    return found


def _m3c2(before: Cells, after: Cells, sizes: Sizes, scales: list[CloudScale], low: np.ndarray, facing: Facing,
          station: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, int]:  # fmt: skip
    from .m3c2_kernels import m3c2_at

    core = core_points(after)
    places = after.points[core]
    noise = max(scale.noise for scale in scales)
    distance, uncertainty = np.empty(len(core)), np.empty(len(core))

    def block(some: slice) -> None:
        normals, counts = np.empty((some.stop - some.start, 3)), np.empty((some.stop - some.start, 2), np.int32)
        in_rows(len(normals), _LEAST_ROWS, m3c2_at, places[some], sizes.scale, sizes.diameter, sizes.depth, noise, after.search,
                before.search, distance[some], uncertainty[some], normals, counts)
        stations = None if station is None else station[after.order[core[some]]]
        distance[some] *= facing.signs(normals, places[some] + low, stations)

    _in_blocks(len(core), _CORE_BLOCK, block)
    results = np.empty(len(after.points)), np.empty(len(after.points))
    for some in after.in_blocks():
        rows, counts = after.order[after.first[some.start] : after.first[some.stop]], after.counts(some)
        for values, result in zip((distance, uncertainty), results):
            result[rows] = np.repeat(values[some], counts)
    return *results, len(core)


def _c2c(before: Cells, after: Cells, sizes: Sizes, scales: list[CloudScale], low: np.ndarray, facing: Facing,
         station: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, int]:  # fmt: skip
    from .surface_kernels import distances_from_surface

    distance, uncertainty = np.empty(len(after.points)), np.empty(len(after.points))

    def block(some: slice) -> None:
        count = some.stop - some.start
        found, variance, normals = np.empty(count), np.empty(count), np.empty((count, 3))
        in_rows(count, _LEAST_ROWS, distances_from_surface, after.points[some], scales[1].noise, sizes.depth, sizes.radius,
                scales[0].noise, *before.search, found, variance, normals)
        rows = after.order[some]
        found *= facing.signs(normals, after.points[some] + low, None if station is None else station[rows])
        distance[rows], uncertainty[rows] = found, COVERAGE * np.sqrt(variance)

    _in_blocks(len(after.points), _BLOCK, block)
    return distance, uncertainty, len(after.points)


def _in_blocks(count: int, size: int, block: Callable[[slice], None]) -> None:
    with progress(count, "comparing", "point") as meter:
        for start in range(0, count, size):
            stop = min(start + size, count)
            block(slice(start, stop))
            meter.update(stop - start)
