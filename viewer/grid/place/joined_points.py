"""The points of several grids under one numbering, without a copy of them.

Order: density layer, then grid, then as in the grid.  So the first points are the coarse layers of all grids, as in a scene
of one grid.  The numbering is a table of pieces, a run of points of one layer of one grid each.
"""

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ..checksum import CheckedParts
from ..npy_column import IndexedRows, NpyColumn, column_of

_OPEN = 64
"""Columns whose file is kept open; the system limits open files to 1024 of a process by default."""
HEAD = 1 << 18
"""First rows of a column that are kept once they were read, 3 MB of points: samples of a place are taken of them several times
when it is opened, and each time the file of each grid would be opened."""
_COLOUR = np.uint32(0x00FFFFFF)
_LOW = np.uint32(0xFFFF)


class OpenColumns:
    """Columns of grids, opened when they are needed; those used last are kept.  From any thread.

    paths: of the files; a column itself in place of one is that of a grid in memory."""

    def __init__(self, paths: Sequence[Path | np.ndarray]):
        self._paths = paths
        self._kept: OrderedDict[int, NpyColumn] = OrderedDict()
        self._lock = Lock()

    def __getitem__(self, number: int) -> Any:
        """Raises InputError where the file is not there any more."""
        path = self._paths[number]
        if not isinstance(path, Path):
            return path
        with self._lock:
            found = self._kept.pop(number, None)
            if found is None:
                found = column_of(path)
            self._kept[number] = found
            while len(self._kept) > _OPEN:
                self._kept.popitem(last=False)
            return found


