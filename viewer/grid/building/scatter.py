"""Pass 2 of a grid: packs every point and writes it to its place.

The places of successive points lie anywhere in the grid, farther apart than caches reach.  So points are packed in pieces, each
sorted by groups of runs (the points of one layer and cell) that lie side by side in the grid, and SLAB points at a time are
placed group by group, so that what is written stays in the cache until it is full (radix partitioning).  Both steps take all
processors; a group's points are placed by one thread, in the order of the file.  The result does not depend on the number of
processors.
"""

import itertools
from concurrent.futures import Executor, Future

import numpy as np

from ...common.errors import InputError
from ...preprocess.point_attributes import AttributeLayout
from ...preprocess.point_colour import Colours
from ...preprocess.scan_table import ScanTable
from ..cell_boxes import boxes_of
from ..records.point_records import PointRecords, ScanStarts
from . import pack_kernels
from .cell_layout import Layout
from .count_points import CellCounts
from .histogram import dense_table_of, table_of
from .kept_chunks import KeptChunks
from .noise_sample import NoiseSample

PIECE = 1 << 14
"""Points that are packed and sorted at a time: their words, numbers and positions take 0.5 MB, so that they stay in the
second-level cache."""
SLAB = 1 << 21
"""Points packed before they are placed, 42 MB.  Half as many take 10 % longer, twice as many 5 % less."""
GROUP, MOST_GROUPS = 1 << 15, 256
"""Points of a group in the grid, about (0.5 MB), and the most groups, so that one point of each stays in the first-level cache
while a piece is sorted."""
_JOBS = 4  # for each processor, so that one that finishes sooner has something to do


def scatter(kept: KeptChunks, colours: Colours | None, scans: ScanTable, counts: CellCounts, layout: Layout,
            points: np.ndarray, records: PointRecords, pool: Executor, processors: int, attributes: AttributeLayout,
            sample: NoiseSample | None = None) -> np.ndarray:  # fmt: skip
    """Walks over the points again and fills ``points`` (N, 3) uint32 as in Scene.  Returns the cells' boxes, (C, 6) uint8.

    records: receives the running number of each point, and of the first point of each source.

    colours: as in build_grid, after pass 1.  scans: which scan each point is of.  counts, layout: the cells.
    processors: pieces of a block that are packed at the same time.  attributes: how class and intensity are packed.
    sample: is given all points, to estimate their noise.
    Raises InputError where a file is no longer as pass 1 read it.
    """
    slab = _Slab(counts, layout, points, records, pool, processors)
    first, of_source, starts = 0, np.zeros(len(kept.sources), np.int64), ScanStarts()
    if sample is not None:
        sample.reset()
    for number, chunk in kept.walk("building the grid"):
        xyz = np.ascontiguousarray(chunk.xyz, np.float64)
        rgb = np.ascontiguousarray(chunk.rgb if colours is None else colours.apply(number, first, chunk), np.uint8)
        bits = np.ascontiguousarray(attributes.pack(chunk.classification, chunk.intensity, len(xyz)), np.uint16)
        scan = scans.numbers(number, first, chunk)
        if sample is not None:
            sample.add(number, chunk, xyz, rgb, scan, first, pool)
        slab.add(xyz, rgb, bits, scan, first)
        first += len(xyz)
        of_source[number] += len(xyz)
        starts.add(number, chunk.scan, first - len(xyz))
    if sample is not None:
        sample.begin_solving(pool)
    records.first[1:] = of_source.cumsum()
    records.scans = starts.solve(scans, records.first)
    runs, boxes = slab.finish()
    if not np.array_equal(runs[:-1, 1], np.diff(layout.offsets)):
        raise InputError("changed while it was read", file=kept.sources[0].path, remedy="try again")
    return boxes


class _Slab:
    """Room for SLAB packed points, in pieces.  While the last ones are placed, the caller prepares the next."""

    def __init__(self, counts: CellCounts, layout: Layout, points: np.ndarray, records: PointRecords, pool: Executor,
                 processors: int):  # fmt: skip
        cells = layout.cells
        self._pool, self._points, self._parts = pool, points, processors
        self._records = records.low, np.empty(0, np.uint8) if records.high is None else records.high
        self._runs = np.stack([layout.offsets, np.zeros_like(layout.offsets)], axis=1)
        dense = dense_table_of(cells)
        table = table_of(cells[:1] if dense.size else cells)
        total = max(int(layout.offsets[-1]), 1)
        groups = int(np.clip(total // GROUP, 1, MOST_GROUPS))
        group_of = (layout.offsets[:-1] * groups // total).clip(max=groups - 1).astype(np.uint8)  # of at most 2**40 points
        self._targets = pack_kernels.Buckets(1 / layout.cell_size, layout.base, counts.reach, dense, table, len(cells),
                                             layout.layers, group_of)  # fmt: skip
        pieces = max(1, min(SLAB, 2 * total + PIECE * processors) // PIECE)  # small scans leave pieces half empty
        self._buckets, self._words = np.empty((pieces, PIECE), np.int32), np.empty((pieces, PIECE, 4), np.uint32)
        self._starts, self._numbered = np.zeros((pieces, groups + 1), np.int32), np.zeros(pieces, np.int64)
        self._marks = np.zeros((processors, len(cells)), np.int64)
        self._used = 0
        self._running: list[Future] = []

    def add(self, xyz: np.ndarray, rgb: np.ndarray, bits: np.ndarray, scan: np.ndarray, first: int) -> None:
        """Packs points, and places those before them where there is no room left.  bits: (n,) uint16 attributes.
        first: running number of the first point.  The arrays are read until the next call."""
        done = 0
        while done < len(xyz):
            self._wait()  # for what was packed before into the same marks, or is being placed
            room = len(self._starts) - self._used
            if room == 0:
                self._place()
                continue
            wanted = min(-(-(len(xyz) - done) // PIECE), room)
            edges = [wanted * part // self._parts for part in range(self._parts + 1)]
            for marked, (a, b) in zip(self._marks, itertools.pairwise(edges), strict=True):
                rows, pieces = slice(done + a * PIECE, done + b * PIECE), slice(self._used + a, self._used + b)
                self._numbered[pieces] = first + done + np.arange(a, b) * PIECE
                self._running.append(self._pool.submit(
                    pack_kernels.pack_points,
                    pack_kernels.ReadPoints(xyz[rows], rgb[rows], bits[rows], scan[rows], first + rows.start), self._targets,
                    pack_kernels.Pieces(self._buckets[pieces], self._words[pieces], self._starts[pieces]), marked))  # fmt: skip
            self._used += wanted
            done += wanted * PIECE

    def finish(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (buckets + 1, 2) int64, where each run begins and how many points it was given, and the cells' boxes."""
        self._wait()
        self._place()
        self._wait()
        return self._runs, boxes_of(self._marks)

    def _place(self) -> None:
        """Begins to place what is packed, groups of about equally many points on each thread."""
        starts = self._starts[: self._used]
        held = np.cumsum(np.diff(starts, axis=1).sum(axis=0, dtype=np.int64))
        jobs = _JOBS * self._parts
        edges = np.searchsorted(held, held[-1] * np.arange(1, jobs) // jobs, side="right")
        for a, b in itertools.pairwise(np.unique([0, *edges, len(held)]).tolist()):
            self._running.append(self._pool.submit(
                pack_kernels.place_points, self._buckets, self._words, starts, self._numbered, a, b, self._runs, self._points,
                *self._records))  # fmt: skip
        self._used = 0

    def _wait(self) -> None:
        for job in self._running:
            job.result()
        self._running = []
