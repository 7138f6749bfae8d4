"""Which points of a surface belong to the piece that was clicked: those that a raster of the unrolled surface joins.

Method: connected components in a bitmap of the shape's own parametrisation (Schnabel, Wahl and Klein, Efficient RANSAC for
Point-Cloud Shape Detection, 2007, section 4.4).
"""

from dataclasses import dataclass

import numpy as np

from ....model.common.jit import compiled

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
    clicked = _nearest(occupied, (-low[0], -low[1]), round_first=circumference is not None)
    if clicked is None:
        return Piece(np.zeros(len(where), bool), (False, False), 0.0)
    mine, cells = filled(occupied, *clicked, circumference is not None)
    chosen = mine[first, second]
    reach = [float(np.abs(where[chosen, axis]).max()) for axis in range(2)]
    ends = tuple(bool(far > edge - 2 * cell) for far, edge in zip(reach, border, strict=True))
    return Piece(chosen, (circumference is None and ends[0], ends[1]), float(cells) * cell**2)


@compiled(nogil=True)
def filled(occupied, row, column, round_first):
    """(r, c) bool: the occupied cells that a path over the eight neighbours joins to an occupied one; and their number.
    round_first: the last row lies beside the first."""
    rows, columns = occupied.shape
    mine = np.zeros((rows, columns), np.bool_)
    waiting, count = np.empty((rows * columns, 2), np.int64), 1
    waiting[0, 0], waiting[0, 1] = row, column
    mine[row, column], done = True, 0
    while done < count:
        row, column = waiting[done, 0], waiting[done, 1]
        done += 1
        for i in range(row - 1, row + 2):
            if not round_first and not 0 <= i < rows:
                continue
            i = (i + rows) % rows
            for j in range(max(column - 1, 0), min(column + 2, columns)):
                if occupied[i, j] and not mine[i, j]:
                    mine[i, j] = True
                    waiting[count, 0], waiting[count, 1] = i, j
                    count += 1
    return mine, count


def _nearest(occupied: np.ndarray, at: tuple[int, int], *, round_first: bool) -> tuple[int, int] | None:
    """The occupied cell at ``at``, or nearest to it, at most FARTHEST away; None where there is none."""
    best, found = np.inf, None
    for row in range(at[0] - FARTHEST, at[0] + FARTHEST + 1):
        for column in range(max(at[1] - FARTHEST, 0), min(at[1] + FARTHEST + 1, occupied.shape[1])):
            inside = row % occupied.shape[0] if round_first else row
            away = np.hypot(row - at[0], column - at[1])
            if 0 <= inside < occupied.shape[0] and occupied[inside, column] and away < best:
                best, found = away, (inside, column)
    return found
