"""Builds the grid in two passes over chunks.

    sources -> pass 1: _count -> FirstPass -> choose_layout -> pass 2: _place -> _Placed -> _scene -> Scene

Frame: file coordinates in, packed cells out.  Memory: three chunks, those that are kept
(viewer.grid.building.kept_chunks), the histogram, two blocks and, where ``allocate`` gives memory and not a file, the packed
points.  The result does not depend on the number of processors.
"""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ....model.appearance.noise import NoiseModel
from ...common.errors import InputError
from ...common.progress import stage
from ...preprocess.point_attributes import AttributeCounts, AttributeLayout, common_ends
from ...preprocess.point_colour import ColourDecision, Colours
from ...preprocess.scan_description import DroppedPoints, RecordOrigin, ScanDescription, ScanSummary, ScanWarning
from ...preprocess.scan_table import MOST_NUMBERS, ScanTable, stated_scans
from ...preprocess.scanner_positions import StationInference
from ...readers.source import Source
from ..density_layers import PARTS, Lattice, TooWideForCells
from ..projected_coverage import projected_coverage
from ..records.point_records import PointRecords, allocated
from ..scene import STEPS, Scene
from .cell_layout import Layout, choose_layout
from .cluster_check import ClusterCheck
from .count_checks import check_any_valid, degree_warnings, drop_warnings, precision_warnings
from .count_points import CellCounts, count_cells
from .grid_threads import processors
from .histogram import power_of_two
from .kept_chunks import KeptChunks
from .noise_sample import NoiseSample
from .scatter import scatter
from .spacing import measure_spacing

_LEAST_STEPS = 4
"""Packed positions between neighbouring points, at least: rounding then moves a point by an eighth of the spacing at
most."""
_COINCIDING = 0.02
"""Share of points packed into one position with their neighbours from which finer cells are tried: 0 in six real scans."""
_UNPARTED = 0.75  # share of those still coinciding in finer cells from which the coarse cells are kept; 0.5 and 0.95 do as well
_ATTEMPTS = 4
"""Cell sizes tried at most, each up to 256 times finer: with STEPS positions a cell the last tells 2**40 places along the scan
apart, a millimetre in 1e9 m, beyond which a coordinate is invalid."""
_FINEST_STEPS = 1 / 16  # steps taken for a spacing that is too small to measure: cells of the next attempt are 256 times finer
_DEFAULT_SPACING = 1 / 64  # of a cell, where no two positions differ: the one place has no neighbour, and any would do

Allocate = Callable[[str, tuple[int, ...], type], np.ndarray]
"""Gives a writable array for a column of the points: its name in the grid's folder, shape and type."""


@dataclass(frozen=True, eq=False)
class FirstPass:
    """What pass 1 found out.  decision: about colours; None where chunks have theirs.  warnings: for a person."""

    counts: CellCounts
    scans: ScanTable
    attributes: AttributeLayout
    decision: ColourDecision | None
    warnings: list[ScanWarning]


@dataclass(frozen=True, eq=False)
class _Placed:
    """The points in their cells.  counts: of the cells used.  steps: median spacing in packed positions, 0.0 where none could
    be measured.  boxes: (C, 6) uint8 as in Scene."""

    counts: CellCounts
    layout: Layout
    steps: float
    boxes: np.ndarray


class _Clock:
    """Adds the seconds since the last lap to a stage."""

    def __init__(self, stages: dict[str, float]):
        self._stages, self._last = stages, time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self._stages[stage] = self._stages.get(stage, 0.0) + now - self._last
        self._last = now


def build_grid(
    sources: list[Source], *, colours: Colours | None, allocate: Allocate, known: ScanDescription,
    stages: dict[str, float] | None = None, noise: bool = True, folder: Path | None = None, lattice: Lattice | None = None,
) -> Scene:
    """Walks over the points twice and returns the finished scene.

    colours: decides on colours over whole files; None takes the chunks' 8-bit colours as they are.
    known: what is known already.  What the passes find out is added: warnings, records, colours (unless ``colours`` is None),
    attributes, dropped points, and scans where none are known.
    stages: if given, receives the seconds each stage took.
    noise: estimate the noise of the colours; otherwise ``Scene.noise`` is None.
    folder: for a temporary file of what the second pass needs; None: that of the system.
    lattice: of the place that the grid is a part of; None: the grid is a scene by itself.
    Raises InputError for damaged files, and where no valid point is found.
    """
    clock = _Clock({} if stages is None else stages)
    with ThreadPoolExecutor(processors(), "grid") as pool, KeptChunks(sources, folder) as kept:
        first = _count(kept, colours)
        clock.lap("count")
        points, records = _room(allocate, first.counts, kept)
        sample = NoiseSample(sources, first.counts) if noise else None
        placed = _place(kept, colours, first, points, records, pool, sample, clock, lattice)
        with stage("measuring the cells"):
            coverage = projected_coverage(points, placed.layout.offsets, placed.layout.layers, pool)
        clock.lap("faces")
        with stage("estimating the noise") if sample else nullcontext():
            model = sample.solve() if sample else None
        clock.lap("noise")
    return _scene(sources, first, placed, points, records, known, coverage, model)


