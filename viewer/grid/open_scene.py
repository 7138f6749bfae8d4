"""Opening scans: cache first, else read, build and keep.  The two ways a Scene comes to be.

Frame: file coordinates throughout; several files are taken to share one frame.
"""

import os
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import InputError
from viewer.grid.scene import Scene

if TYPE_CHECKING:
    from viewer.readers.source import Source

_IN_MEMORY = 32_000_000  # points; larger scans are built in a file


def open_scene(
    paths: Sequence[Path | str] | Path | str, *, cache: bool = True, match: bool = True, columns: str | None = None
) -> Scene:
    """One scene from one or several scan files, or from a folder made by ``convert``.

    cache: keep the built grid in ``viewer.paths.cache_dir()`` and use one kept earlier.
    match: give scans of one place the same exposure (see viewer.preprocess.exposure_matching), and take black that is no colour
    for none; a folder is as it was built, and refused where colours as scanned are asked for and it has others.
    columns: what the columns of text files are (viewer.readers.text_columns); None: as they are recognised.
    Raises InputError, one line, for anything wrong with the files or the cache folder; Cancelled if progress says so.
    """
    from viewer.grid import cache as store

    files = as_paths(paths)
    if len(files) == 1 and files[0].is_dir():
        scene = store.load_folder(files[0])
        if not match and scene.matched:
            raise InputError(f"{files[0]}: was built with matched exposures, colours as scanned are not in it; "
                             "give the scan itself, or convert it again with --exposures as-scanned")
        return scene
    from viewer.readers.formats import check_file

    for file in files:
        check_file(file)
    if not cache:
        return build_scene(files, in_memory, match=match, columns=columns)
    folder = store.folder_of(files, match, columns)
    if (scene := store.load(folder, files)) is not None:
        return scene
    return store.build_into(folder, files, partial(build_scene, match=match, columns=columns), keep_old=False)


def build_scene(files: list[Path], allocate, *, match: bool = True, columns: str | None = None) -> Scene:
    """Reads the files and builds their grid; ``allocate`` gives room for the packed points (see grid.Allocate)."""
    from viewer.grid.two_passes import build_grid
    from viewer.preprocess.point_colour import Colours
    from viewer.readers.formats import open_sources

    sources = open_sources(files, columns)
    meta = facts_of(files, sources) | {"match": match, "warnings": []}
    units = {source.metres_per_unit for source in sources}
    if len(units - {None}) > 1:
        meta["warnings"].append("the files differ in their units of length; they are shown as if they agreed")
    elif len(units) > 1:
        meta["warnings"].append("not all of the files tell their unit of length; they are shown as if it were the same")
    elif len({source.crs for source in sources}) > 1:
        meta["warnings"].append(
            "the files differ in their coordinate reference system; they are shown as if they agreed"
        )
    scene = build_grid(sources, colours=Colours(sources, match=match), allocate=allocate, meta=meta)
    meta["warnings"][:0] = [warning for source in sources for warning in source.warnings]
    return scene


def facts_of(files: Sequence[Path], sources: "Sequence[Source]") -> dict:
    """What the readers say of the files, for ``Scene.meta``."""
    return {
        "sources": [str(file.absolute()) for file in files],
        "format": ", ".join(dict.fromkeys(source.format for source in sources)),
        "units": _common([source.units for source in sources], "mixed"),
        "metres_per_unit": _common([source.metres_per_unit for source in sources], None),
        "crs": _common([source.crs for source in sources], "mixed"),
    }


def scene_from_arrays(
    xyz: np.ndarray,
    rgb: np.ndarray,
    *,
    intensity: np.ndarray | None = None,
    scan: np.ndarray | None = None,
    meta: dict | None = None,
    stages: dict[str, float] | None = None,
    noise: bool = True,
) -> Scene:
    """A scene in memory from points in memory.

    xyz: (N, 3) float64, any frame.  rgb: (N, 3) uint8.  intensity: (N,) uint16.  scan: (N,) uint8.  meta: copied
    over what is known.  stages: if given, receives the seconds each stage took.  noise: estimate the noise of the colours.
    Points that are not finite are left out.  Raises InputError naming the first array that does not fit.
    """
    from viewer.grid.two_passes import build_grid
    from viewer.readers.arrays import ArraySource

    source = ArraySource(xyz, rgb, intensity, scan)
    known = {
        "sources": [], "format": "arrays", "units": "unknown", "metres_per_unit": None, "crs": None,
        "colour": {"source": "rgb", "bits": 8, "note": "8-bit colour"}, "warnings": [],
    } | (meta or {})  # fmt: skip
    known["warnings"] = list(known["warnings"])
    return build_grid([source], colours=None, allocate=in_memory, meta=known, stages=stages, noise=noise)


def in_memory(count: int) -> np.ndarray:
    """Room for packed points that vanishes with the scene: memory, or for large scans a nameless file."""
    if count <= _IN_MEMORY:
        return np.empty((count, 3), np.uint32)
    import tempfile

    from viewer.grid.scratch_folder import reserve

    try:
        with tempfile.TemporaryFile(prefix="pointglass-") as file:
            reserve(file.fileno(), count * 12, Path(tempfile.gettempdir()))
            return np.memmap(file, np.uint32, "r+", shape=(count, 3))
    except OSError as error:
        raise InputError(
            f"{tempfile.gettempdir()}: no room for {count * 12 / 1e9:.1f} GB of points ({error.strerror}); "
            "set TMPDIR to a folder with more space"
        ) from None


def as_paths(paths: Sequence[Path | str] | Path | str) -> list[Path]:
    """The given path or paths as a list, each once, however it is spelt.  Raises InputError where there is none."""
    given = [paths] if isinstance(paths, (str, Path)) else list(paths)
    if not given:
        raise InputError("no scan given; name at least one file")
    from viewer.readers.formats import entry_of

    return each_once(entry_of(Path(path)) for path in given)


def each_once(paths: Iterable[Path]) -> list[Path]:
    """The paths without those that lead to the same file or folder as one before."""
    places: dict[str, Path] = {}
    for path in paths:
        places.setdefault(os.path.realpath(path), path)
    return list(places.values())


def _common(values: list, otherwise):
    return values[0] if len(set(values)) == 1 else otherwise
