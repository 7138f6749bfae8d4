"""Opens files as a place: each file's grid from the cache, or converted; then joined."""

import logging
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.errors import InputError
from ...common.paths import cache_dir
from ...common.progress import named_progress, progress
from ...common.workers.run_tasks import run_tasks
from .. import cache as stored
from ..scene import Scene
from .convert_files import PlaceOptions, convert_one, known_grids, largest, refuse_none
from .measured_place import scene_of_grids
from .own_processes import largest_first, own_processes

if TYPE_CHECKING:
    from ...common.workers.worker_choice import Workers
    from ...readers.moved_source import Moves

_log = logging.getLogger(__name__)


def open_place(files: Sequence[Path], *, match: bool = True, columns: str | None = None, moves: "Moves | None" = None,
               workers: "Workers | None" = None) -> tuple[Scene, list[InputError]]:
    """One scene of ``files``, and why each of those that are not in it could not be read.

    match, columns, moves, workers: as for viewer.grid.open_scene.  Files whose grid is in the cache are not read.  Raises
    InputError where none can be read or the cache cannot be written; Cancelled where progress is cancelled: grids that are
    complete stay.
    Without ``workers`` as many processes convert as this machine has room for (viewer.grid.place.own_processes).
    """
    cache = cache_dir()
    options = PlaceOptions(match, columns, tuple((moves or {}).items()))
    known = known_grids(files, cache, options)
    size = known.common_size()
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
    refuse_none(files, list(errors.values()))
    opened = [file for file in files if file in folders]
    scenes = [_opened(folders[file], file, cache, replace(options, cell_size=size)) for file in opened]
    return scene_of_grids(scenes, [folders[file] for file in opened], match=match), [errors[f] for f in files if f in errors]


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
    known = known_grids(files, cache_dir(), PlaceOptions(match, columns, tuple((moves or {}).items())))
    size = known.common_size()
    return [file for file in files if size not in known.folders[file]]


def _opened(folder: Path, file: Path, cache: Path, options: PlaceOptions) -> Scene:
    scene = stored.load(folder, [file])
    if scene is None:  # damaged: what cannot be used is built anew
        scene = stored.load(convert_one(file, cache, options), [file])
    if scene is None:
        raise InputError("its grid cannot be read again", file=file, remedy="open the scan again")
    return scene