def _room(allocate: Allocate, counts: CellCounts, kept: KeptChunks) -> tuple[np.ndarray, PointRecords]:
    """Arrays for the points and their running numbers."""
    while True:
        try:
            points = allocate("points", (counts.count, 3), np.uint32)
            return points, allocated(allocate, counts.count, counts.running, len(kept.sources))
        except (OSError, InputError):  # the kept chunks are in the way: without them, the files are decoded again
            if not kept.drop_file():
                raise


def _count(kept: KeptChunks, colours: Colours | None) -> FirstPass:
    """Pass 1."""
    sources = kept.sources
    attributes, stations, clusters = AttributeCounts(), StationInference(sources), ClusterCheck(sources)
    observers = [attributes, *([] if colours is None else [colours, stations]), *([clusters] if len(sources) > 1 else [])]
    counts = count_cells(kept, observers)
    check_any_valid(sources, counts)
    scans, decision = stated_scans(sources), None
    if colours is not None:
        with ThreadPoolExecutor(1, "stations") as pool:
            found = pool.submit(stations.solve)
            colours.prepare()
            scans = found.result()
        decision = colours.decide(_height_range(counts), scans.turns)
    warnings = [ScanWarning(text) for text in (() if decision is None else decision.warnings)]
    return FirstPass(counts, scans, attributes.layout(), decision, warnings + clusters.warnings())


def _place(kept: KeptChunks, colours: Colours | None, first: FirstPass, points: np.ndarray, records: PointRecords,
           pool: Executor, sample: NoiseSample | None, clock: _Clock, lattice: Lattice | None) -> _Placed:  # fmt: skip
    """Pass 2, repeated with finer cells where points lie too close together for the packed positions.  Fills ``points`` and
    ``records``."""

    def place(counts: CellCounts, layout: Layout, sample: NoiseSample | None) -> tuple[_Placed, float]:
        """The points in these cells, and the share of coinciding points."""
        clock.lap("cells")
        boxes = scatter(kept, colours, first.scans, counts, layout, points, records, pool, processors(), first.attributes,
                        sample)  # fmt: skip
        clock.lap("place")
        with stage("measuring the spacing"):
            steps, coinciding = measure_spacing(points, layout.cells, layout.offsets, layout.layers, pool)
        clock.lap("spacing")
        return _Placed(counts, layout, steps, boxes), coinciding

    counts = first.counts
    if lattice is not None and lattice.cell_size is not None:
        return place(*_on_lattice(kept, counts, lattice), sample)[0]
    found, coinciding = coarsest, most_coinciding = place(counts, choose_layout(counts, lattice=lattice), sample)
    if 0 < found.steps < _LEAST_STEPS:  # too coarse: these cells are never taken after all
        coarsest = None
    for _ in range(_ATTEMPTS - 1):
        resolved = found.steps >= _LEAST_STEPS and coinciding <= _COINCIDING
        if resolved or not np.ptp(counts.bounds, axis=0).any():
            break
        # dense clusters far apart: the cells are too coarse for points this close, so once more with finer ones
        smallest = _FINEST_STEPS if coinciding > _COINCIDING else max(found.steps, _FINEST_STEPS)
        size = power_of_two(found.layout.cell_size * smallest / (4 * _LEAST_STEPS))
        if counts.cell_size > size:
            finer = count_cells(kept, cell_size=size)
            if finer.count != counts.count or finer.cell_size >= found.layout.cell_size:
                break
            counts = finer
        found, coinciding = place(counts, choose_layout(counts, size, lattice), None)
    if coarsest and coarsest is not found and coinciding > _UNPARTED * most_coinciding:
        return place(coarsest.counts, coarsest.layout, None)[0]  # the same points over and over: no cells separate them
    return found


