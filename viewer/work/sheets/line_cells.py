"""The points of a cut in square cells, and how straight they lie around each cell.

The first step of :func:`viewer.work.sheets.cut_lines.trace`.  Frame: paper coordinates (right, up), float64, file units.
"""

from dataclasses import dataclass

import numpy as np

_REACH = 2
"""Cells on either side that are looked at with a cell: a window of 5 x 5."""
_LEAST = 8
"""Points in a window, at least, that tell a direction."""
_NARROW = 0.3
"""Standard deviation across a line, at most, in sides of a cell: a line is then six times as long in its window as wide."""
_GROWTH = 1.5
_TRIES = 8
"""Cells grow by this factor until noise is small in them, at most so many times: to 17 times the first side."""
_WIDE = 0.9
"""Standard deviation along a line, at least, in sides of a cell; of a window that is filled along a line it is 1.44."""
_WALLS = 0.25
"""Quantile of the scatter of all windows that is taken for the noise: walls scatter least, furniture and plants more."""


@dataclass(frozen=True, eq=False)
class LineCells:
    """The cells that hold points, C of them, of n points.

    side: file units.  sigma: standard deviation of the points across the lines, file units.  order: (n,) int64, the points
    sorted by cell.  starts: (C + 1,) int64, where each cell's points begin in ``order``.  own: (C, 2) float64, mean of the
    cell's points.  sample: (C, 2), the place on the line of the cell's window that is nearest to ``own``.  direction: (C, 2),
    unit vectors along it.  around: (C,) int64, points in the window.  straight: (C,) bool, whether the window holds a line.
    """

    side: float
    sigma: float
    order: np.ndarray
    starts: np.ndarray
    own: np.ndarray
    sample: np.ndarray
    direction: np.ndarray
    around: np.ndarray
    straight: np.ndarray

    def points_of(self, cells: np.ndarray) -> np.ndarray:
        """(k,) int64: numbers of the points of some cells."""
        parts = [self.order[self.starts[cell] : self.starts[cell + 1]] for cell in cells]
        return np.concatenate(parts) if parts else np.empty(0, np.int64)


def line_cells(points: np.ndarray, spacing: float) -> LineCells:
    """Cells of a side at which noise is small and lines are seen: the smallest of twice the spacing times 1.5**k.

    points: (n, 2) float64, n > 0.  spacing: of the points on surfaces, file units, > 0.
    """
    side = 2.0 * spacing
    for _ in range(_TRIES):
        cells = _cells(points, side)
        if cells is not None and cells.sigma <= _NARROW * side:
            return cells
        side *= _GROWTH
    return cells if cells is not None else _cells(points, side, least=0)  # type: ignore[return-value]


def _cells(points: np.ndarray, side: float, least: int = _LEAST) -> LineCells | None:
    """None where most windows hold fewer than ``least`` points."""
    origin = points.min(axis=0) - 0.5 * side
    at = np.floor((points - origin) / side).astype(np.int64)
    stride = int(at[:, 1].max()) + 2 * _REACH + 1
    keys, cell_of, counts = np.unique(at[:, 0] * stride + at[:, 1], return_inverse=True, return_counts=True)
    cell_of = cell_of.reshape(-1)
    middle = np.stack([keys // stride, keys % stride], axis=1) * side + origin + 0.5 * side
    x, y = (points - middle[cell_of]).T
    moments = np.stack([np.bincount(cell_of, weights=values, minlength=len(keys))
                        for values in (np.ones(len(x)), x, y, x * x, x * y, y * y)], axis=1)  # fmt: skip
    around = _summed(keys, moments, stride, side)
    count = around[:, 0]
    if np.average(count, weights=counts) < least:
        return None
    mean = around[:, 1:3] / count[:, None]
    xx, xy, yy = (around[:, 3:] / count[:, None] - np.stack([mean[:, 0] ** 2, mean.prod(axis=1), mean[:, 1] ** 2], axis=1)).T
    half, apart = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    wide, narrow = np.sqrt(np.maximum(half + apart, 0)), np.sqrt(np.maximum(half - apart, 0))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    own = middle + moments[:, 1:3] / moments[:, :1]
    mean = middle + mean
    sample = mean + ((own - mean) * direction).sum(axis=1)[:, None] * direction
    along = (count >= least) & (wide >= _WIDE * side)
    sigma = _quantile(narrow[along], counts[along], _WALLS) if along.any() else side
    straight = along & (narrow <= max(2.0 * sigma, 0.1 * side)) & (wide >= 3.0 * narrow)
    starts = np.concatenate([[0], np.cumsum(counts)])
    return LineCells(side, float(sigma), np.argsort(cell_of, kind="stable"), starts, own, sample, direction,
                     count.astype(np.int64), straight)  # fmt: skip


def _summed(keys: np.ndarray, moments: np.ndarray, stride: int, side: float) -> np.ndarray:
    """(C, 6): count, sums of x, y, xx, xy, yy of the windows, relative to the middle of each cell."""
    total = np.zeros_like(moments)
    for across in range(-_REACH, _REACH + 1):
        for up in range(-_REACH, _REACH + 1):
            wanted = keys + across * stride + up
            place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            there = keys[place] == wanted
            n, x, y, xx, xy, yy = moments[place[there]].T
            dx, dy = across * side, up * side
            total[there] += np.stack([n, x + n * dx, y + n * dy, xx + 2 * dx * x + n * dx * dx,
                                      xy + dx * y + dy * x + n * dx * dy, yy + 2 * dy * y + n * dy * dy], axis=1)  # fmt: skip
    return total


def _quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    order = np.argsort(values)
    sums = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, share * sums[-1])])
