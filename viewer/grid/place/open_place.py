"""Opens files and folders made by ``convert`` as a place: each file's grid from the cache, or converted; then joined."""

from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.errors import InputError, Option
from ...common.paths import cache_dir
from ...common.progress import named_progress, progress
from ...common.workers.run_tasks import run_tasks
from ...readers.moved_source import refuse_moved_grid
from .. import cache as stored
from ..density_layers import TooWideForCells
from ..scene import Scene
from . import kept_place
from .convert_files import PlaceOptions, convert_one, known_grids, largest, refuse_none
from .measured_place import scene_of_grids
from .own_processes import largest_first, own_processes
from .relaid_grid import with_cells

if TYPE_CHECKING:
    from ...common.workers.worker_choice import Workers
    from ...readers.moved_source import Moves


def open_place(paths: Sequence[Path], *, match: bool = True, columns: str | None = None, moves: "Moves | None" = None,
               workers: "Workers | None" = None) -> tuple[Scene, list[InputError]]:
    """One scene of files, and of folders made by ``convert``, and why each of the files that are not in it could not be read.

    match, columns, moves, workers: as for :func:`place_grids`, which says what is raised."""
    asked = kept_place.asked_of(paths, match, columns, moves)
    if asked is not None and (scene := kept_place.kept_scene(asked)) is not None:
        return scene, []
    scans = None if asked is None else kept_place.state_of_scans(asked)
    grids = place_grids(paths, match=match, columns=columns, moves=moves, workers=workers)
    scene = scene_of_grids(grids.scenes, grids.folders, match=match)
    if asked is not None and scans is not None and not grids.errors:
        kept_place.keep(asked, scene, grids.scenes, grids.folders, scans, grids.states)
    return scene, grids.errors


@dataclass(frozen=True, eq=False)
class PlaceGrids:
    """The grids of a place.  scenes: as read from ``folders``.  errors: why other files could not be read.  states: of the
    grids of files, before they were read (viewer.grid.place.kept_place)."""

    scenes: list[Scene]
    folders: list[Path]
    errors: list[InputError]
    states: list[kept_place.States]


def place_grids(paths: Sequence[Path], *, match: bool = True, columns: str | None = None, moves: "Moves | None" = None,
                workers: "Workers | None" = None) -> PlaceGrids:
    """The grids of files and of folders made by ``convert``, which can be joined.

    match, columns, moves, workers: as for viewer.grid.open_scene.  Files whose grid is in the cache are not read.  Without
    ``workers`` as many processes convert as this machine has room for (viewer.grid.place.own_processes).  Folders decide on
    the cells; where theirs differ, those of the fewest points are laid again (viewer.grid.place.relaid_grid).  Raises
    InputError where a folder cannot be used, no file can be read or the cache cannot be written; Cancelled where progress is
    cancelled: grids that are complete stay.
    """
    given = {path: folder_scene(path, match, moves, late=True) for path in paths if path.is_dir()}
    files = [path for path in paths if path not in given]
    options = PlaceOptions(match, columns, tuple((moves or {}).items()))
    size = _size_of_most(list(given.values()))
    while True:
        folders, size, errors = _converted_files(files, options, size, workers)
        wide = [error.cell_size for error in errors.values() if isinstance(error, TooWideForCells)]
        if size is None or not wide or max(wide) <= size:
            break
        size = max(wide)  # all get the cells that the widest file needs
    if files and not given:
        refuse_none(files, list(errors.values()))
    opened: list[tuple[Scene, Path]] = []
    states: list[kept_place.States] = []
    for path in paths:
        if path in given:
            assert size is not None
            opened.append(with_cells(given[path], path, size))
        elif path in folders:
            states.append(kept_place.state_of(folders[path]))
            opened.append((_opened(folders[path], path, cache_dir(), replace(options, cell_size=size)), folders[path]))
    return PlaceGrids([scene for scene, _ in opened], [folder for _, folder in opened],
                      [errors[file] for file in files if file in errors], states)


