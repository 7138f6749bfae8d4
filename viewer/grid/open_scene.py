"""Opens scans: from a folder that ``convert`` made, from the cache, or by reading the files and building the grid.

Frame: file coordinates throughout; several files are taken to share one frame.
"""

import logging
import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..preprocess.scan_description import (
    NO_DESCRIPTION,
    ColourSummary,
    ScanDescription,
    ScanWarning,
    WarningTopic,
)
from ..readers.grid_folder import is_grid
from .build_scene import build_scene, in_memory, warnings_of
from .place.many_files import is_place
from .scene import Scene

if TYPE_CHECKING:
    from ..common.rigid_transform import Rows
    from ..common.workers.worker_choice import Workers
    from ..readers.moved_source import Moves
    from .place.open_place import PlaceGrids

_log = logging.getLogger(__name__)


def open_scene(
    paths: Sequence[Path | str] | Path | str, *, cache: bool = True, match: bool = True, columns: str | None = None,
    moves: "Moves | None" = None, workers: "Workers | None" = None,
) -> Scene:
    """One scene from one or several scan files and folders made by ``convert``.

    cache: store the grid in ``viewer.common.paths.cache_dir()``, and use the one stored there earlier.
    match: give scans of one place the same exposure (viewer.preprocess.exposure_compensation), and treat implausibly frequent
    black as missing colour.  A folder made by ``convert`` has the colours it was built with; it is refused where colours as
    scanned are asked for and it has others.
    columns: what the columns of text files are (viewer.readers.text.text_columns); None: they are recognised.
    moves: the rigid transformations of scans that a project has moved; None: all stay where their files have them.
    workers: who converts the files of a place that are not in the cache; None: as many processes as this machine has room for.
    Many or large files have a grid each, which the scene joins (viewer.grid.place.open_place).
    Of several files those that cannot be opened are left out, with a warning about each.
    Raises InputError, one line, where no file can be opened or the cache folder cannot be used; Cancelled where
    progress is cancelled.
    """
    from . import cache as stored

    files = as_paths(paths, said=(said := []))
    if len(files) == 1 and files[0].is_dir():
        from .place.open_place import folder_scene

        return folder_scene(files[0], match, moves)
    grids = {file for file in files if is_grid(file)}
    if grids and not cache:
        raise InputError("folders made by convert are opened together by way of the cache", option="--no-cache",
                         remedy="leave it out")
    files, left_out = present(files, grids)
    if grids or (cache and is_place(files)):
        from .place.open_place import open_place

        scene, unread = open_place(files, match=match, columns=columns, moves=moves, workers=workers)
        left_out += unread
    elif not cache:
        scene = build_scene(files, in_memory, match=match, columns=columns, moves=moves)
    else:
        build = partial(build_scene, match=match, columns=columns, moves=moves)
        scene = stored.load_or_build(files, build, match=match, columns=columns, moves=moves)
    for line in said:
        _log.warning("%s", line)
    if left_out or said:
        more = [*map(ScanWarning, said), *warnings_of(left_out)]
        scene = replace(scene, meta=replace(scene.meta, warnings=(*scene.meta.warnings, *more)))
    for warning in scene.meta.warnings_about(WarningTopic.LEFT_OUT):
        _log.warning("%s", warning)
    return scene


def grids_of(paths: Sequence[Path | str], *, match: bool = True, columns: str | None = None) -> "PlaceGrids":
    """The grids of scans, from the cache or made now, which can be joined with others.  match, columns: as for open_scene.

    Raises InputError where no file can be opened."""
    from .place.open_place import place_grids

    files = as_paths(paths)
    found, left_out = present(files, {file for file in files if is_grid(file)})
    grids = place_grids(found, match=match, columns=columns)
    return replace(grids, errors=[*left_out, *grids.errors])


