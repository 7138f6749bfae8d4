"""Builds the grid in two passes over chunks: count (pass 1), choose the cells, then pack every point into its place.

Frame: file coordinates in, packed cells out.  Memory: three chunks, the histogram, two blocks and, where
``allocate`` gives memory and not a file, the packed points.  The result does not depend on the number of processors.
"""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from model.common.processors import usable_processors
from viewer.errors import InputError
from viewer.grid.cell_layout import Layout, choose_layout
from viewer.grid.cluster_check import Apart
from viewer.grid.count_points import Survey, survey_points
from viewer.grid.density_layers import PARTS
from viewer.grid.histogram import FARTHEST, power_of_two
from viewer.grid.noise_sample import NoiseSample
from viewer.grid.projected_coverage import cover_of_faces
from viewer.grid.scatter import scatter
from viewer.grid.scene import STEPS, Scene
from viewer.grid.spacing import measure_spacing
from viewer.preprocess.point_attributes import AttributeCounts
from viewer.preprocess.point_colour import Colours
from viewer.preprocess.scanner_positions import Standpoints
from viewer.readers.source import Source
from viewer.text import counted

_STEPS_APART = 4  # neighbouring points lie at least so many packed positions apart
_COINCIDING = 0.02  # share of points packed into one place with their neighbours from which finer cells are tried
_PARTED = 0.75  # share of those that must be left for finer cells to have been in vain
_ATTEMPTS = 4

Allocate = Callable[[int], np.ndarray]
"""Gives a writable (n, 3) uint32 array for the packed points."""


class _Clock:
    """Adds the seconds since the last lap to a stage."""

    def __init__(self, stages: dict[str, float]):
        self._stages, self._last = stages, time.perf_counter()

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self._stages[stage] = self._stages.get(stage, 0.0) + now - self._last
        self._last = now


def processors() -> int:
    """Processors this process may use, at most 8: beyond that memory is the limit."""
    return min(8, usable_processors())


def build_grid(
    sources: list[Source], *, colours: Colours | None, allocate: Allocate, meta: dict, stages: dict | None = None,
    noise: bool = True,
) -> Scene:
    """Reads the sources twice and returns the finished scene.

    colours: decides on colours over whole files; None takes the chunks' 8-bit colours as they are.
    meta: completed in place (dropped, scans, colour, warnings) and kept in the scene.
    stages: if given, receives the seconds each stage took.
    noise: estimate the noise of the colours; otherwise ``Scene.noise`` is None.
    Raises InputError for damaged files, and where no valid point is found.
    """
    clock = _Clock({} if stages is None else stages)
    with ThreadPoolExecutor(processors(), "grid") as pool:
        stands, apart = Standpoints(sources), Apart(sources)
        counts = AttributeCounts()
        watchers = (counts,) if colours is None else (counts, colours, stands)
        survey = survey_points(sources, (*watchers, apart) if len(sources) > 1 else watchers)
        _check_any(sources, survey)
        if colours is not None:
            turns = stands.solve(survey.kept)
            meta["colour"], said = colours.decide(_heights(survey), turns)
            meta |= colours.matched
            meta["warnings"] += said
        meta["warnings"] += apart.said()
        attributes = counts.layout()
        meta["attributes"] = attributes.to_meta()
        clock.lap("count")
        points = allocate(survey.count)
        layout, steps = choose_layout(survey), 0.0
        coinciding, coarsest, boxes = 0.0, None, None
        sample = NoiseSample(sources, survey) if noise else None
        for attempt in range(_ATTEMPTS):
            clock.lap("cells")
            boxes = scatter(sources, colours, survey, layout, points, pool, processors(), attributes,
                            sample if attempt == 0 else None)
            clock.lap("place")
            steps, coinciding = measure_spacing(points, layout.cells, layout.offsets, layout.layers, pool)
            clock.lap("spacing")
            resolved = steps >= _STEPS_APART and coinciding <= _COINCIDING
            if resolved or attempt == _ATTEMPTS - 1 or not np.ptp(survey.bounds, axis=0).any():
                break
            # tight clusters far apart: the cells are too coarse for points this close, so once more with finer ones
            if attempt == 0 and (steps >= _STEPS_APART or not steps):
                coarsest = survey, layout, steps, coinciding
            smallest = 1 / 16 if coinciding > _COINCIDING else max(steps, 1 / 16)
            size = power_of_two(layout.cell_size * smallest / (4 * _STEPS_APART))
            if survey.cell_size > size:
                finer = survey_points(sources, cell_size=size)
                if finer.count != survey.count or finer.cell_size >= layout.cell_size:
                    break
                finer.kept.update(survey.kept)
                survey = finer
            layout = choose_layout(survey, size)
        if coarsest and coarsest[1] is not layout and coinciding > _PARTED * coarsest[3]:
            survey, layout, steps, _ = coarsest  # the same points over and over: no cells part them
            boxes = scatter(sources, colours, survey, layout, points, pool, processors(), attributes)
            clock.lap("place")
        known = {"faces": cover_of_faces(points, layout.offsets, layout.layers, pool), "boxes": boxes}
        clock.lap("faces")
        known["noise"] = sample.solve() if sample else None
        clock.lap("noise")
    return _finish(sources, survey, layout, points, steps, known, meta)