def folder_scene(folder: Path, match: bool, moves: "Moves | None", *, late: bool = False) -> Scene:
    """The grid in a folder made by ``convert``.  late: it is one of many (viewer.grid.cache.load).  Raises InputError where it
    is damaged, moved, or was built with matched exposures and colours as scanned are asked for."""
    refuse_moved_grid(folder, moves)
    scene = stored.load_folder(folder, late=late)
    if not match and scene.matched:
        raise InputError("was built with matched exposures, colours as scanned are not in it", file=folder,
                         remedy=("give the scan itself, or convert it again with ", Option("--exposures", "as-scanned")))
    return scene


def _size_of_most(scenes: Sequence[Scene]) -> float | None:
    """The size of the cells of the most points; None where there are no scenes."""
    votes: Counter[float] = Counter()
    for scene in scenes:
        votes[scene.cell_size] += scene.count
    return max(votes, key=lambda size: (votes[size], size)) if votes else None


def _converted_files(files: Sequence[Path], options: PlaceOptions, size: float | None, workers: "Workers | None"
                     ) -> tuple[dict[Path, Path], float | None, dict[Path, InputError]]:
    """The folders in the cache of the grids of files, the size of their cells, and why others could not be read.  size: None:
    that of the most in the cache, or as the largest file asks for."""
    cache = cache_dir()
    known = known_grids(files, cache, options)
    size = known.common_size() if size is None else size
    folders = {file: sizes[size] for file, sizes in known.folders.items() if size is not None and size in sizes}
    errors: dict[Path, InputError] = {}
    wanted = [file for file in files if file not in folders]
    if size is None:  # the first grid decides
        wanted.sort(key=lambda file: file != largest(files))
    if workers is None:
        workers = own_processes(wanted)
    left = [*wanted]
    with progress(len(wanted), "converting files", " file") as meter:
        for number, file in enumerate(wanted, 1):
            if workers is not None and size is not None:
                break
            left.remove(file)
            try:
                with named_progress(f"{file.name} ({number} of {len(wanted)})"):
                    folders[file] = convert_one(file, cache, replace(options, cell_size=size))
                if size is None:
                    size = stored.load_folder(folders[file]).cell_size
            except stored.CacheError:
                raise
            except InputError as error:
                errors[file] = error
            meter.update(1)
    if left:
        left = largest_first(left)
        work = partial(_converted, cache=cache, options=replace(options, cell_size=size))
        with closing(run_tasks(work, left, workers, label="converting files", unit="file", name=_name)) as made:
            for file, found in zip(left, made, strict=True):
                if isinstance(found, InputError):
                    errors[file] = found
                else:
                    folders[file] = found
    return folders, size, errors


def _name(file: Path) -> str:
    return file.name


def _converted(file: Path, *, cache: Path, options: PlaceOptions) -> Path | InputError:
    """In a worker: the folder of the grid of a file, or why it cannot be read.  Raises CacheError."""
    try:
        return convert_one(file, cache, options)
    except stored.CacheError:
        raise
    except InputError as error:
        return error


def missing_grids(files: Sequence[Path], *, match: bool = True, columns: str | None = None, moves: "Moves | None" = None
                  ) -> list[Path]:
    """The files that would be converted.  match, columns, moves: as for open_place."""
    asked = kept_place.asked_of(files, match, columns, moves)
    if asked is not None and kept_place.is_current(asked):
        return []
    known = known_grids(files, cache_dir(), PlaceOptions(match, columns, tuple((moves or {}).items())))
    size = known.common_size()
    return [file for file in files if size not in known.folders[file]]


def _opened(folder: Path, file: Path, cache: Path, options: PlaceOptions) -> Scene:
    scene = stored.load(folder, [file], late=True)
    if scene is None:  # damaged: what cannot be used is built anew
        scene = stored.load(convert_one(file, cache, options), [file], late=True)
    if scene is None:
        raise InputError("its grid cannot be read again", file=file, remedy="open the scan again")
    return scene
