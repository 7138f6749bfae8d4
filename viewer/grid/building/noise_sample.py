"""Pass 2 keeps complete small neighbourhoods of points, from which the noise of the scan's colours is estimated
(model.appearance.noise).

Colours are those shown, after exposure compensation.  Points are compared within their run or station: a scan of an E57, a
point source of a LAS or LAZ file, an inferred station, and a stretch of consecutive points.  In a file that is shuffled or
sorted by place (octree, voxel grid), points of different exposures are mixed; their differences count as noise, because nothing
distinguishes them.  Frame: file coordinates.  Memory: twice model.appearance.noise.BUDGET points.
"""

from concurrent.futures import Executor, Future

import numpy as np

from ....model.appearance.noise import NoiseModel, Sampler, no_noise
from ....model.appearance.segment_order import sorted_within, stable_order
from ...readers.source import Chunk, Source
from .count_points import CellCounts

RUN_SHARE, LEAST_RUN = 0.01, 4096
"""The smallest gap in the file order between two runs, as a share of the file and in points.  Measured in 12 neighbourhoods
each: neighbours on successive lines of one station are up to 26,000 of 3.2 million points apart in studio.laz and 20,000 of
11.6 million in plant_room.laz; those of two stations at least 50,000 and 90,000."""
ORDERED = 0.05
"""Median gap in the file order between points of a neighbourhood, as a share of that in a shuffled file, below which the file
is ordered: five real files have 0.0005 to 0.0035, one that an octree reordered (COPC) 0.19."""
_LEAST_POINTS = 12
"""Points of a neighbourhood that is used to decide whether a file is ordered.  Half and twice change the gap of the six files
by at most 6 %, far less than they are from ORDERED."""

_Part = tuple[np.ndarray, ...]
"""Points picked of a chunk: positions, colours, boxes, groups, sources, running numbers."""


class NoiseSample:
    """Samples the points of pass 2 (``add``), then estimates their noise (``solve``)."""

    def __init__(self, sources: list[Source], counts: CellCounts, seed: int = 0):
        self._counts, self._seed, self._sources = counts, seed, len(sources)
        self.reset()

    def reset(self) -> None:
        """Forgets all chunks: the pass begins again."""
        counted = self._counts
        places = (counted.cells + counted.base + 0.5) * counted.cell_size
        held = counted.counts.sum(axis=1).astype(np.float64)
        self._sampler = Sampler(places, held, self._seed, apart=counted.cell_size)
        self._parts: list[_Part] = []
        self._coming: Future[_Part] | None = None
        self._solving: Future[NoiseModel] | None = None
        self._limit: np.uint64 | None = None
        self._held = 0
        self._points = np.zeros(self._sources, np.int64)

    def add(self, source: int, chunk: Chunk, xyz: np.ndarray, rgb: np.ndarray, scan: np.ndarray, first: int,
            pool: Executor) -> None:  # fmt: skip
        """Keeps the points of a chunk that lie in sampled neighbourhoods; ``pool`` picks them beside the caller's work.

        xyz: (n, 3) float64.  rgb: (n, 3) uint8, as shown.  scan: (n,) uint8 scan numbers.  first: running number of its first
        point.  None of these may be changed afterwards.
        """
        self._points[source] += len(xyz)
        coming, self._coming = self._coming, pool.submit(self._pick, source, chunk, xyz, rgb, scan, first)
        self._keep(coming)

    def _pick(self, source: int, chunk: Chunk, xyz: np.ndarray, rgb: np.ndarray, scan: np.ndarray, first: int) -> _Part:
        rows, boxes = self._sampler.pick(xyz)
        group = scan[rows].astype(np.int64)
        if chunk.station is not None:
            group |= np.asarray(chunk.station)[rows].astype(np.int64) << 8
        return xyz[rows], rgb[rows], boxes, group, np.full(len(rows), source, np.int64), first + rows

    def _keep(self, coming: "Future[_Part] | None") -> None:
        """Adds a chunk's points, picked while as many boxes as now or more were sampled."""
        if coming is None:
            return
        self._parts.append(self._below(coming.result()))
        self._held += len(self._parts[-1][0])
        while self._held > self._sampler.most:  # the boxes hold more points than estimated
            self._limit = np.uint64(self._sampler.fewer())
            self._parts = [self._below(part) for part in self._parts]
            self._held = sum(len(part[0]) for part in self._parts)

    def _below(self, part: _Part) -> _Part:
        """A part's points in boxes that are still sampled."""
        return part if self._limit is None else tuple(values[part[2] < self._limit] for values in part)

    def begin_solving(self, pool: Executor) -> None:
        """All points were added: ``pool`` estimates their noise beside the caller's work."""
        self._solving = pool.submit(self._solve)

    def solve(self) -> NoiseModel:
        """The noise of the points added, which are then freed."""
        solving, self._solving = self._solving, None
        return self._solve() if solving is None else solving.result()

    def _solve(self) -> NoiseModel:
        coming, self._coming = self._coming, None
        self._keep(coming)
        parts, self._parts = self._parts, []
        if not parts:
            return no_noise()
        xyz, rgb, boxes, group, source, at = (np.concatenate([part[k] for part in parts]) for k in range(6))
        return self._sampler.noise(xyz, rgb, boxes, runs(boxes, group, source, at, self._points))


def runs(boxes: np.ndarray, group: np.ndarray, source: np.ndarray, at: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) int64 number of each point's run: equal where neighbourhood, source, group and stretch of the file are.

    boxes (n,) uint64, group (n,), source (n,), at (n,): each point's neighbourhood, station, source and running number.
    points: (S,) how many points each source has.
    """
    order = np.arange(len(at)) if (at[1:] >= at[:-1]).all() else np.argsort(at, kind="stable")
    order = order[stable_order(boxes[order], source[order], group[order])]
    boxes, group, source, at = boxes[order], group[order], source[order], at[order]
    new = np.ones(len(at), bool)
    new[1:] = (boxes[1:] != boxes[:-1]) | (source[1:] != source[:-1]) | (group[1:] != group[:-1])
    gap = np.diff(at, prepend=at[:1])
    for file, count in enumerate(points):
        if _is_ordered(new, gap, source == file, int(count)):
            new |= (source == file) & (gap > max(RUN_SHARE * count, LEAST_RUN))
    number = np.empty(len(at), np.int64)
    number[order] = np.cumsum(new) - 1
    return number


def _is_ordered(new: np.ndarray, gap: np.ndarray, mine: np.ndarray, count: int) -> bool:
    """Whether a file of ``count`` points keeps neighbours together.  new, gap, mine: (n,) of points by neighbourhood and then
    place in the file: where a neighbourhood begins, the gap to the point before, and whether a point is the file's."""
    segment = np.cumsum(new) - 1
    sizes = np.bincount(segment, minlength=1)
    usable = mine & ~new & (sizes >= _LEAST_POINTS)[segment]
    if not usable.any():
        return False
    number, gaps = segment[usable], gap[usable]
    first = np.flatnonzero(np.diff(number, prepend=-1))
    ranked = sorted_within(gaps, np.append(first, len(gaps)))
    here = sizes[number[first]]
    middle = ranked[first + (np.diff(first, append=len(number)) - 1) // 2]
    return bool(np.median(middle * here) < ORDERED * count * np.log(2))
