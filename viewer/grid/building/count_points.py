"""Pass 1 over all sources: how many points lie in which cells.

Frame: file coordinates.  Memory: three chunks (two being worked on, one being read), those that are kept, and the histogram.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...readers.source import Chunk
from .histogram import Histogram, OutOfReach
from .kept_chunks import KeptChunks


@dataclass(frozen=True, eq=False)
class CellCounts:
    """The result of pass 1.

    cells: (C, 3) int32 relative to ``base``, (3,) whole numbers.  counts: (C, GEOMETRIC) int64 points by geometric value.
    reach: (2, 3) box outside which points are dropped.  bounds: (2, 3) of the points that are kept.
    kept: points by (source, scan), empty where chunks have a scan number per point.
    dropped: points not finite, out of reach, marked invalid by the file.
    """

    cells: np.ndarray
    counts: np.ndarray
    base: np.ndarray
    cell_size: float
    reach: np.ndarray
    bounds: np.ndarray
    kept: dict[tuple[int, int], int]
    dropped: tuple[int, int, int]

    @property
    def count(self) -> int:
        """Points that are kept."""
        return int(self.counts.sum())

    @property
    def running(self) -> int:
        """Points that the sources yield: those that are kept, those that are not finite, and those out of reach."""
        return self.count + self.dropped[0] + self.dropped[1]


class Observer(Protocol):
    """Is given every chunk of pass 1."""

    def reset(self) -> None:
        """Forgets all chunks: pass 1 begins again."""

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """A chunk of source number ``source``.  first: running number of its first point, over all sources."""


def count_cells(chunks: KeptChunks, observers: Sequence[Observer] = (), cell_size: float | None = None) -> CellCounts:
    """Counts all points by cell; each observer is given every chunk.  cell_size: to begin with; None: by the first chunk.

    Begins again with larger cells where the scan turns out far wider than its beginning.
    """
    while True:
        for observer in observers:
            observer.reset()
        try:
            return _count(chunks, observers, cell_size)
        except OutOfReach as wider:
            cell_size = wider.cell_size


def _count(chunks: KeptChunks, observers: Sequence[Observer], cell_size: float | None) -> CellCounts:
    expected = sum(source.count or 0 for source in chunks.sources)
    invalid, first = 0, 0
    with ExitStack() as opened:
        histogram = None
        for number, chunk in chunks.walk("reading"):
            invalid += chunk.invalid
            if len(chunk.xyz) == 0:
                continue
            if histogram is None:
                histogram = opened.enter_context(Histogram(chunk.xyz, expected, cell_size))
            key = None if isinstance(chunk.scan, np.ndarray) else (number, chunk.scan)
            histogram.add(np.ascontiguousarray(chunk.xyz, np.float64), key)
            for observer in observers:
                observer.add(number, first, chunk)
            first += len(chunk.xyz)
        if histogram is None:
            histogram = opened.enter_context(Histogram(np.zeros((1, 3)), 0))
        cells, counts = histogram.result()
        nan, outside = histogram.dropped.tolist()
        return CellCounts(
            cells, counts, histogram.base, histogram.cell_size, histogram.reach, histogram.bounds, histogram.kept,
            (nan, outside, invalid),
        )  # fmt: skip