class PieceTable:
    """Which grid has a point.  edges: (L + 1, G) int64 number in each grid of the first point of each of its layers, and at the
    end of all its points.  cells: (G,) of each grid.

    starts: (L * G + 1,) int64 number of the first point of each piece; piece k * G + g is layer k of grid g.
    local: (L * G,) int64 number of that point in its grid.  counts, cells: points and cells of each grid.
    """

    def __init__(self, edges: np.ndarray, cells: Sequence[int]):
        self.grids, self.counts, self.cells, self.edges = len(cells), edges[-1].tolist(), cells, edges
        self.local = np.ascontiguousarray(edges[:-1]).reshape(-1)
        self.starts = np.concatenate([[0], np.cumsum(np.diff(edges, axis=0).reshape(-1))])

    def runs(self, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
        """(grid, number in it, count) of the pieces of the points ``start`` to ``stop``, in order."""
        piece = int(np.searchsorted(self.starts, start, side="right")) - 1
        while start < stop:
            end = min(int(self.starts[piece + 1]), stop)
            if end > start:
                yield piece % self.grids, int(self.local[piece] + start - self.starts[piece]), end - start
            start, piece = end, piece + 1

    def places(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """For numbers of points (n,): the grid, and the number in it, (n,) int64 each."""
        piece = np.searchsorted(self.starts, numbers, side="right") - 1
        return piece % self.grids, self.local[piece] + numbers - self.starts[piece]


class JoinedColumn(IndexedRows):
    """A column with a row for each point, read from the grids.

    columns: of each grid.  width, dtype: of a row.
    """

    def __init__(self, table: PieceTable, columns: OpenColumns, width: tuple[int, ...], dtype: type):
        super().__init__((int(table.starts[-1]), *width), np.dtype(dtype))
        self.table, self._columns = table, columns
        self._head = np.empty((0, *width), self.dtype)

    def __array__(self, *_, **__) -> np.ndarray:
        raise TypeError("the points of a place are not one array: use viewer.grid.gathered_rows")

    def _sliced(self, start: int, stop: int, step: int) -> np.ndarray:
        if step > 0 and start < stop <= max(HEAD, len(self._head)):
            return self._head_to(stop)[start:stop:step].copy()
        return super()._sliced(start, stop, step)

    def begin_with(self, head: np.ndarray) -> None:
        """Takes the first rows as they were read earlier; they are not read again."""
        self._head = head

    def _head_to(self, stop: int) -> np.ndarray:
        """The first rows, at least ``stop`` of them."""
        head = self._head
        if len(head) < stop:
            self._head = head = self._run(0, stop)
        return head

    def _run(self, start: int, stop: int) -> np.ndarray:
        found, at = np.empty((stop - start, *self.shape[1:]), self.dtype), 0
        pieces: dict[int, list[tuple[int, int, int]]] = {}
        for grid, first, count in self.table.runs(start, stop):
            pieces.setdefault(grid, []).append((first, count, at))
            at += count
        for grid, parts in pieces.items():  # those of one grid, a layer each, lie one behind the other in its file
            first, last = parts[0][0], parts[-1][0] + parts[-1][1]
            rows = np.array(self._columns[grid][first:last])
            self._changed(grid, rows)
            for begin, count, place in parts:
                found[place : place + count] = rows[begin - first : begin - first + count]
        return found

    def _some(self, numbers: np.ndarray) -> np.ndarray:
        grids, local = self.table.places(numbers)
        order = np.argsort(grids, kind="stable")
        found = np.empty((len(numbers), *self.shape[1:]), self.dtype)
        here, first = np.unique(grids[order], return_index=True)
        for grid, rows in zip(here.tolist(), np.split(order, first[1:])):
            part = np.asarray(self._columns[grid][local[rows]])
            self._changed(grid, part)
            found[rows] = part
        return found

    def _changed(self, grid: int, rows: np.ndarray) -> None:
        """Changes rows of a grid in place: a joined column may differ from what the grids store."""


@dataclass(frozen=True, eq=False)
class PointChange:
    """What is changed in the packed points of one grid of a place when they are read: station numbers, attribute bits, colours.
    The grid on disk keeps its own, so that nothing is converted again when other files are added or removed.

    Tables by the values that the grid stores; None where nothing changes.

    first_station: what is added to a station number; sums beyond 255 are 255.  attributes: (65536,) uint32 attribute bits.
    colours: (S, 3, 256) uint32 colours by station number of the grid, channel and stored colour.  lift_black: black is a colour
    here, while the place treats black as missing colour; it becomes (1, 1, 1), as in viewer.preprocess.point_colour.
    """

    first_station: int = 0
    attributes: np.ndarray | None = None
    colours: np.ndarray | None = None
    lift_black: bool = False

    def apply(self, words: np.ndarray) -> None:
        """Changes packed points (n, 3) uint32 in place."""
        if self.attributes is not None:
            words[:, 1] = words[:, 1] & _LOW | self.attributes[words[:, 1] >> 16] << np.uint32(16)
        last = words[:, 2]
        if self.colours is not None:
            station = np.minimum(last >> np.uint32(24), len(self.colours) - 1)
            red, green, blue = (self.colours[station, channel, last >> np.uint32(8 * channel) & 0xFF] for channel in range(3))
            last = last & ~_COLOUR | red | green << np.uint32(8) | blue << np.uint32(16)
        if self.lift_black:
            last = last + np.where(last & _COLOUR, 0, 0x010101).astype(np.uint32)
        if self.first_station:
            station = np.minimum((last >> np.uint32(24)).astype(np.int64) + self.first_station, 255).astype(np.uint32)
            last = last & _COLOUR | station << np.uint32(24)
        words[:, 2] = last


class JoinedPoints(JoinedColumn):
    """Packed points (N, 3) uint32.  files: of the points of each grid, .npy, or the points, where they are in memory.
    checked: what of each grid is checked as a whole.  changes: of each grid's points.  first_stations: number of the first
    station of each grid, without a limit."""

    def __init__(self, table: PieceTable, files: Sequence[Path | np.ndarray], checked: list[CheckedParts],
                 changes: list[PointChange], first_stations: list[int]):
        super().__init__(table, OpenColumns(files), (3,), np.uint32)
        self.files, self.checked, self.changes, self.first_stations = files, checked, changes, first_stations

    def _changed(self, grid: int, rows: np.ndarray) -> None:
        self.changes[grid].apply(rows)
