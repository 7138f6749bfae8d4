"""Pass 1: the occupied cells and their points of each geometric value, bounds, and dropped points.

Cells start small and are merged two by two along each axis whenever too many are occupied.  Cells are aligned to multiples of
their size, so merging is exact, and memory is bounded for any number of points.  Frame: file coordinates.
"""

from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from ...preprocess.valid_positions import FARTHEST, is_position
from . import kernels

SLICES = 2
"""Tables, each filled by its own thread.  Fixed, not the number of processors, so that every machine builds the same grid: when
a table is full and its cells are merged depends on its own points only."""
MAX_CELLS = 1 << 18
"""Cells of a table, at most: 50 MB with counts."""
_POINTS_PER_CELL, _LEAST_LIMIT = 1024, 8192
"""Points wanted per cell of the first sizes, cells wanted at least.  Half or twice of either changes the cells of none of six
real scans, which are merged from them."""
_REACH = 1 << 30  # cells on either side of the median of the scan: within int32, with a factor of two to spare
_DENSE = 1 << 24  # cells of a box that is looked up in a dense table (64 MB) instead of a hash table
_LOST = 0.01
"""Share of a chunk out of reach above which it belongs to the scan and is not outlier points.  Half or twice changes the cells
of none of the same scans."""


class OutOfReach(Exception):
    """The scan is wider than its beginning: count again from the start with ``cell_size``."""

    def __init__(self, cell_size: float):
        super().__init__(cell_size)
        self.cell_size = cell_size


def power_of_two(value: float) -> float:
    """The largest power of two that is at most ``value`` (> 0, finite)."""
    mantissa, exponent = np.frexp(value)
    return float(np.ldexp(1.0, exponent - 1)) if mantissa else 1.0


@dataclass
class _Part:
    """The points of a chunk that one table counts, from ``done`` to ``stop``.  lost: (2,) points dropped: not finite, out of
    reach."""

    slice: int
    done: int
    stop: int
    job: Future | None = None
    lost: np.ndarray = field(default_factory=lambda: np.zeros(2, np.int64))


@dataclass
class _Counted:
    """A chunk that is being counted.  first: running number of its first point."""

    xyz: np.ndarray
    first: int
    key: tuple[int, int] | None
    parts: list[_Part]


