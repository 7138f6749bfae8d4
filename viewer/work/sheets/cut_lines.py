"""Lines along what a plan or a section cuts: polylines in the plane of the paper, from the points of a thin slab.

A plain NumPy implementation in four steps:

1. ``line_cells``: points in square cells; the scatter around each cell says where they lie along a line, and their noise.
2. From the densest of these cells on, a line grows in both directions while cells lie on it, to the first gap.
3. Each line is fitted to the points themselves (total least squares, those beyond 2.5 standard deviations left out), and ends
   where they end.
4. ``line_joins``: lines that meet become polylines with corners; straight parts of one wall become one line.

Nothing is drawn where nothing was measured: a line is interrupted wherever its points leave a gap longer than ``Trace.gap``,
and a corner is drawn only if it lies within that distance of the measured ends of both lines.  What fills an area of the slab
(a table's top, plants) gives no line.  Frame: paper coordinates (right, up), float64, file units.
"""

from dataclasses import dataclass, replace

import numpy as np

from .line_cells import LineCells, line_cells
from .line_joins import Segment, joined

_GAP = 2.5
"""Sides of a cell: the shortest gap that can be told from the distance of two cells on a slanting line."""
_RANDOM_GAP = 12.0
"""Mean distances of points along a line; among points at random places a longer gap has the probability exp(-12)."""
_SLANT = np.sin(np.radians(15.0))
"""Sine of the angle, at most, between a line and the direction of a cell on it."""
_TOLERANCE = 2.0
"""Standard deviations of the noise between a line and the (averaged) places that belong to it: a wall that bends more is two
lines."""
_TRIM = 2.5
_EXTRA = 4
"""Cells beyond the last straight one in which the points of a line are looked for: at its ends windows are half empty."""
_END = 2
"""The end of a line is its third point from there: a single point does not lengthen it."""
_CLEAR = 0.4
"""Share, at least, of the points around a line that lie on it; where points fill an area a fifth does."""
_SHORTEST_PART, _SHORTEST = 3.0, 10.0
"""Sides of a cell: the shortest straight part, and the shortest polyline."""


@dataclass(frozen=True, eq=False)
class Polyline:
    """vertices: (k, 2) float64 paper coordinates, file units.  closed: whether the last one is followed by the first."""

    vertices: np.ndarray
    closed: bool

    @property
    def length(self) -> float:
        """File units."""
        ring = np.concatenate([self.vertices, self.vertices[:1]]) if self.closed else self.vertices
        return float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Trace:
    """lines: longest first.  sigma: scatter of the points across the lines, one standard deviation.  gap: the longest gap that
    a line crosses.  tolerance: how far a wall may bend from its line.  All in file units.  used, count: points on lines, and
    all.
    """

    lines: tuple[Polyline, ...]
    sigma: float
    gap: float
    tolerance: float
    used: int
    count: int

    @property
    def length(self) -> float:
        """Of all lines, file units."""
        return sum(line.length for line in self.lines)


def trace(points: np.ndarray, spacing: float) -> Trace:
    """The lines along which the points of a thin slab lie.

    points: (n, 2) float64 paper coordinates, file units.  spacing: of the points on surfaces, file units, > 0.  No lines where
    there are too few points.  Random numbers are not used: the same points give the same lines.
    """
    points = np.asarray(points, np.float64)
    if len(points) < 2:
        return Trace((), 0.0, 0.0, 0.0, 0, len(points))
    centre = points.mean(axis=0)  # coordinates of a national grid lose nothing in squares then
    points = points - centre
    cells = line_cells(points, spacing)
    density = np.median(cells.around[cells.straight]) / (5 * cells.side) if cells.straight.any() else 1 / cells.side
    gap = max(_GAP * cells.side, _RANDOM_GAP / density)
    tolerance = max(_TOLERANCE * cells.sigma, 0.1 * cells.side)
    segments, used = _segments(points, cells, gap, tolerance)
    lines = [Polyline(vertices + centre, closed) for vertices, closed in joined(segments, gap + 2 * tolerance, tolerance)]
    kept = sorted((line for line in lines if line.length >= _SHORTEST * cells.side), key=lambda line: -line.length)
    return Trace(tuple(kept), cells.sigma, float(gap), float(tolerance), used, len(points))