def _finish(sources, survey: Survey, layout: Layout, points, steps: float, known: dict, meta: dict) -> Scene:
    if 0 < steps < _STEPS_APART:
        meta["warnings"].append("points lie too close together for so wide a scan, positions are rounded; split it")
    spacing = (steps or STEPS / 64) * layout.cell_size / STEPS
    meta["dropped"] = {"nan": survey.dropped[0], "invalid": survey.dropped[2], "stray": survey.dropped[1]}
    meta["warnings"] += _drop_warnings(survey)
    _check_precision(sources, survey, spacing if steps else _even_spacing(survey), meta["warnings"])
    _list_scans(sources, survey, points, meta)
    origin = np.asarray(layout.base * layout.cell_size)
    return Scene(
        points, layout.cells, layout.offsets, origin, layout.cell_size, layout.layers, survey.count, spacing,
        survey.bounds, meta, parts=PARTS, **known,
    )  # fmt: skip


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
    if lost and lost == survey.dropped[1]:  # stray, and with none to be far from: from zero
        raise InputError(
            f"{name}: all of its {lost:,} points are too far from zero (beyond {FARTHEST:g}) to be places; export it again "
            "with coordinates in metres"
        )
    if lost:
        raise InputError(
            f"{name}: none of its {lost:,} points is valid (not finite, marked invalid or too far from zero); export it again"
        )
    raise InputError(f"{name}: holds no points; export it again")


def _drop_warnings(survey: Survey) -> list[str]:
    nan, stray, invalid = survey.dropped
    said = [
        (nan, "point", "with coordinates that are not finite"),
        (invalid, "point", "marked invalid by the file"),
        (stray, "stray point", "absurdly far from the rest"),
    ]
    return [f"{counted(n, noun)} {how} left out" for n, noun, how in said if n]


def _even_spacing(survey: Survey) -> float:
    """Spacing if the points were spread over a square of the scan's extent: where none could be measured, because no two
    places differ, this tells points that are equal from points that their coordinates cannot tell apart."""
    extent = float(np.ptp(survey.bounds, axis=0).max())
    return extent / np.sqrt(survey.count) if extent > 0 else np.inf


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


def _list_scans(sources: list[Source], survey: Survey, points: np.ndarray, meta: dict) -> None:
    if "scans" in meta:
        return
    if not survey.kept:  # arrays with a scan number for each point
        survey.kept.update(((0, i), int(n)) for i, n in enumerate(np.bincount(points[:, 2] >> 24)))
    meta["scans"] = [
        {"name": scan.name, "count": survey.kept.get((s, i), 0), "position": scan.position and list(scan.position)}
        | ({"inferred": True} if scan.inferred else {})
        for s, source in enumerate(sources)
        for i, scan in enumerate(source.scans)
    ]
    if len(meta["scans"]) > 256:
        meta["warnings"].append(f"{len(meta['scans'])} scans: those from the 256th on share one scan number")