class Histogram:
    """Occupied cells of ``cell_size`` file units (a power of two, growing as needed) and their point counts.

    Created with the first chunk's points, (n, 3) float64, which tell where the scan lies; then ``add`` every chunk; then
    ``result``.  Use it in a ``with`` block, since it owns threads.
    expected: number of points, as far as known; it determines the number of cells.  cell_size: to begin with, if known.
    reach: (2, 3) float64 file coordinates; points outside are outlier points, dropped and counted.  dropped: (2,) points not
    finite, out of reach.  kept: points counted, by the key given with their chunk.
    """

    def __init__(self, sample: np.ndarray, expected: int, cell_size: float | None = None):
        wanted = int(np.clip(expected // _POINTS_PER_CELL, _LEAST_LIMIT, MAX_CELLS // 4))
        sample = np.ascontiguousarray(sample[:: max(1, len(sample) // (8 * wanted))])
        sample = sample[is_position(sample)]
        if len(sample) == 0:
            sample = np.zeros((1, 3))
        low, middle, high = _quantiles(sample, (0.02, 0.5, 0.98))
        self.cell_size = cell_size or _first_cell_size(sample, low, high, wanted)
        self.base = np.floor(middle / self.cell_size)
        reach = np.stack([self.base - _REACH, self.base + _REACH]) * self.cell_size
        self.reach = np.clip(reach, -FARTHEST, FARTHEST)
        self.bounds = np.array([[np.inf] * 3, [-np.inf] * 3])
        self.seen = 0
        self.dropped = np.zeros(2, np.int64)
        self.kept: dict[tuple[int, int], int] = {}
        self._limit = MAX_CELLS if cell_size else 4 * wanted
        self._tables = [_table(self._limit) for _ in range(SLICES)]
        self._counts = [np.zeros((self._limit, kernels.GEOMETRIC), np.int64) for _ in range(SLICES)]
        self._tallies = [np.zeros(3, np.int64) for _ in range(SLICES)]
        self._bounds = [self.bounds.copy() for _ in range(SLICES)]
        self._threads = [ThreadPoolExecutor(1, "count") for _ in range(SLICES)]
        self._running: list[_Counted] = []

    def __enter__(self) -> "Histogram":
        return self

    def __exit__(self, *_) -> None:
        for thread in self._threads:
            thread.shutdown(cancel_futures=True)

    def add(self, xyz: np.ndarray, key: tuple[int, int] | None = None) -> None:
        """Counts a chunk, (n, 3) float64, while the next is being read.  key: of its points in ``kept``.

        Raises OutOfReach where more than outlier points of it, or of the chunk before it, are out of reach.
        """
        edges = [len(xyz) * i // SLICES for i in range(SLICES + 1)]
        chunk = _Counted(xyz, self.seen, key, [_Part(i, edges[i], edges[i + 1]) for i in range(SLICES)])
        for part in chunk.parts:
            self._go_on(chunk, part)
        self._running.append(chunk)
        self.seen += len(xyz)
        while len(self._running) > 1:
            self._settle()

    def _go_on(self, chunk: _Counted, part: _Part) -> None:
        part.job = self._threads[part.slice].submit(self._count, chunk, part)

    def _count(self, chunk: _Counted, part: _Part) -> None:
        i = part.slice
        tally = self._tallies[i]
        before = tally[1:].copy()
        part.done = kernels.count_points(
            chunk.xyz[: part.stop], part.done, chunk.first, 1 / self.cell_size, self.base, self.reach, self._tables[i],
            self._counts[i], self._limit, tally, self._bounds[i],
        )  # fmt: skip
        part.lost += tally[1:] - before

    def _settle(self) -> None:
        """Waits for the oldest chunk that is being counted; merges cells where a table is full."""
        chunk = self._running[0]
        _wait(chunk.parts)
        while any(part.done < part.stop for part in chunk.parts):
            everything = [(c, part) for c in self._running for part in c.parts]
            _wait(part for _, part in everything)
            self._make_room()
            for c, part in everything:
                if part.done < part.stop:
                    self._go_on(c, part)
            _wait(chunk.parts)
        self._running.pop(0)
        nan, outside = lost = np.sum([part.lost for part in chunk.parts], axis=0)
        self.dropped += lost
        if chunk.key is not None:
            self.kept[chunk.key] = self.kept.get(chunk.key, 0) + len(chunk.xyz) - int(nan + outside)
        if outside > _LOST * len(chunk.xyz):
            wider = self._wide_enough(chunk.xyz)
            if wider > self.cell_size:  # else the points out of reach are not positions, and no cell size would help
                raise OutOfReach(wider)

    def _wide_enough(self, xyz: np.ndarray) -> float:
        near = xyz[is_position(xyz)]
        if len(near) == 0:
            return 0.0
        # the tolerated share farthest away remains out of reach
        distance = np.quantile(np.abs(near - self.reach.mean(axis=0)).max(axis=1), 1 - _LOST, method="higher")
        return 4 * power_of_two(float(distance) / _REACH)

    def _make_room(self) -> None:
        """Doubles the cell size."""
        base = np.floor(self.base / 2)
        for i in range(SLICES):
            cells = np.floor((self._cells(i) + self.base) / 2) - base
            cells, counts = merge(cells.astype(np.int32), self._used_counts(i))
            self._tables[i][:, 3] = -1
            kernels.fill_table(self._tables[i], cells)
            self._counts[i][: len(cells)] = counts
            self._counts[i][len(cells) :] = 0
            self._tallies[i][0] = len(cells)
        self.base, self.cell_size = base, 2 * self.cell_size

    def _cells(self, i: int) -> np.ndarray:
        taken = self._tables[i][self._tables[i][:, 3] >= 0]
        cells = np.empty((len(taken), 3), np.int32)
        cells[taken[:, 3]] = taken[:, :3]
        return cells

    def _used_counts(self, i: int) -> np.ndarray:
        return self._counts[i][: self._tallies[i][0]]

    def result(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (C, 3) int32 cells relative to ``base`` and (C, GEOMETRIC) int64 counts, and sets ``bounds``.  Raises as
        ``add`` does."""
        while self._running:
            self._settle()
        lows, highs = zip(*self._bounds, strict=True)
        self.bounds = np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])
        cells = np.concatenate([self._cells(i) for i in range(SLICES)])
        return merge(cells, np.concatenate([self._used_counts(i) for i in range(SLICES)]))


def _wait(parts: Iterable[_Part]) -> None:
    for part in parts:
        if part.job is not None:
            part.job.result()


def _quantiles(sample: np.ndarray, shares: tuple[float, ...]) -> np.ndarray:
    """(len(shares), 3) quantiles of each coordinate of (n, 3), as np.quantile with "nearest", which takes five times as long as
    sorting the columns."""
    columns = np.sort(np.ascontiguousarray(sample.T), axis=1)
    return columns[:, np.rint((len(sample) - 1) * np.array(shares)).astype(int)].T


def _first_cell_size(sample: np.ndarray, low: np.ndarray, high: np.ndarray, wanted: int) -> float:
    """The smallest cell size at which the sample, (n, 3) finite, occupies at most ``wanted`` cells.  low, high: of its bulk.

    Cells much finer than the final ones cost time; coarser ones leave no choice of the final size.  Cells are never finer than
    float64 can resolve.
    """
    extent = float((high - low).max()) or float(np.ptp(sample, axis=0).max())
    # 2**16 packed positions of at least 2**-52 of the coordinate; of the bulk, so that one outlier point does not decide
    finest = float(max(np.abs(low).max(), np.abs(high).max())) * 2.0**-36
    if not extent > 0:
        return power_of_two(max(1.0, finest))
    size = power_of_two(max(extent / 4096, 2 * finest))
    sample, seen = np.ascontiguousarray(sample, np.float64), np.empty((2 << wanted.bit_length(), 3))
    while kernels.occupied(sample, 1 / size, wanted, seen) > wanted:
        size *= 2
    return size


def _table(limit: int) -> np.ndarray:
    table = np.empty((4 * (1 << (limit - 1).bit_length()), 4), np.int32)
    table[:, 3] = -1
    return table


def merge(cells: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums the counts of equal cells: (n, 3) int32, (n, G) int64 -> (C, 3) int32, (C, G) int64."""
    low = cells.min(axis=0, initial=0).astype(np.int64)
    x, y, z = (cells - low).T
    if len(cells) and max(x.max(), y.max(), z.max()) < 1 << 21:
        order = np.argsort(x << 42 | y << 21 | z, kind="stable")
    else:
        order = np.lexsort((z, y, x))
    cells = cells[order]
    new = np.ones(len(cells), bool)
    new[1:] = (cells[1:] != cells[:-1]).any(axis=1)
    sums = np.zeros((np.count_nonzero(new), counts.shape[1]), counts.dtype)
    kernels.add_rows(counts, order, np.cumsum(new) - 1, sums)
    return cells[new], sums


def table_of(cells: np.ndarray) -> np.ndarray:
    """A hash table from cells (C, 3) int32 to their row numbers."""
    table = _table(max(len(cells), 1))
    kernels.fill_table(table, cells)
    return table


def dense_table_of(cells: np.ndarray) -> np.ndarray:
    """(X, Y, Z) int32 row numbers of cells (C, 3) int32, which are not negative; empty where their box is too large."""
    sides = cells.max(axis=0).astype(np.int64) + 1
    if np.prod(sides.astype(np.float64)) > _DENSE:
        return np.empty((0, 0, 0), np.int32)
    dense = np.full(sides, -1, np.int32)
    dense[tuple(cells.T)] = np.arange(len(cells))
    return dense
