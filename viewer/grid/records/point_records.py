"""Where each point of a grid came from: its running number over all sources, in the order in which they were read.

The numbers are a column beside the packed points: four bytes a point, five where the sources hold more than 2**32 points.  The
column is read where it is needed, never copied to the GPU, and checked by chunks of CHUNK points when a number in them is first
needed.
"""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...preprocess.scan_table import ScanTable
from ...readers.source import Source

CHUNK = 65536
"""Numbers that are checked together, as many as the points of a chunk (viewer.grid.scene)."""
_LOW_BITS = 32
MOST_POINTS = 1 << 40
IN_MEMORY = ("", 0, 0)
"""In place of the identity of a file (:func:`identity_of`): the source is in memory, and read from there."""
"""Of all sources together."""


@dataclass(eq=False)
class PointRecords:
    """The running numbers of the points of a grid.

    low: (N,) uint32, the lower 32 bits.  high: (N,) uint8, the bits above; None where 32 suffice.  first: (S + 1,) int64, the
    running number of the first point of each source, and at the end that of all sources; points that are not in the grid, for
    example because they are not finite, are counted too.
    scans: (K,) int64, ascending running numbers of the first point of each scan; None where scans are not stored one behind the
    other.
    sums: (ceil(N / CHUNK),) uint32, the CRC-32 of each chunk of the column as kept on disk; None where none is kept.
    where: the place of the column, for messages.
    opened: the sources by number, once viewer.grid.records.file_records has opened them, or why that is impossible.  lock: for
    it.
    """

    low: np.ndarray
    high: np.ndarray | None
    first: np.ndarray
    scans: np.ndarray | None = None
    sums: np.ndarray | None = None
    where: str = ""
    opened: dict[int, Source | str] = field(default_factory=dict, repr=False)
    lock: Any = field(default_factory=Lock, repr=False)

    def __post_init__(self) -> None:
        self._checking = Lock()
        self._checked = np.zeros(0 if self.sums is None else len(self.sums), bool)

    def numbers(self, index: Any) -> np.ndarray:
        """(n,) int64 running numbers of the points at ``index``, a slice or an array of whole numbers from 0.

        Raises InputError where the column does not match its checksum.
        """
        if self.sums is not None:
            self._check(index)
        numbers = np.asarray(self.low[index]).astype(np.int64)
        if self.high is not None:
            numbers |= np.asarray(self.high[index]).astype(np.int64) << _LOW_BITS
        return np.atleast_1d(numbers)

    def places(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """For running numbers (n,): the source, and the number of the record within the source, (n,) int64 each."""
        source = np.searchsorted(self.first, numbers, side="right") - 1
        return source, numbers - self.first[source]

    def scan_of(self, numbers: np.ndarray) -> np.ndarray | None:
        """(n,) int64: the scan of points by their running numbers, without a limit; None where only the grid tells it."""
        return None if self.scans is None else np.searchsorted(self.scans, numbers, side="right") - 1

    def _check(self, index: Any) -> None:
        """Computes the checksums of the chunks that ``index`` touches, each once."""
        assert self.sums is not None
        if isinstance(index, slice):
            start, stop, step = index.indices(len(self.low))
            chosen = range(start, stop, step)
            low, high = (min(chosen[0], chosen[-1]), max(chosen[0], chosen[-1])) if chosen else (0, -1)
            wide = abs(step) > CHUNK
            chunks = np.unique(np.asarray(chosen) // CHUNK) if wide else np.arange(low // CHUNK, high // CHUNK + 1)
        else:
            chunks = np.unique(np.asarray(index, np.int64) // CHUNK)
        with self._checking:
            for chunk in chunks[~self._checked[chunks]].tolist():
                if sum_of(self.low, self.high, chunk) != self.sums[chunk]:
                    raise InputError(f"{self.where}: damaged grid (record numbers do not match their checksum)",
                                     remedy="convert the scan again, or delete the grid")
                self._checked[chunk] = True


class ScanStarts:
    """Collects, in the second pass, the running number with which each scan begins."""

    def __init__(self) -> None:
        self._found: dict[tuple[int, int], int] = {}
        self._mixed = False

    def add(self, source: int, scan: int | np.ndarray, first: int) -> None:
        """A chunk of ``scan`` (as in Chunk) of a source; ``first``: running number of its first point."""
        if isinstance(scan, np.ndarray):
            self._mixed = True
        else:
            self._found.setdefault((source, int(scan)), first)

    def solve(self, table: ScanTable, first: np.ndarray) -> np.ndarray | None:
        """``PointRecords.scans``; a scan without points begins where the next one does."""
        starts: list[int] = []
        for source, scans in enumerate(table.scans):
            if source in table.turns:
                starts += [int(first[source]), *table.turns[source].tolist()]
                continue
            end, here = int(first[source + 1]), []
            for scan in reversed(range(len(scans))):
                end = self._found.get((source, scan), end)
                here.append(end)
            starts += here[::-1]
        found = np.array(starts, np.int64)
        return None if self._mixed or (np.diff(found) < 0).any() else found


def sum_of(low: np.ndarray, high: np.ndarray | None, chunk: int) -> int:
    """The CRC-32 of one chunk of the column."""
    rows = slice(chunk * CHUNK, (chunk + 1) * CHUNK)
    found = zlib.crc32(low[rows].data)
    return found if high is None else zlib.crc32(high[rows].data, found)


def identity_of(file: Path) -> tuple[str, int, int]:
    """(path, bytes, time of the last change in ns): what tells whether a file is still the one that was read.  A path through a
    parent folder, as projects have them, is the same as one without."""
    stat, path = file.stat(), file.absolute()
    if ".." in path.parts:
        path = path.parent.resolve() / path.name
    return str(path), stat.st_size, stat.st_mtime_ns


def allocated(allocate: Callable[..., np.ndarray], count: int, running: int, sources: int) -> PointRecords:
    """Room for the running numbers of ``count`` points.  allocate: as viewer.grid.building.two_passes.Allocate.  running:
    points of all ``sources`` sources, those left out included.  Raises InputError beyond 2**40 points."""
    if running > MOST_POINTS:
        raise InputError(f"{running:,} points: more than 2**40 cannot be opened together", remedy="open fewer files")
    low = allocate("records", (count,), np.uint32)
    high = allocate("records_high", (count,), np.uint8) if running > 1 << _LOW_BITS else None
    return PointRecords(low, high, np.zeros(sources + 1, np.int64))