def _on_lattice(kept: KeptChunks, counts: CellCounts, lattice: Lattice) -> tuple[CellCounts, Layout]:
    """The cells of a place.  Raises TooWideForCells where the file cannot have cells of that size."""
    size = lattice.cell_size
    if size is not None and counts.cell_size > size:
        finer = count_cells(kept, cell_size=size)
        if finer.cell_size > size or finer.count != counts.count:
            raise TooWideForCells(kept.sources[0].path, size, finer.cell_size)
        counts = finer
    return counts, choose_layout(counts, lattice=lattice)


def _scene(sources: Sequence[Source], first: FirstPass, placed: _Placed, points: np.ndarray, records: PointRecords,
           known: ScanDescription, coverage: np.ndarray, noise: NoiseModel | None) -> Scene:  # fmt: skip
    counts, layout, steps = placed.counts, placed.layout, placed.steps
    spacing = (steps or STEPS * _DEFAULT_SPACING) * layout.cell_size / STEPS
    warnings = [*known.warnings, *first.warnings]
    if 0 < steps < _LEAST_STEPS:
        warnings.append(ScanWarning("points lie too close together for so wide a scan, positions are rounded; split it"))
    warnings += [*map(ScanWarning, drop_warnings(counts)), *degree_warnings(sources, counts)]
    warnings += map(ScanWarning, precision_warnings(sources, counts, spacing if steps else None))
    scans = known.scans or _listed_scans(first, points)
    if len(scans) > MOST_NUMBERS:
        warnings.append(ScanWarning(f"{len(scans)} scans: the picture hides and colours those from the {MOST_NUMBERS}th on as "
                                    "one; picking, export and Python tell all apart"))  # fmt: skip
    attributes = first.attributes
    if attributes.low is not None:
        attributes = replace(attributes, ends=common_ends([source.intensity_ends for source in sources]))
    of_files = [ScanWarning(text) for source in sources for text in source.warnings]
    meta = replace(
        known, warnings=(*of_files, *warnings), attributes=attributes, scans=scans,
        records=_origin(first.scans, records, known.records or RecordOrigin()),
        dropped=DroppedPoints(nan=counts.dropped[0], invalid=counts.dropped[2], stray=counts.dropped[1]),
    )  # fmt: skip
    if (decision := first.decision) is not None:
        meta = replace(meta, colour=decision.colour, exposures=decision.exposures, passes=decision.passes)
    return Scene(
        points, layout.cells, layout.offsets, np.asarray(layout.base * layout.cell_size), layout.cell_size, layout.layers,
        counts.count, spacing, counts.bounds, meta, parts=PARTS, faces=coverage, boxes=placed.boxes, noise=noise,
        records=records, live=tuple(sources),
    )  # fmt: skip


def _origin(scans: ScanTable, records: PointRecords, known: RecordOrigin) -> RecordOrigin:
    """``known`` with what leads from running numbers to records and scans."""
    return replace(
        known, first=tuple(records.first.tolist()), scan_first=None if records.scans is None else tuple(records.scans.tolist()),
        scans=tuple(len(scans) for scans in scans.scans),
        turns={source: tuple(turns.tolist()) for source, turns in scans.turns.items()},
    )  # fmt: skip


def _height_range(counts: CellCounts) -> tuple[float, float]:
    """1st to 99th percentile of height by whole cells, within the bounds."""
    order = np.argsort(counts.cells[:, 2])
    z = (counts.cells[order, 2] + counts.base[2]) * counts.cell_size
    share = counts.counts[order].sum(axis=1).cumsum()
    low, high = z[np.searchsorted(share, (0.01 * share[-1], 0.99 * share[-1]))]
    return max(float(low), float(counts.bounds[0, 2])), min(float(high + counts.cell_size), float(counts.bounds[1, 2]))


def _listed_scans(first: FirstPass, points: np.ndarray) -> tuple[ScanSummary, ...]:
    """The scans of the sources.  Chunks with a scan number per point are counted in the packed points."""
    counts = first.counts.kept | first.scans.counts
    if not counts:
        counts = {(0, i): int(n) for i, n in enumerate(np.bincount(points[:, 2] >> 24))}
    return tuple(
        ScanSummary(scan.name, counts.get((s, i), 0), scan.position, scan.inferred)
        for s, scans in enumerate(first.scans.scans)
        for i, scan in enumerate(scans)
    )
