"""The running numbers of the points of several grids: those of each grid, behind those of the grids before it."""

from pathlib import Path
from typing import Any

import numpy as np

from ..records.point_records import PointRecords
from .joined_points import JoinedColumn, OpenColumns, PieceTable


class JoinedRecords(PointRecords):
    """records: of each grid.  files: of their lower 32 bits, and of the bits above, .npy; an empty path where there are none.

    ``first`` and ``scans`` are those of all sources, as in PointRecords.
    """

    def __init__(self, table: PieceTable, records: list[PointRecords], files: list[tuple[Path, Path]]):
        bases = np.cumsum([0, *(int(one.first[-1]) for one in records)])
        first = [one.first[:-1] + base for one, base in zip(records, bases)]
        scans = [None if one.scans is None else one.scans + base for one, base in zip(records, bases)]
        low = JoinedColumn(table, OpenColumns([low for low, _ in files]), (), np.uint32)
        known = [starts for starts in scans if starts is not None]
        super().__init__(low, None, np.concatenate([*first, bases[-1:]]),  # type: ignore[arg-type]
                         np.concatenate(known) if len(known) == len(scans) else None)
        self._table, self._bases = table, bases
        self._high = OpenColumns([high for _, high in files])
        self._columns = low._columns
        self._sums = [(one.sums, one.high is not None, one.where) for one in records]
        self._tested = [np.zeros(0 if one.sums is None else len(one.sums), bool) for one in records]

    def numbers(self, index: Any) -> np.ndarray:
        """See PointRecords."""
        if isinstance(index, slice) and index.indices(len(self.low))[2] == 1:
            start, stop, _ = index.indices(len(self.low))
            runs = [self._of_grid(grid, slice(at, at + count)) for grid, at, count in self._table.runs(start, max(start, stop))]
            return np.concatenate(runs or [np.zeros(0, np.int64)])
        chosen = np.arange(*index.indices(len(self.low))) if isinstance(index, slice) else np.atleast_1d(np.asarray(index))
        grids, local = self._table.places(chosen)
        order, found = np.argsort(grids, kind="stable"), np.empty(len(chosen), np.int64)
        here, at = np.unique(grids[order], return_index=True)
        for grid, rows in zip(here.tolist(), np.split(order, at[1:])):
            found[rows] = self._of_grid(grid, local[rows])
        return found

    def _of_grid(self, grid: int, index: slice | np.ndarray) -> np.ndarray:
        sums, is_wide, where = self._sums[grid]
        low, high = self._columns[grid], self._high[grid] if is_wide else None
        one = PointRecords(low, high, self.first, sums=sums, where=where)
        one._checked = self._tested[grid]  # what has been checked once is not checked again
        return one.numbers(index) + self._bases[grid]

