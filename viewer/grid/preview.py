"""A coarse scene of scan files within about a second, shown while the complete grid is being built.

A sample of points spread over each file represents it: most formats give runs of points from evenly spread places, or upper
levels of an octree (``Source.sample``).  Of the others, the points that can be read in the time are thinned.  Decisions that
need whole files (exposure compensation, missing colour, inferred scanner positions) are left to the complete grid.
Frame: file coordinates.
"""

import logging
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError

if TYPE_CHECKING:
    from ..readers.moved_source import Moves
    from ..readers.source import Chunk, Source
    from .scene import Scene

LEAST_POINTS = 2000
"""Points that a preview must have.  In filled pictures of 400 x 300 pixels of the whole demo.laz, studio.laz and a statue, half
leaves the studio in pieces; with this its outline is whole; with twice the outline of the statue is recognised as well."""
ENOUGH_POINTS = 40_000
"""Points with which reading stops when the time is up; until there are as many, it may take twice the time: a tenth of
what a preview asks for."""
LEAST_BYTES = 2 << 20
"""Smaller files are opened completely about as fast: studio.laz, 18 MB, takes 5.1 s on two cores, so 2 MiB take 0.6 s."""
RUN = 256
"""Points that are read in a row, more where only whole blocks can be decoded: on an E57 of 18 million points
runs of 1024 leave wide gaps."""
_HEIGHT_PERCENTILES, _GREY_PERCENTILES = (2, 98), (1, 99)
"""Range of the colours by height, and of grey by intensity, as in viewer.preprocess.point_colour.  The range by height is 0.39
of all heights in demo.laz, whose highest points are few, 0.67 in autzen_trim.laz and 0.71 to 0.97 in five other scans; with 1
and 99 it is 0.60, 0.76 and 0.75 to 0.98, with 4 and 96, which cut off the trees of autzen, 0.39, 0.51 and 0.67 to 0.97."""
_log = logging.getLogger(__name__)


