"""Builds the grid in two passes over chunks: count (pass 1), choose the cells, then pack every point into its place.

Frame: file coordinates in, packed cells out.  Memory: one chunk, the histogram and, where ``allocate`` gives memory and
not a file, the packed points.  The result depends on the points and their order only, never on chunks or processors.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from viewer.cloud import kernels, layers
from viewer.cloud.colour import Colours
from viewer.cloud.histogram import MAX_CELLS, Histogram, OutOfReach, merge, power_of_two, table_of
from viewer.cloud.scene import STEPS, Scene
from viewer.cloud.source import Chunk, Source
from viewer.cloud.spacing import measure_spacing
from viewer.errors import InputError
from viewer.progress import progress

TARGET = 8192
"""Points a cell should hold on average; within a factor of two, since cell sizes are powers of two."""
_BLOCK = 1 << 18  # points packed before they are placed: packed and bucket numbers stay in the processor's cache
_BULK = 0.95  # share of the points that decides on the cell size, so that scattered outliers do not
_FINEST_MAX_CELLS = 1 << 21
_ATTEMPTS = 4

Allocate = Callable[[int], np.ndarray]
"""Gives a writable (n, 3) uint32 array for the packed points."""


@dataclass
class Survey:
    """What pass 1 found.  cells (C, 3) int32 relative to ``base`` (3,) whole numbers; counts (C, GEOMETRIC) int64.
    kept: points by (source, scan).  dropped: not finite, out of reach, marked invalid by the file."""

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
        return int(self.counts.sum())


def processors() -> int:
    """Processors this process may use, at most 8: beyond that memory is the limit."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, min(8, len(os.sched_getaffinity(0))))
    return max(1, min(8, os.cpu_count() or 1))


def build_grid(sources: list[Source], *, colours: Colours | None, allocate: Allocate, meta: dict) -> Scene:
    """Reads the sources twice and returns the finished scene.

    colours: decides on colours over whole files; None takes the chunks' 8-bit colours as they are.
    meta: completed in place (dropped, scans, colour, warnings) and kept in the scene.
    Raises InputError for damaged files, and where no valid point is found.
    """
    with ThreadPoolExecutor(processors(), "grid") as pool:
        survey = _survey(sources, colours, pool)
        _check_any(sources, survey)
        if colours is not None:
            meta["colour"], said = colours.decide(_heights(survey))
            meta["warnings"] += said
        points = allocate(survey.count)
        cell_size, finest = np.inf, survey.cell_size
        for _ in range(_ATTEMPTS):
            if survey.cell_size > cell_size and finest > cell_size:
                finest = cell_size
                survey = _survey(sources, None, pool, cell_size)
            cells, counts, base, cell_size = choose_cells(survey, cell_size)
            order = layers.morton_order(cells)
            cells, counts = np.ascontiguousarray(cells[order]), counts[order]
            depth = layers.layer_count(survey.count)
            offsets = np.zeros(depth * len(cells) + 1, np.int64)
            np.cumsum(layers.layer_sizes(counts, depth).reshape(-1), out=offsets[1:])
            _scatter(sources, colours, survey, cells, base, cell_size, depth, offsets, points, pool)
            steps = measure_spacing(points, cells, offsets, depth, pool)
            if steps >= 4 or not np.ptp(survey.bounds, axis=0).any() or survey.cell_size > cell_size:
                break
            cell_size = power_of_two(cell_size * max(steps, 1 / 16) / 16)  # too coarse for points this close: once more, finer
    if 0 < steps < 4:
        meta["warnings"].append("points lie closer together than positions can be kept apart; split the scan into parts")
    spacing = (steps or STEPS / 64) * cell_size / STEPS
    meta["dropped"] = {"nan": survey.dropped[0], "invalid": survey.dropped[2], "stray": survey.dropped[1]}
    meta["warnings"] += _drop_warnings(survey)
    _check_precision(sources, survey, spacing, meta["warnings"])
    _list_scans(sources, survey, meta)
    return Scene(
        points, cells, offsets, base * cell_size, cell_size, depth, survey.count, spacing, survey.bounds, meta
    )  # fmt: skip


