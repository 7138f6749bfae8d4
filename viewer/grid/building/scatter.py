"""Pass 2 of a grid: packs every point and writes it to its place.

Blocks of points are packed on all processors and then placed, by two threads, one for each half of the runs.  While a block is
placed, the next one is packed, so that a processor that finishes sooner has something to do.  Neither order nor result depends
on the number of processors.
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
from . import kernels
from .cell_layout import Layout
from .count_points import CellCounts
from .histogram import dense_table_of, table_of
from .kept_chunks import KeptChunks
from .noise_sample import NoiseSample

BLOCK = 1 << 18
"""Points packed before they are placed; chosen so that the packed words and bucket numbers of two blocks (10 MB) stay in the
processor's last-level cache."""


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
    blocks = _Blocks(counts, layout, points, records, pool, processors)
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
        for start in range(0, len(xyz), BLOCK):
            rows = slice(start, start + BLOCK)
            blocks.add(xyz[rows], rgb[rows], bits[rows], scan[rows], first + start)
        first += len(xyz)
        of_source[number] += len(xyz)
        starts.add(number, chunk.scan, first - len(xyz))
    records.first[1:] = of_source.cumsum()
    records.scans = starts.solve(scans, records.first)
    runs, boxes = blocks.finish()
    if not np.array_equal(runs[:-1, 1], np.diff(layout.offsets)):
        raise InputError("changed while it was read", file=kept.sources[0].path, remedy="try again")
    return boxes


class _Blocks:
    """Two blocks in turn: one being packed, the one before it being placed."""

    def __init__(self, counts: CellCounts, layout: Layout, points: np.ndarray, records: PointRecords, pool: Executor,
                 processors: int):  # fmt: skip
        cells = layout.cells
        self._pool, self._points, self._parts = pool, points, processors
        self._records = records.low, np.empty(0, np.uint8) if records.high is None else records.high
        self._runs = np.stack([layout.offsets, np.zeros_like(layout.offsets)], axis=1)
        dense = dense_table_of(cells)
        table = table_of(cells[:1] if dense.size else cells)
        self._grid = 1 / layout.cell_size, layout.base, counts.reach, dense, table, len(cells), layout.layers
        # two blocks are in flight at a time: each has its own arrays
        self._room = [(np.empty(BLOCK, np.int32), np.empty((BLOCK, 4), np.uint32), np.zeros((processors, len(cells)), np.int64))
                      for _ in range(2)]
        self._packing: tuple[list[Future], list[int], np.ndarray, np.ndarray, int] | None = None
        self._placing: list[Future] = []

    def add(self, xyz: np.ndarray, rgb: np.ndarray, bits: np.ndarray, scan: np.ndarray, first: int) -> None:
        """Packs a block of at most BLOCK points and places the one before it.  bits: (n,) uint16 attributes.
        first: running number of its first point."""
        self._wait()  # for the block that was packed into the same arrays
        edges = [len(xyz) * i // self._parts for i in range(self._parts + 1)]
        self._room.reverse()
        buckets, words, marks = self._room[0]
        jobs = [
            self._pool.submit(kernels.pack_points, xyz[a:b], rgb[a:b], bits[a:b], scan[a:b], first + a, *self._grid,
                              buckets[a:b], words[a:b], marked)
            for marked, (a, b) in zip(marks, itertools.pairwise(edges), strict=True)
        ]
        self._place_packed()
        self._packing = jobs, edges, buckets, words, first

    def finish(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns (buckets + 1, 2) int64, where each run begins and how many points it was given, and the cells' boxes."""
        self._wait()
        self._place_packed()
        self._wait()
        return self._runs, boxes_of(np.concatenate([marks for *_, marks in self._room]))

    def _place_packed(self) -> None:
        if self._packing is None:
            return
        jobs, edges, buckets, words, numbered = self._packing
        filled = [job.result() for job in jobs]
        fronts = [(a, a + front, 1) for a, (front, _) in zip(edges, filled, strict=False)]
        backs = [(b - 1, b - 1 - back, -1) for b, (_, back) in zip(edges[1:], filled, strict=True)]
        self._placing = [self._pool.submit(self._place, pieces, buckets, words, numbered) for pieces in (fronts, backs)]
        self._packing = None

    def _place(self, pieces: list[tuple[int, int, int]], buckets: np.ndarray, words: np.ndarray, first: int) -> None:
        for start, stop, stride in pieces:
            kernels.place_points(buckets, words, start, stop, stride, self._runs, self._points, first, *self._records)

    def _wait(self) -> None:
        for job in self._placing:
            job.result()
        self._placing = []
