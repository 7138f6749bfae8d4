"""Which rows of a result belong to which running numbers: the way from records, in the order of the files, to points asked for.

A part of a scan is looked up in sorted numbers, 16 bytes a point; a complete scan in a table of rows by number, of a sixteenth
of the records at a time: a quarter of a byte a record.
"""

from typing import Any, Protocol

import numpy as np

from ..scene import let_go
from .point_records import PointRecords

BATCH = 1 << 16
"""Numbers that are looked through at a time."""
_PARTS, _LEAST = 16, 1 << 19
"""Parts of a table of which one is held, and the records of a part at least."""
_NONE = 0xFFFFFFFF


class Lookup(Protocol):
    """Rows of the result by running number."""

    def rows(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """For the records ``start`` to ``stop``: which are asked for, (m,) counted from ``start`` in ascending order, and the
        row of the result that each belongs to, (m,)."""
        ...


class SortedNumbers:
    """numbers: (n,) int64 running numbers in any order; may hold one several times."""

    def __init__(self, numbers: np.ndarray):
        self._order = np.argsort(numbers, kind="stable")
        self._numbers = numbers[self._order]

    def rows(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.searchsorted(self._numbers, (start, stop))
        return self._numbers[low:high] - start, self._order[low:high]


class RowTable:
    """The rows of all points of a grid, quick where they are asked for in the order of the records.  records: their running
    numbers.  index: a slice that takes each point once at most."""

    def __init__(self, records: PointRecords, index: slice):
        self._records, self._chosen = records, range(*index.indices(len(records.low)))
        self._size = max(_LEAST, -(-int(records.first[-1]) // _PARTS))
        self._begin, self._rows = -1, np.zeros(0, np.uint32)

    def rows(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        found, places = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for begin in range(start // self._size * self._size, stop, self._size):
            low, high = max(start, begin), min(stop, begin + self._size)
            rows = self._part(begin)[low - begin : high - begin]
            at = np.flatnonzero(rows != _NONE)
            found.append(at + (low - start))
            places.append(rows[at].astype(np.int64))
        return np.concatenate(found), np.concatenate(places)

    def _part(self, begin: int) -> np.ndarray:
        """The rows by number from number ``begin`` on."""
        if begin == self._begin:
            return self._rows
        self._begin, self._rows = -1, np.full(self._size, _NONE, np.uint32)
        for start in range(0, len(self._chosen), BATCH):
            part = self._chosen[start : start + BATCH]
            numbers = self._records.numbers(slice(part.start, None if part.stop < 0 else part.stop, part.step)) - begin
            inside = np.flatnonzero((numbers >= 0) & (numbers < self._size))
            self._rows[numbers[inside]] = inside + start
            let_go(self._records.low, self._records.high)
        self._begin = begin
        return self._rows


def lookup_of(records: PointRecords, index: Any, count: int) -> Lookup:
    """The smaller lookup for ``count`` points at ``index``, a slice or whole numbers."""
    if isinstance(index, slice) and count < _NONE and 16 * count > 4 * int(records.first[-1]):
        return RowTable(records, index)
    return SortedNumbers(records.numbers(index))