def preview_scene(paths: Sequence[Path], *, points: int | Sequence[int] = 400_000, seconds: float = 0.8,
                  columns: str | None = None, least_bytes: int = LEAST_BYTES, moves: "Moves | None" = None) -> "Scene | None":
    """A scene in memory of about ``points`` points, read in about ``seconds``, on a slow disk in twice that.  Several numbers:
    those of each file.

    Returns None where the files have fewer than ``least_bytes`` together, cannot be read (the complete load reports why), or
    have too few points.  columns: of text files, moves: as for open_scene.
    """
    from ..preprocess.point_colour import height_colours
    from ..preprocess.scan_description import ScanSummary
    from ..readers.formats import open_readable
    from .build_scene import stated_facts
    from .open_scene import as_paths, scene_from_arrays

    try:
        files = as_paths(paths, fetch=False)
        if sum(_size(file) for file in files) < least_bytes:
            return None
        sources, _ = open_readable(files, columns, moves)
        end = (time.monotonic() + seconds, time.monotonic() + 2 * seconds)
        shares = [points // len(sources)] * len(sources) if isinstance(points, int) else points
        parts = [_sampled(source, share, end) for source, share in zip(sources, shares, strict=True)]
    except (InputError, OSError) as error:
        _log.info("no preview of %s: %s", ", ".join(map(str, paths)), error)
        return None
    chunks = [chunk for part in parts for chunk in part]
    xyz = np.concatenate([np.zeros((0, 3)), *(chunk.xyz for chunk in chunks)])
    if np.isfinite(xyz).all(axis=1).sum() < LEAST_POINTS:
        return None
    heights = tuple(np.nanpercentile(xyz[:, 2], _HEIGHT_PERCENTILES).tolist())
    rgb, intensity, scan, first = [], [], [], 0
    for source, part in zip(sources, parts, strict=True):
        largest = max((int(chunk.rgb.max()) for chunk in part if chunk.rgb is not None and len(chunk.rgb)), default=0)
        grey = _grey_range(part)
        for chunk in part:
            rgb.append(_colours(chunk, largest, grey, lambda z: height_colours(z, *heights)))
            intensity.append(np.zeros(len(chunk.xyz), np.uint16) if chunk.intensity is None else chunk.intensity)
            scan.append(np.broadcast_to(np.minimum(np.asarray(chunk.scan) + first, 255), len(chunk.xyz)).astype(np.uint8))
        first += len(source.scans)
    scans = tuple(ScanSummary(info.name, 0, info.position) for source in sources for info in source.scans)
    meta = replace(stated_facts(sources), scans=scans)
    try:
        return scene_from_arrays(xyz, np.concatenate(rgb), intensity=np.concatenate(intensity), scan=np.concatenate(scan),
                                 meta=meta, noise=False)
    except InputError as error:  # only outlier points
        _log.info("no preview: %s", error)
        return None


def _size(file: Path) -> int:
    """Bytes of a file.  For the file that describes a folder: of all files directly in the folder, and at least LEAST_BYTES."""
    from ..readers.formats import folder_format

    if folder_format(file):
        return sum(entry.stat().st_size for entry in os.scandir(file.parent) if entry.is_file()) + LEAST_BYTES
    return file.stat().st_size


def _sampled(source: "Source", points: int, end: tuple[float, float]) -> "list[Chunk]":
    """About ``points`` points spread over a source.  end: as in _until."""
    found = source.sample(points, RUN)
    if found is None:
        return _thinned(source, points, end)
    return list(_until(found, end))


def _until(chunks: "Iterator[Chunk]", end: tuple[float, float]) -> "Iterator[Chunk]":
    """The chunks that arrive in time.  end: time.monotonic() when ENOUGH_POINTS suffice, and when reading stops in any case."""
    points = 0
    for chunk in chunks:
        yield chunk
        points += len(chunk.xyz)
        if time.monotonic() > end[0 if points >= ENOUGH_POINTS else 1]:
            return


def _thinned(source: "Source", points: int, end: tuple[float, float]) -> "list[Chunk]":
    """The points that can be read in the time, all thinned alike."""
    chunks: list[Chunk] = []
    for chunk in _until(source.chunks(), end):
        chunks.append(chunk)
    total = sum(len(chunk.xyz) for chunk in chunks)
    step = max(1, total // max(points, 1))
    return [_every(chunk, step) for chunk in chunks]


def _every(chunk: "Chunk", step: int) -> "Chunk":
    def thin(values):
        return values[::step] if isinstance(values, np.ndarray) else values

    return replace(chunk, xyz=chunk.xyz[::step], rgb=thin(chunk.rgb), intensity=thin(chunk.intensity), scan=thin(chunk.scan),
                   station=thin(chunk.station), classification=thin(chunk.classification))


def _grey_range(chunks: "Sequence[Chunk]") -> tuple[float, float]:
    """1st and 99th percentile of the intensities."""
    values = [chunk.intensity for chunk in chunks if chunk.intensity is not None and len(chunk.intensity)]
    low, high = np.percentile(np.concatenate(values), _GREY_PERCENTILES) if values else (0.0, 0.0)
    return float(low), float(high)


def _colours(chunk: "Chunk", largest: int, grey: tuple[float, float], by_height) -> np.ndarray:
    """(n, 3) uint8.  largest: colour value of the whole sample.  grey: range of intensities; both ends are equal where there
    are none."""
    if chunk.rgb is not None and largest > 0:
        return (chunk.rgb >> 8 if largest > 255 else chunk.rgb).astype(np.uint8)
    if chunk.intensity is not None and grey[1] > grey[0]:
        level = np.clip((chunk.intensity - grey[0]) / (grey[1] - grey[0]) * 255 + 0.5, 0, 255).astype(np.uint8)
        return np.repeat(level[:, None], 3, axis=1)
    return by_height(chunk.xyz[:, 2])