def _survey(sources, colours, pool: Executor, cell_size: float | None = None) -> Survey:
    """Pass 1.  Starts again with larger cells where the scan turns out far wider than its beginning."""
    limit = MAX_CELLS if cell_size is None else _FINEST_MAX_CELLS
    while True:
        histogram, kept, invalid = None, {}, 0
        seen = Colours(sources) if colours is not None else None
        try:
            for number, chunk in _chunks(sources, "reading"):
                invalid += chunk.invalid
                if len(chunk.xyz) == 0:
                    continue
                if histogram is None:
                    histogram = Histogram(chunk.xyz, cell_size, limit)
                lost = sum(histogram.dropped)
                histogram.add(np.ascontiguousarray(chunk.xyz, np.float64), pool)
                if not isinstance(chunk.scan, np.ndarray):
                    key = (number, chunk.scan)
                    kept[key] = kept.get(key, 0) + len(chunk.xyz) - sum(histogram.dropped) + lost
                if seen is not None:
                    seen.add(number, chunk)
        except OutOfReach as wider:
            cell_size = wider.cell_size
            continue
        if colours is not None and seen is not None:
            colours.__dict__.update(seen.__dict__)
        if histogram is None:
            histogram = Histogram(np.zeros((1, 3)))
        cells, counts = histogram.result()
        nan, stray = histogram.dropped
        return Survey(
            cells, counts, histogram.base, histogram.cell_size, histogram.reach, histogram.bounds, kept, (nan, stray, invalid)
        )