def _segments(points: np.ndarray, cells: LineCells, gap: float, tolerance: float) -> tuple[list[Segment], int]:
    """Straight lines, and how many points lie on them."""
    from scipy.spatial import KDTree

    straight = np.flatnonzero(cells.straight)
    if not len(straight):
        return [], 0
    samples, every = KDTree(cells.sample[straight]), KDTree(cells.own)
    free = cells.straight.copy()
    found: list[Segment] = []
    used = np.zeros(len(points), bool)
    for seed in straight[np.argsort(-cells.around[straight], kind="stable")]:
        if not free[seed]:
            continue
        line = _grown(cells, samples, straight, free, int(seed), gap, tolerance)
        free[seed] = False
        if line is None:
            continue
        for part, numbers in _fitted(points, cells, every, line, gap):
            found.append(part)
            used[numbers] = True
            near = np.array(every.query_ball_point(part.middle, part.length / 2 + cells.side))
            along, across = part.coordinates(cells.own[near])
            slant = np.abs(cells.direction[near] @ part.across)
            on = (np.abs(across) <= max(1.5 * tolerance, 0.75 * cells.side)) & (slant <= 0.5)
            free[near[on & (along >= part.low - cells.side) & (along <= part.high + cells.side)]] = False
    return found, int(used.sum())


def _grown(cells: LineCells, tree, straight: np.ndarray, free: np.ndarray, seed: int, gap: float,
           tolerance: float) -> Segment | None:  # fmt: skip
    """The line through a cell, as far as free cells lie on it without a gap; None where it stays too short."""
    line = Segment(cells.sample[seed], cells.direction[seed], 0.0, 0.0)
    reach = 8.0 * cells.side
    for _ in range(40):
        near = straight[np.array(tree.query_ball_point(cells.sample[seed], reach))]
        near = near[free[near]]
        along, across = line.coordinates(cells.sample[near])
        on = (np.abs(across) <= tolerance) & (np.abs(cells.direction[near] @ line.across) <= _SLANT)
        near, along = near[on], along[on]
        start = line.coordinates(cells.sample[seed][None])[0][0]
        low, high = _run(along, start, gap)
        kept = (along >= low) & (along <= high)
        if np.count_nonzero(kept) < 3:
            return None
        before, line = line, _least_squares(cells.sample[near[kept]], cells.around[near[kept]])
        whole = max(high - start, start - low) < reach - gap
        if whole and abs(line.high - line.low - (before.high - before.low)) < cells.side:
            break
        if not whole:
            reach *= 2.0
    return line if line.length >= _SHORTEST_PART * cells.side / 2 else None


def _fitted(points: np.ndarray, cells: LineCells, tree, line: Segment, gap: float) -> list[tuple[Segment, np.ndarray]]:
    """The line fitted to the points themselves, in the parts into which gaps divide it, each with the numbers of its points."""
    extra = _EXTRA * cells.side
    near = np.array(tree.query_ball_point(line.middle, line.length / 2 + extra + cells.side))
    along, across = line.coordinates(cells.own[near])
    band = 4.0 * cells.sigma + cells.side
    within = (np.abs(across) <= band + cells.side) & (along >= line.low - extra) & (along <= line.high + extra)
    numbers = np.sort(cells.points_of(near[within]))
    width = max(_TRIM * cells.sigma, 0.05 * cells.side)
    for _ in range(4):
        along, across = line.coordinates(points[numbers])
        inner = (np.abs(across) <= width) & (along >= line.low) & (along <= line.high)
        if np.count_nonzero(inner) < 8:
            return []
        line = replace(_least_squares(points[numbers[inner]]), low=line.low, high=line.high).moved_to(line)
    along, across = line.coordinates(points[numbers])
    on = np.abs(across) <= width
    order = np.argsort(along[on])
    numbers_on, along_on = numbers[on][order], along[on][order]
    parts = []
    for part in np.split(np.arange(len(along_on)), np.flatnonzero(np.diff(along_on) > gap) + 1):
        if len(part) <= 2 * _END + 4:
            continue
        low, high = float(along_on[part[_END]]), float(along_on[part[-1 - _END]])
        around = (along >= low) & (along <= high) & (np.abs(across) <= band)
        overlap = min(high, line.high) - max(low, line.low)
        clear = len(part) >= _CLEAR * np.count_nonzero(around)
        if high - low >= _SHORTEST_PART * cells.side and overlap > 0.5 * (high - low) and clear:
            parts.append((replace(line, low=low, high=high), numbers_on[part]))
    return parts


def _run(along: np.ndarray, start: float, gap: float) -> tuple[float, float]:
    """Lowest and highest of the places that are connected with ``start`` by steps of at most ``gap``."""
    places = np.sort(np.append(along, start))
    at = int(np.searchsorted(places, start))
    breaks = np.flatnonzero(np.diff(places) > gap)
    low = breaks[breaks < at]
    high = breaks[breaks >= at]
    return float(places[low[-1] + 1] if len(low) else places[0]), float(places[high[0]] if len(high) else places[-1])


def _least_squares(places: np.ndarray, weights: np.ndarray | None = None) -> Segment:
    """The line with the least sum of squared distances, as long as the places lie along it."""
    middle = np.average(places, axis=0, weights=weights)
    way = places - middle
    _, axes = np.linalg.eigh((way if weights is None else way * weights[:, None]).T @ way)
    direction = axes[:, 1]
    along = way @ direction
    return Segment(middle, direction, float(along.min()), float(along.max()))
