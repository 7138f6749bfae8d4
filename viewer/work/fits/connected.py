"""Which points of a surface belong to the piece that was clicked: those that a raster of the unrolled surface joins.

Method: connected components in a bitmap of the shape's own parametrisation (Schnabel, Wahl and Klein, Efficient RANSAC for
Point-Cloud Shape Detection, 2007, section 4.4).
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

FARTHEST = 2
"""Cells between the click and the nearest points of its piece.  With 1 and 4 the same pipes and planes are fitted
(tests/unit/work/test_fits.py)."""


@dataclass(frozen=True, eq=False)
class Piece:
    """of_points: (n,) bool.  open_ends: whether it reaches the border of what was looked at along the second coordinate, and,
    of a surface that is not round, along the first.  area: of its cells, in square units."""

    of_points: np.ndarray
    open_ends: tuple[bool, bool]
    area: float


def connected(unrolled: np.ndarray, at: np.ndarray, cell: float, circumference: float | None,
              border: tuple[float, float]) -> Piece:
    """The piece around a place.

    unrolled: (n, 2) of the points, as Surface.unrolled gives them.  at: (2,) of the click.  cell: side of a cell, about three
    point spacings.  circumference: of the first coordinate, None where it has none.  border: how far from ``at`` the points
    that were looked at reach, along the first and second coordinate.
    """
    where = unrolled - at
    columns = 0 if circumference is None else max(int(circumference / cell), 3)
    if circumference is not None:
        first = np.floor((where[:, 0] / circumference % 1.0) * columns).astype(np.int64) % columns
    else:
        first = np.floor(where[:, 0] / cell + 0.5).astype(np.int64)
    second = np.floor(where[:, 1] / cell + 0.5).astype(np.int64)
    if len(where) == 0:
        return Piece(np.zeros(0, bool), (False, False), 0.0)
    low = (0 if circumference is not None else min(first.min(), 0), min(second.min(), 0))
    size = (columns if circumference is not None else max(first.max(), 0) - low[0] + 1, max(second.max(), 0) - low[1] + 1)
    first, second = first - low[0], second - low[1]
    occupied = np.zeros(size, bool)
    occupied[first, second] = True
    labels: np.ndarray = ndimage.label(occupied, np.ones((3, 3), int))[0]  # type: ignore[index,assignment]
    if circumference is not None:
        labels = _joined_across(labels)
    clicked = _nearest(labels, (-low[0], -low[1]), round_first=circumference is not None)
    if clicked == 0:
        return Piece(np.zeros(len(where), bool), (False, False), 0.0)
    mine = labels == clicked
    chosen = mine[first, second]
    reach = np.abs(where[chosen]).max(axis=0)
    ends = tuple(bool(far > edge - 2 * cell) for far, edge in zip(reach, border, strict=True))
    return Piece(chosen, (circumference is None and ends[0], ends[1]), float(mine.sum()) * cell**2)


def _joined_across(labels: np.ndarray) -> np.ndarray:
    """Labels of a raster whose last row lies beside its first: one for all that is joined there."""
    last, first = labels[-1], labels[0]
    ends = np.concatenate([last, last[1:], last[:-1]])
    begins = np.concatenate([first, first[:-1], first[1:]])
    beside = (ends > 0) & (begins > 0)
    ends, begins = ends[beside], begins[beside]
    if len(ends) == 0:
        return labels
    size = int(labels.max()) + 1
    graph = coo_array((np.ones(len(ends), bool), (ends, begins)), shape=(size, size))
    same = connected_components(graph, directed=False)[1] + 1
    same[0] = 0
    return same[labels]


def _nearest(labels: np.ndarray, at: tuple[int, int], *, round_first: bool) -> int:
    """The label at a cell, or of the nearest cell that has one, at most FARTHEST away; else 0."""
    reach = np.arange(-FARTHEST, FARTHEST + 1)
    rows, columns = (grid.ravel() for grid in np.meshgrid(reach, reach, indexing="ij"))
    row, column = at[0] + rows, at[1] + columns
    if round_first:
        row = row % labels.shape[0]
    inside = (row >= 0) & (row < labels.shape[0]) & (column >= 0) & (column < labels.shape[1])
    found = np.where(inside, labels[np.clip(row, 0, labels.shape[0] - 1), np.clip(column, 0, labels.shape[1] - 1)], 0)
    away = np.where(found > 0, np.hypot(rows, columns), np.inf)
    return int(found[away.argmin()])