def choose_cells(survey: Survey, at_most: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Merges the survey's cells until they hold about TARGET points (or are few), or are as large as ``at_most``.

    Going from fine to coarse and stopping at once keeps the choice independent of where the grid's zero lies.
    Returns cells (C, 3) int32 from 0, counts (C, GEOMETRIC), base (3,) float64 whole numbers, cell size.
    """
    cells, counts, base, size = survey.cells, survey.counts, survey.base, survey.cell_size
    enough = min(TARGET / 2, _BULK * survey.count / 8)
    while 2 * size <= at_most and _typical(counts) < enough:
        coarse = np.floor(base / 2)
        cells = (np.floor((cells + base) / 2) - coarse).astype(np.int32)
        cells, counts = merge(cells, counts)
        base, size = coarse, 2 * size
    low = cells.min(axis=0)
    return cells - low, counts, base + low, size


def _typical(counts: np.ndarray) -> float:
    """Points per cell over the fullest cells that together hold the bulk of the points."""
    fullest = np.sort(counts.sum(axis=1))[::-1].cumsum()
    bulk = _BULK * fullest[-1]
    return bulk / (np.searchsorted(fullest, bulk) + 1)


def _scatter(sources, colours, survey: Survey, cells, base, cell_size, depth, offsets, points, pool: Executor) -> None:
    """Pass 2: packs blocks of points on all processors, then places them, the finest layer beside all others."""
    table, cursor, parts = table_of(cells), offsets[:-1].copy(), processors()
    buckets, words = np.empty(_BLOCK, np.int32), np.empty((_BLOCK, 3), np.uint32)
    none, inverse, first = np.zeros(_BLOCK, np.uint16), 1 / cell_size, 0
    for number, chunk in _chunks(sources, "building the grid"):
        xyz = np.ascontiguousarray(chunk.xyz, np.float64)
        rgb = np.ascontiguousarray(chunk.rgb if colours is None else colours.apply(number, chunk), np.uint8)
        shared = sources[0].scans is not sources[number].scans
        scan = _scan_numbers(sources, number, chunk) if shared or not isinstance(chunk.scan, np.ndarray) else chunk.scan
        for start in range(0, len(xyz), _BLOCK):
            size = min(_BLOCK, len(xyz) - start)
            edges = [size * i // parts for i in range(parts + 1)]
            jobs = []
            for a, b in zip(edges, edges[1:], strict=False):
                rows = slice(start + a, start + b)
                intensity = none[: b - a] if chunk.intensity is None else chunk.intensity[rows]
                jobs.append(pool.submit(
                    kernels.pack_points, xyz[rows], rgb[rows], intensity, scan[rows], first + start + a, inverse, base,
                    survey.reach, table, len(cells), depth, buckets[a:b], words[a:b],
                ))  # fmt: skip
            filled = [job.result() for job in jobs]
            fronts = [(a, a + front, 1) for a, (front, _) in zip(edges, filled, strict=False)]
            backs = [(b - 1, b - 1 - back, -1) for b, (_, back) in zip(edges[1:], filled, strict=True)]
            for job in [pool.submit(_place, runs, buckets, words, cursor, points) for runs in (fronts, backs)]:
                job.result()
        first += len(xyz)
    if not np.array_equal(cursor, offsets[1:]):
        raise InputError(f"{sources[0].path}: changed while it was read; try again")


def _place(runs, buckets, words, cursor, points) -> None:
    for start, stop, stride in runs:
        kernels.place_points(buckets, words, start, stop, stride, cursor, points)


def _chunks(sources: list[Source], label: str) -> Iterator[tuple[int, Chunk]]:
    counts = [source.count for source in sources]
    total = sum(c for c in counts if c is not None) if None not in counts else 0
    with progress(total, label, unit=" points") as meter:
        for number, source in enumerate(sources):
            for chunk in source.chunks():
                yield number, chunk
                meter.update(len(chunk.xyz) + chunk.invalid)


def _scan_numbers(sources, number: int, chunk: Chunk) -> np.ndarray:
    before = sum(len(source.scans) for source in sources[:number])
    return np.full(len(chunk.xyz), min(before + int(np.max(chunk.scan, initial=0)), 255), np.uint8)


def _heights(survey: Survey) -> tuple[float, float]:
    """1st to 99th percentile of height by whole cells, within the bounds."""
    order = np.argsort(survey.cells[:, 2])
    z = (survey.cells[order, 2] + survey.base[2]) * survey.cell_size
    share = survey.counts[order].sum(axis=1).cumsum()
    low, high = z[np.searchsorted(share, (0.01 * share[-1], 0.99 * share[-1]))]
    return max(float(low), float(survey.bounds[0, 2])), min(float(high + survey.cell_size), float(survey.bounds[1, 2]))


def _check_any(sources: list[Source], survey: Survey) -> None:
    if survey.count:
        return
    name = sources[0].path if len(sources) == 1 else f"{len(sources)} files"
    lost = sum(survey.dropped)
    if lost:
        raise InputError(f"{name}: none of its {lost:,} points is valid (not finite, or marked invalid); export it again")
    raise InputError(f"{name}: holds no points; export it again")


def _drop_warnings(survey: Survey) -> list[str]:
    nan, stray, invalid = survey.dropped
    said = [
        (nan, "points with coordinates that are not finite left out"),
        (invalid, "points marked invalid by the file left out"),
        (stray, "stray points absurdly far from the rest left out"),
    ]
    return [f"{n:,} {what}" for n, what in said if n]


def _check_precision(sources: list[Source], survey: Survey, spacing: float, warnings: list[str]) -> None:
    """Coordinates too large for the numbers that hold them: a warning where the file is so, refused where we are."""
    largest = float(np.abs(survey.bounds).max())
    if survey.count > 1 and largest * 2.0**-52 > spacing / 4:
        raise InputError(
            f"{sources[0].path}: coordinates up to {largest:.3g} cannot hold a point spacing of {spacing:.3g}; "
            "subtract an offset from them first"
        )
    for source in sources:
        if largest * 2 * source.precision > spacing / 4:
            warnings.append(
                f"{source.path.name}: stored in too few digits for coordinates up to {largest:.3g}: positions jump by "
                f"{largest * 2 * source.precision:.2g}; export it with an offset or as double"
            )


def _list_scans(sources: list[Source], survey: Survey, meta: dict) -> None:
    if "scans" in meta:
        return
    meta["scans"] = [
        {"name": scan.name, "count": survey.kept.get((s, i), 0), "position": scan.position and list(scan.position)}
        for s, source in enumerate(sources)
        for i, scan in enumerate(source.scans)
    ]
    if len(meta["scans"]) > 256:
        meta["warnings"].append(f"{len(meta['scans'])} scans: those from the 256th on share one scan number")