def is_cached(files: list[Path], match: bool = True, columns: str | None = None, moves: "Moves | None" = None) -> bool:
    """Whether the grids of files are in the cache, so that nothing is converted.  match, columns, moves: as for open_scene."""
    from . import cache as stored

    grids = {file for file in files if is_grid(file)}
    if is_place(files) or grids:
        from .place.open_place import missing_grids

        files = [file for file in files if file not in grids]
        return not missing_grids(files, match=match, columns=columns, moves=moves)
    return (stored.folder_of(files, match, columns, moves) / "meta.json").is_file()


def present(files: list[Path], grids: Collection[Path] = ()) -> tuple[list[Path], list[InputError]]:
    """The files that are there and not empty, and what is wrong with each of the others.  grids: those that are folders made by
    ``convert``, where such may be among them.  Raises InputError where none is left, or a file is given alone."""
    from ..readers.formats import check_file, none_opens

    found, left_out = [], []
    for file in files:
        try:
            if file not in grids:
                check_file(file)
            found.append(file)
        except InputError as error:
            if file.is_dir():  # a folder made by convert, or without scans: not a file of the set that failed
                raise
            left_out.append(error)
    if not found and left_out:
        raise left_out[0] if len(files) == 1 else none_opens(files, left_out[0])
    return found, left_out


def say_degrees(scene: Scene) -> None:
    """Logs a line where the coordinates of a scene are degrees, with the command that transforms them to metres."""
    for warning in scene.meta.warnings_about(WarningTopic.DEGREES):
        _log.warning("%s", warning)


def scene_from_arrays(
    xyz: np.ndarray,
    rgb: np.ndarray,
    *,
    intensity: np.ndarray | None = None,
    scan: np.ndarray | None = None,
    classification: np.ndarray | None = None,
    meta: ScanDescription = NO_DESCRIPTION,
    stages: dict[str, float] | None = None,
    noise: bool = True,
) -> Scene:
    """A scene in memory from points in memory.

    xyz: (N, 3) float64, any frame.  rgb: (N, 3) uint8.  intensity: (N,) uint16.  scan: (N,) uint8.
    classification: (N,) uint8.  meta: what is known about the scan.  stages: if given, receives the
    seconds each stage took.  noise: estimate the noise of the colours.  Points that are not finite are left out.
    Raises InputError naming the first array that does not fit.
    """
    from ..readers.arrays import ArraySource
    from .building.two_passes import build_grid

    source = ArraySource(xyz, rgb, intensity, scan, classification)
    known = replace(meta, format=meta.format or "arrays", colour=meta.colour or ColourSummary("rgb", 8, "8-bit colour"))
    return build_grid([source], colours=None, allocate=in_memory, known=known, stages=stages, noise=noise)


def as_paths(paths: Sequence[Path | str] | Path | str, *, fetch: bool = True, said: list[str] | None = None) -> list[Path]:
    """The given path or paths as a list, each file once, however its path is spelt; a folder of scans stands for the scans in
    it, an address for its copy in the cache folder.

    fetch: what is not in the copy yet is read from the address first; else the copy may have holes or not be there.
    said: gets a line for each address that does not answer and of which an earlier copy is used; None: the log gets them.
    Raises InputError for an empty list, and for an address that cannot be read.
    """
    given = [paths] if isinstance(paths, (str, Path)) else list(paths)
    if not given:
        raise InputError("no scan given", remedy="name at least one file")
    from ..readers.formats import entry_of, scans_inside
    from ..readers.remote.local_copies import local_files

    local = local_files(map(Path, given), fetch=fetch, said=said)
    return each_once(entry_of(file) for path in local for file in scans_inside(path) or [path])


def moves_as(paths: Sequence[Path | str], transforms: "Sequence[Rows | None]") -> "Moves":
    """The transformations of the files that paths stand for, from those in their order; none where their numbers differ."""
    from ..readers.moved_source import moves_at

    files = as_paths(paths, fetch=False) if any(transforms) else []
    return moves_at(files, transforms) if len(files) == len(transforms) else {}


def each_once(paths: Iterable[Path]) -> list[Path]:
    """The paths without those that lead to the same file or folder as an earlier one."""
    places: dict[str, Path] = {}
    for path in paths:
        places.setdefault(os.path.realpath(path), path)
    return list(places.values())
