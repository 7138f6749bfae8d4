"""Heights of a surface in the cells of a grid, how uncertain they are, and the volumes above and below 0 of them.

How cells without points are filled and what the uncertainty holds: viewer.work.measuring.height_grid.
Frame: heights above a base, file units, float64.
"""

from dataclasses import dataclass

import numpy as np

_UNEVEN = 0.12
"""Error of a cell's mean height in standard deviations of its heights, where points are spread unevenly: half of a wall is
measured at the density of the level surface beside it.  Found on synthetic boxes and cones."""
_LOWEST = 0.05
"""Share of the heights around a hole that lie below the lowest one that is taken: single points are often wrong."""
_ROUGH = 0.1
"""Error of an interpolated height in slopes times the distance from the next point, where a hole is surrounded by one height.
Chance holes are one or two cells wide.  With half and twice of it the heaps of tests/unit/work/test_volume.py lie within what
is stated."""
_ONE_SIDED = 0.4
"""Mean of the positive part of a normal deviation, in standard deviations: 1 / sqrt(2 pi)."""
_LAYERED = 6.0
"""Steps in a cell's heights that are larger than so many cells are those between two surfaces."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid over a polygon.  shape: cells along u and v.  low: (2,) its corner.  cell: side of a cell.  inside: (shape) share
    of each cell in the polygon."""

    shape: tuple[int, int]
    low: np.ndarray
    cell: float
    inside: np.ndarray

    def cells(self, flat: np.ndarray) -> np.ndarray:
        """(n,) numbers of the cells of (n, 2) places; -1 outside."""
        at = np.floor((flat - self.low) / self.cell).astype(np.int64)
        within = ((at >= 0) & (at < self.shape)).all(axis=1)
        return np.where(within, at[:, 0] * self.shape[1] + at[:, 1], -1)

    def between(self, heights: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """(n,) heights at (n, 2) places, by bilinear interpolation between the middles of cells.  heights: of the cells."""
        from scipy.ndimage import map_coordinates

        at = (flat - self.low) / self.cell - 0.5
        return np.asarray(map_coordinates(heights.reshape(self.shape), at.T, order=1, mode="nearest"))


@dataclass(frozen=True, eq=False)
class Heights:
    """Of each cell, (n,): height.  spread: standard deviation of its mean.  steep: of where its points lie, in steep cells.
    one_side: what is taken to err to the same side everywhere.  weight: the cell's area inside the polygon, of which the sum is
    1.  empty, layered: shares of the area without points, and with two surfaces."""

    height: np.ndarray
    spread: np.ndarray
    steep: np.ndarray
    one_side: np.ndarray
    weight: np.ndarray
    empty: float
    layered: float

    def minus(self, other: "Heights") -> "Heights":
        """How far this surface lies above another one in the same grid; the errors of both are independent."""
        return Heights(self.height - other.height, np.hypot(self.spread, other.spread), np.hypot(self.steep, other.steep),
                       np.hypot(self.one_side, other.one_side), self.weight, max(self.empty, other.empty),
                       max(self.layered, other.layered))


def heights_of(cells: np.ndarray, above: np.ndarray, grid: Grid) -> Heights:
    """cells: (m,) numbers of the cells of points, above: (m,) their heights."""
    size, inside = grid.inside.size, grid.inside.ravel()
    counts = np.bincount(cells, minlength=size)
    known = counts > 0
    mean = np.bincount(cells, above, size) / np.maximum(counts, 1)
    scatter = np.bincount(cells, (above - mean[cells]) ** 2, size)
    pooled = scatter.sum() / max(len(cells) - known.sum(), 1)
    variance = (scatter + pooled) / np.maximum(counts, 1)  # one count more, so that a lone point has one, too
    usual = float(np.median(variance[known & (inside > 0)]))
    height, unseen = (each.ravel() for each in _filled(mean.reshape(grid.shape), known.reshape(grid.shape),
                                                       inside.reshape(grid.shape) > 0))
    spread = np.where(known, np.sqrt(variance / np.maximum(counts, 1)), np.sqrt(usual))
    steep = np.where(known, np.sqrt(np.maximum(variance - usual, 0.0)), 0.0)
    highest, lowest = np.full(size, -np.inf), np.full(size, np.inf)
    np.maximum.at(highest, cells, above)
    np.minimum.at(lowest, cells, above)
    layered = known & (highest - lowest > _LAYERED * grid.cell) & (counts > 1)
    weight = inside / inside.sum()
    return Heights(height, spread, steep, unseen + _UNEVEN * steep, weight, float(weight @ ~known), float(weight @ layered))


def volumes_of(height: np.ndarray, surface: Heights, area: float, base_spread: float
               ) -> tuple[float, float, float, float, float]:
    """Above 0, below 0, and the uncertainties (95 %) of their difference and of each.

    height: (n,) of the cells.  base_spread: standard deviation of 0, the same everywhere."""
    weight, spread, steep, one_side = surface.weight * area, surface.spread, surface.steep, surface.one_side

    def unsure(part: np.ndarray) -> float:
        """Of the volume in the cells of which ``part`` is the share that counts."""
        share = weight * part
        random = float(((share * np.hypot(spread, steep)) ** 2).sum())
        return 2 * float(np.sqrt(random + (share @ one_side) ** 2 + (share.sum() * base_spread) ** 2))

    parts, unsures = [], []
    for sign in (1.0, -1.0):
        parts.append(float(weight @ np.maximum(sign * height, 0.0)))
        doubt = np.hypot(np.hypot(spread, base_spread), one_side)
        part = (sign * height > -2 * doubt).astype(np.float64)
        level = np.abs(height) < 2 * doubt  # noise counts on both sides there
        unsures.append(unsure(part) + _ONE_SIDED * float(weight @ (level * spread)))
    return parts[0], parts[1], unsure(np.ones(len(height))), unsures[0], unsures[1]


def _filled(mean: np.ndarray, known: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights of all cells, those without points between the lowest one around their hole and the line across it; and the
    standard deviations of what was filled, 0 of other cells."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.ndimage import binary_dilation, distance_transform_edt, grey_dilation, label

    missing = wanted & ~known
    if not missing.any() or known.sum() < 4:
        return mean, np.zeros(mean.shape)
    away, nearest = distance_transform_edt(~known, return_indices=True)  # type: ignore[reportGeneralTypeIssues]
    line = mean[tuple(np.asarray(nearest, np.int64))]
    around = np.ones((3, 3), bool)
    rim = known & binary_dilation(missing, around)
    places = np.argwhere(rim).astype(np.float64)
    if len(places) > 3 and np.linalg.matrix_rank(places - places[0]) == 2:
        between = LinearNDInterpolator(places, mean[rim])(np.argwhere(missing))
        line[missing] = np.where(np.isfinite(between), between, line[missing])
    holes = np.asarray(label(missing, around)[0], np.int64)  # type: ignore[reportIndexIssue]
    count = int(holes.max())
    beside = np.where(rim, grey_dilation(holes, (3, 3)), 0)  # the hole that a cell of the rim lies at; of several, one
    order = np.lexsort((mean[rim], beside[rim]))
    numbers, heights = beside[rim][order], mean[rim][order]
    first, last = (np.searchsorted(numbers, np.arange(count + 1), side) for side in ("left", "right"))
    taken = np.minimum(first + ((last - first) * _LOWEST).astype(int), len(heights) - 1)
    lowest = np.where(last > first, heights[taken], np.inf)[np.maximum(holes, beside)]
    half = np.where(rim, 0.5, np.where(missing, 1.0, 0.0))  # cells at a hole belong to it by half
    room = half * np.maximum(line - np.where(np.isfinite(lowest), lowest, line), 0.0)
    rough = np.where(missing, _ROUGH * _slope(mean, known) * away, 0.0)
    return line - room / 2, np.hypot(room / np.sqrt(12.0), rough)


def _slope(mean: np.ndarray, known: np.ndarray) -> float:
    """Root mean square slope between neighbouring cells, a cell."""
    total, count = 0.0, 0
    for axis in (0, 1):
        both = np.take(known, range(1, known.shape[axis]), axis) & np.take(known, range(known.shape[axis] - 1), axis)
        total += float((np.diff(mean, axis=axis)[both] ** 2).sum())
        count += int(both.sum())
    return float(np.sqrt(2 * total / max(count, 1)))
