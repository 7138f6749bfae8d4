"""``pointglass convert``: writes the grid of scans into a folder, which can then be opened like a scan."""

import logging
import os
from contextlib import closing
from functools import partial
from pathlib import Path

from ...model.common.files.folders import made_folder
from ..common.errors import InputError
from ..common.file_names import inside
from ..common.text import counted
from ..common.workers.run_tasks import run_tasks
from ..common.workers.worker_choice import Workers
from ..grid import cache
from ..grid.build_scene import build_scene
from ..grid.open_scene import as_paths, each_once, present, say_degrees
from ..grid.place.own_processes import largest_first, own_processes
from ..grid.scene import Scene
from ..preprocess.scan_description import ScanWarning, WarningTopic
from ..readers.grid_folder import is_grid

_log = logging.getLogger(__name__)
_NAMED = 8  # scans that could not be read and are named besides the first: nine paths of 100 characters fill ten rows of 24


def convert(paths: list[Path], out: Path, *, match: bool = True, columns: str | None = None,
            workers: Workers | None = None) -> Scene:  # fmt: skip
    """Builds the grid of ``paths`` into the folder ``out`` and opens it from there.  match, columns: as for open_scene.
    workers: who decodes several files (viewer.grid.building.decoded_files); None: this process.

    An earlier grid in ``out`` is replaced once the new one is complete.  Where ``out`` is a link, the folder it leads to is
    replaced.  Raises InputError where ``out`` holds anything else, cannot be replaced or written or has no room, and for bad
    input; nothing partial is left behind.
    """
    files, out = as_paths(paths), Path(out)
    files, left_out = present(files)
    for error in left_out:
        _log.warning("%s", ScanWarning(str(error), WarningTopic.LEFT_OUT))
    place = _place_of(out)
    with made_folder(place, make=False):
        scene = cache.build_into(place, files, partial(build_scene, match=match, columns=columns, workers=workers),
                                 keep_old=True)
    say_degrees(scene)
    return scene


def _place_of(out: Path) -> Path:
    """The folder that ``--out`` leads to, links followed.  Raises InputError where it cannot be replaced by a grid."""
    place = Path(os.path.realpath(out))  # a rename would replace the link, not the folder
    if place.is_symlink():
        raise InputError("is a link that leads back to itself", file=out, remedy="give --out a folder that is not there yet")
    if place.exists() and not place.is_dir():
        raise InputError("is a file", file=out, remedy="give a new or empty folder to --out")
    here = Path(os.path.realpath(os.curdir))
    if place == here or place in here.parents:
        raise InputError("is the folder this runs in, or holds it", file=out,
                         remedy="give --out a folder that is not there yet")
    if os.path.ismount(place):
        raise InputError("a disk is mounted there", file=out, remedy="give --out a folder inside it that is not there yet")
    if place.is_dir() and (name := cache.foreign_file(place)):
        raise InputError(f"holds other files ({name})", file=out, remedy="give a new or empty folder to --out")
    return place


def scans_in(paths: list[Path]) -> list[Path]:
    """The given files, and of each folder the scans directly inside it, by name.  Raises InputError where it holds none."""
    from ..readers.formats import KNOWN, entry_of, is_scan

    found: list[Path] = []
    for path in as_paths(paths):
        own = path.is_dir() and not is_grid(path)  # a grid is refused where it is read
        inside = sorted(entry_of(file) for file in path.iterdir() if is_scan(file)) if own else [path]
        if not inside:
            raise InputError("holds no scan", file=path,
                             remedy=f"name its .txt, .csv and .asc files one by one, or give an {KNOWN}")
        found += inside
    return each_once(found)


def convert_each(
    paths: list[Path], out: Path, *, shard: tuple[int, int] = (0, 1), match: bool = True, columns: str | None = None,
    workers: Workers | None = None,
) -> list[Path]:
    """Builds the grid of each scan into ``out/NAME``; returns the folders, including those built earlier.

    paths: files, or folders of scans.  shard: (i, n), only every n-th scan from the i-th on, so that n processes or machines
    share the work without communicating.  workers: who converts, each one scan at a time; None: as many processes as this
    machine has room for (viewer.grid.place.own_processes).  If a scan cannot be read, the others are still converted; then
    InputError is raised at the end, which names all such scans and the error of the first.  Raises it at once where two scans
    would have the same name.
    """
    from ..readers.formats import name_of

    files = scans_in(paths)
    names: dict[str, Path] = {}
    for file in files:
        name = name_of(file)
        if name in names:
            raise InputError(f"{names[name]} would have the same folder, {out / name}", file=file,
                             remedy="convert them separately")
        names[name] = file
    made: list[Path] = []
    wrong: dict[str, str] = {}
    tasks = [(file, inside(out, name)) for name, file in list(names.items())[shard[0] :: shard[1]]]
    if workers is None:
        workers = own_processes([file for file, folder in tasks if not folder.is_dir()])
    if workers is not None:
        size = {file: number for number, file in enumerate(largest_first([file for file, _ in tasks]))}
        tasks.sort(key=lambda task: size[task[0]])
    work = partial(_convert_kept, match=match, columns=columns)
    with closing(run_tasks(work, tasks, workers, label="converting", unit="scan", name=lambda task: task[0].name)
                 if workers is not None else (work(task) for task in tasks)) as results:
        for (file, folder), error in zip(tasks, results, strict=True):
            if error is None:
                made.append(folder)
            else:
                wrong[file.name] = error
    if wrong:
        first, *others = wrong
        more = f" (and {', '.join(others[:_NAMED])}{', ...' if len(others) > _NAMED else ''})" if others else ""
        where = "" if shard == (0, 1) else " of this shard"
        raise InputError(f"{wrong[first]}{more}; {counted(len(made), 'grid')}{where} in {out}")
    return made


def _convert_kept(task: tuple[Path, Path], *, match: bool, columns: str | None) -> str | None:
    """Builds the grid of a scan into a folder, unless it is there; returns why that is impossible, else None."""
    file, folder = task
    try:
        kept = cache.load(folder, [file])
        if kept is None or kept.meta.match != match:
            convert([file], folder, match=match, columns=columns)
    except InputError as error:
        return str(error)
    return None
