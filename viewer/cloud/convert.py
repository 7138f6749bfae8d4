"""``pointglass convert``: the grid of some scans in a folder of one's own, to be opened like a scan."""

from functools import partial
from pathlib import Path

from viewer.cloud import cache
from viewer.cloud.build import as_paths, build_scene
from viewer.cloud.scene import Scene
from viewer.errors import InputError


def convert(paths: list[Path], out: Path, *, match: bool = True) -> Scene:
    """Builds the grid of ``paths`` into the folder ``out`` and opens it from there.  match: scans to the same exposure.

    An earlier grid in ``out`` is replaced once the new one is whole.  Raises InputError where ``out`` holds anything
    else, cannot be written or has no room, and for bad input; nothing partial is left behind.
    """
    from viewer.cloud.source import check_file

    files, out = as_paths(paths), Path(out)
    for file in files:
        check_file(file)
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give a new or empty folder to --out")
    if out.is_dir() and not cache.is_grid(out) and any(out.iterdir()):
        raise InputError(f"{out}: holds other files; give a new or empty folder to --out")
    return cache.build_into(out.absolute(), files, partial(build_scene, match=match), keep_old=True)
