"""Random access to the records of a file in blocks: a block is decoded as a whole and kept for the next request.

A picked point is usually followed by others near it, which most files store near it too.  The blocks of all files share one
budget of memory; the least recently used block is dropped first.  Safe from any thread.
"""

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock

import numpy as np

from .source import Records, joined, taken

BUDGET = 192 << 20
"""Bytes of decoded blocks that are kept: 57 LAZ chunks of 50,000 points with 70 bytes each, as of scanned rooms, or 35 nodes of
a COPC file of 58,000 points with 99."""
MOST = 1 << 17
"""Points of a block where the format allows any number: decoded in about 10 ms of CPU time from PLY and LAS."""

_kept: "OrderedDict[tuple[object, int], tuple[Records, int]]" = OrderedDict()
_lock = Lock()


class RecordBlocks:
    """The records of one source.

    first: (B + 1,) ascending running numbers, within the source, of the first point of each block, and at the end that of all
    blocks.  read: gives all records of a block, as many as ``first`` says; raises InputError where the file is damaged.
    """

    def __init__(self, first: np.ndarray, read: Callable[[int], Records]):
        self.first, self._read, self._owner = np.asarray(first, np.int64), read, object()

    @property
    def count(self) -> int:
        """Points of all blocks."""
        return int(self.first[-1])

    def take(self, numbers: np.ndarray) -> Records:
        """The records with these running numbers, (n,) int64 ascending; as ``Source.records``."""
        block = np.searchsorted(self.first, numbers, side="right") - 1
        parts = []
        edges = np.append(np.flatnonzero(np.diff(block, prepend=-1)), len(numbers))
        for start, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            which = int(block[start])
            parts.append(taken(self._block(which), numbers[start:stop] - self.first[which]))
        return joined(parts)

    def _block(self, which: int) -> Records:
        key = (self._owner, which)
        with _lock:
            if key in _kept:
                _kept.move_to_end(key)
                return _kept[key][0]
        records = self._read(which)  # outside the lock: it takes up to a second, and others may read other blocks meanwhile
        held = size_of(records)
        with _lock:
            _kept[key] = records, held
            while sum(size for _, size in _kept.values()) > BUDGET and len(_kept) > 1:
                _kept.popitem(last=False)
        return records


def size_of(records: Records) -> int:
    """Bytes that the arrays of records take."""
    arrays = [records.xyz, records.rgb, records.scan, records.native, *records.columns.values()]
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))


def even_blocks(count: int, size: int = MOST) -> np.ndarray:
    """``first`` of blocks of ``size`` points, the last one shorter."""
    return np.append(np.arange(0, count, size, dtype=np.int64), count)
