"""Which rows of a result belong to which running numbers: the way from records, in the order of the files, to points asked for.

A part of a scan is looked up in sorted numbers, 16 bytes a point; a complete scan in a table of rows by number, four bytes a
record.
"""

from typing import Any, Protocol

import numpy as np

from .point_records import PointRecords

BATCH = 1 << 20
"""Numbers that are entered at a time."""
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
    """The rows of all points of a grid.  records: their running numbers.  index: a slice that takes each point once at most."""

    def __init__(self, records: PointRecords, index: slice):
        self._rows = np.full(int(records.first[-1]), _NONE, np.uint32)
        chosen = range(*index.indices(len(records.low)))
        for start in range(0, len(chosen), BATCH):
            part = chosen[start : start + BATCH]
            numbers = records.numbers(slice(part.start, None if part.stop < 0 else part.stop, part.step))
            self._rows[numbers] = np.arange(start, start + len(part), dtype=np.uint32)

    def rows(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        rows = self._rows[start:stop]
        at = np.flatnonzero(rows != _NONE)
        return at, rows[at].astype(np.int64)


def lookup_of(records: PointRecords, index: Any, count: int) -> Lookup:
    """The smaller lookup for ``count`` points at ``index``, a slice or whole numbers."""
    if isinstance(index, slice) and count < _NONE and 16 * count > 4 * int(records.first[-1]):
        return RowTable(records, index)
    return SortedNumbers(records.numbers(index))
