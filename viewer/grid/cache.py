"""Built grids on disk: a folder of plain .npy files and a meta.json, memory-mapped when opened.

Atomic write: a grid is written into a sibling folder, which is then renamed.  A torn, stale or foreign folder is never read: in
the cache the grid is built again, and the log says why; a folder that a person named is refused.  The checksums of the points
are checked chunk by chunk as they are read (viewer.stream.chunk_source); the other arrays, tens of bytes per cell, are read and
checked on opening.
"""

import errno
import hashlib
import json
import logging
import os
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...model.appearance.noise import MAX_VOXELS, NoiseModel
from ...model.common.files.temporary import restrict
from ..common.errors import InputError, Option, Words
from ..common.paths import cache_dir
from ..common.progress import progress, stage
from ..picture.json_values import to_json
from ..readers.formats import KNOWN
from ..readers.grid_folder import MAGIC, is_grid
from ..readers.grid_folder import META as _META
from ..readers.moved_source import Moves, moves_of_files
from .building.grid_threads import processors
from .checksum import checksum, head_checksums
from .column_files import ColumnFiles
from .grid_header import VERSION, DamagedGrid, GridHeader, NoiseHeader, OtherGrid, checksum_of, read_header
from .npy_column import NpyColumn, loaded
from .records.point_records import PointRecords, identity_of, sum_of
from .scene import CHUNK, Scene
from .scratch_folder import move, scratch

# Versions of: the decision on colours, the order of points and the measure of their spacing, the estimate of noise, the packing
# of attributes, the running numbers of points.  They are part of the cache key: a change rebuilds cached grids.  Folders made
# by convert stay as they are.
COLOURS, ORDER, NOISE, ATTRIBUTES, RECORDS = 3, 5, 2, 2, 1
_ARRAYS = {"points": np.dtype("<u4"), "cell_coords": np.dtype("<i4"), "offsets": np.dtype("<i8"), "checksums": np.dtype("<u4"),
           "faces": np.dtype("u1"), "boxes": np.dtype("u1"), "noise": np.dtype("<f4"),
           "records": np.dtype("<u4"), "records_high": np.dtype("u1"), "record_sums": np.dtype("<u4")}
_COLUMNS = ("points", "records", "records_high")  # with a row for each point: read, and checked, where they are needed
_log = logging.getLogger(__name__)
_CLUTTER = {".DS_Store", "Thumbs.db", "desktop.ini"}
"""Files that file managers leave in folders, which may be deleted with the folder."""
_LATER = {"faces": 3, "boxes": 6}  # columns of arrays with a row per cell, which folders of earlier versions do not have
_OPTIONAL = {*_LATER, "noise", "records", "records_high", "record_sums"}
_CACHE_REMEDY = ("free space or set POINTGLASS_CACHE to a writable folder (view, render and info also take ",
                 Option("--no-cache"), ")")
_OUT_REMEDY = ("free space or give ", Option("--out"), " a writable folder")
_JOB = 16  # chunks whose checksums a thread computes at a time: 12 MiB, 9 ms; handing it over takes 0.04 ms, measured


class CacheError(InputError):
    """The cache folder cannot be used; the scan itself may be fine."""


def folder_of(files: list[Path], match: bool = True, columns: str | None = None, moves: Moves | None = None,
              layers: int | None = None) -> Path:
    """The cache folder for the grid of these files; another folder once a file has changed, or been moved otherwise.  match,
    columns, moves: as for viewer.grid.open_scene.  layers: of a grid that is part of a place; None: it is a scene by itself."""
    versions, moved = [VERSION, COLOURS, ORDER, NOISE, ATTRIBUTES, RECORDS], moves_of_files(files, moves)
    more = [*([columns] if columns else []), *([{"moves": moved}] if moved else []), *([{"layers": layers}] if layers else [])]
    key = json.dumps([*versions, _identity(files), match, *more]).encode()
    return cache_dir() / hashlib.sha256(key).hexdigest()[:32]


def _identity(files: list[Path]) -> list:
    return [list(identity_of(file)) for file in files]  # as JSON has it


def load_or_build(files: list[Path], build: Callable[..., Scene], *, match: bool, columns: str | None,
                  moves: Moves | None = None) -> Scene:
    """The grid of ``files`` from the cache, where it is built first if it is not there.  build, match, columns, moves: as for
    build_into and folder_of.  Raises CacheError where the cache cannot be written."""
    folder = folder_of(files, match, columns, moves)
    scene = load(folder, files)
    return build_into(folder, files, build, keep_old=False) if scene is None else scene


def load(folder: Path, files: list[Path], *, late: bool = False) -> Scene | None:
    """The grid of ``files`` stored in ``folder``; None where there is no usable one, for which the log has the reason.
    late: nothing of it stays open (viewer.grid.npy_column.NpyColumn): it is one of many."""
    if not folder.exists():
        return None
    try:
        return _read(folder, _identity(files), late)
    except OtherGrid as error:
        _log.info("%s: not used (%s); the grid is built again", folder, error)
    except DamagedGrid as error:
        _log.warning("%s: damaged grid (%s); it is built again", folder, error)
    return None


def foreign_file(folder: Path) -> str | None:
    """The name of a file in ``folder`` that does not belong to a grid; None where a grid may replace the folder."""
    names = sorted(path.name for path in folder.iterdir())
    ours = {_META, *(f"{name}.npy" for name in _ARRAYS)} if is_grid(folder) else set()
    return next((name for name in names if name not in ours | _CLUTTER), None)


def load_folder(folder: Path, *, late: bool = False) -> Scene:
    """The grid in a folder made by ``convert``.  late: as for :func:`load`.  Raises InputError where the folder is another, or
    damaged."""
    if not is_grid(folder):
        raise InputError("is a folder, but not one made by convert", file=folder, remedy=f"give an {KNOWN}")
    try:
        return _read(folder, None, late)
    except DamagedGrid as error:
        raise InputError(f"damaged grid ({error})", file=folder, remedy="convert the scan again") from None


def _read(folder: Path, identity: list | None, late: bool = False) -> Scene:
    """The grid in a folder.  identity: of the files that it must have been made from, None for any.  Raises DamagedGrid."""
    header = read_header(folder, identity)
    beside = os.path.join(folder, "")  # paths put together by pathlib took a tenth of the time of a thousand grids
    arrays: dict[str, Any] = {}
    for name, dtype in _ARRAYS.items():
        if name in _OPTIONAL and name not in header.shapes:
            continue
        path = f"{beside}{name}.npy"
        array: Any = NpyColumn(path, late=late) if name in _COLUMNS else loaded(path)
        if array.dtype != dtype or array.shape != header.shapes.get(name):
            raise DamagedGrid(f"{name}.npy is not what meta.json says")
        # in memory, so that what was checked is used even if the file changes
        if name not in _COLUMNS and header.sums is not None and zlib.crc32(array.data) != header.sums.get(name):
            raise DamagedGrid(f"{name}.npy does not match its checksum")
        arrays[name] = array
    points, cells, offsets = arrays["points"], arrays["cell_coords"], arrays["offsets"]
    layers, count = header.layers, header.count
    fits = points.shape == (count, 3) and cells.shape[1:] == (3,) and offsets.shape == (layers * len(cells) + 1,)
    fits = fits and arrays["checksums"].shape == (-(-count // CHUNK),)
    later = {name: arrays[name] for name in _LATER if name in arrays}
    fits = fits and all(array.shape == (len(cells), _LATER[name]) for name, array in later.items())
    if not (fits and offsets[0] == 0 and offsets[-1] == count and (np.diff(offsets) >= 0).all()):
        raise DamagedGrid("its arrays do not fit together")
    return Scene(
        points, cells, offsets, header.origin, header.cell_size, layers, count, header.spacing, header.bounds, header.meta,
        arrays["checksums"], header.parts, noise=_noise(header.noise, arrays.get("noise")),
        records=_records(folder, header, arrays), head_checksums=header.head_checksums, **later,
    )  # fmt: skip


def _records(folder: Path, header: GridHeader, arrays: dict[str, np.ndarray]) -> PointRecords | None:
    """The running numbers of the points; None where an earlier version stored none.  Raises DamagedGrid."""
    if "records" not in arrays and "record_sums" not in arrays:
        return None
    low, high, sums = (arrays.get(name) for name in ("records", "records_high", "record_sums"))
    fits = low is not None and low.shape == (header.count,) and (high is None or high.shape == low.shape)
    if low is None or sums is None or not fits or sums.shape != arrays["checksums"].shape or header.first is None:
        raise DamagedGrid("its record numbers do not fit its points")
    if len(header.first) == 0 or header.first[-1] < header.count:  # each point has a number of its own
        raise DamagedGrid("its files have fewer records than it has points")
    return PointRecords(low, high, header.first, header.scan_first, sums, str(folder))


def _noise(header: NoiseHeader | None, sigma: np.ndarray | None) -> NoiseModel | None:
    """The noise stored with the points; None where an earlier version stored none.  Raises DamagedGrid."""
    if sigma is None:
        return None
    if header is None or sigma.ndim != 3 or min(sigma.shape) == 0 or max(sigma.shape) > MAX_VOXELS:
        raise DamagedGrid("its noise is not usable")
    if not np.isfinite(sigma).all() or sigma.min() < 0:
        raise DamagedGrid("its noise is not usable")
    return NoiseModel(header.origin, header.voxel, sigma, header.curve, header.overall, header.neighbourhoods)


def mark_damaged(folder: Path) -> str:
    """Called where the points of a grid are damaged: marks a grid in the cache so that it is not used again.  Returns the
    remedy for the error message."""
    if folder.parent.absolute() != cache_dir().absolute():
        return "convert the scan again"
    try:
        (folder / _META).unlink(missing_ok=True)
        _log.warning("%s: damaged points; the grid is built again when the scan is opened", folder)
    except OSError:
        return f"delete {folder} and open the scan again"
    return "open the scan again, which builds it anew"


def build_into(folder: Path, files: list[Path], build: Callable[..., Scene], *, keep_old: bool) -> Scene:
    """Builds the grid of ``files`` into ``folder`` and opens it from there.

    build: called with the files, a function that gives the array of n packed points
    (viewer.grid.building.two_passes.Allocate), and ``folder`` for temporary files.  keep_old: refuse to replace a folder that
    holds anything else than a grid.
    Raises CacheError where the folder cannot be written.  Nothing is left behind on failure or cancellation.
    """
    identity = _identity(files)
    with _written(folder, _OUT_REMEDY if keep_old else _CACHE_REMEDY, files) as work:
        columns = ColumnFiles(work, _ARRAYS)
        scene = build(files, columns.allocate, folder=work)
        _write(work, scene, identity)
        if identity != _identity(files):
            raise InputError("changed while it was read", file=files[0], remedy="try again")
        with stage("writing the grid"):
            del scene
            columns.write()
        restrict(work, files)
        if keep_old and folder.exists() and (name := foreign_file(folder)):
            raise InputError(f"holds other files ({name})", file=folder, remedy="give a new or empty folder")
        move(work, folder)
    return _read(folder, identity)


def _columns_of(scene: Scene) -> dict[str, np.ndarray]:
    """The columns of a scene that have a row for each point, by name."""
    found = {"points": scene.points}
    if scene.records is not None:
        found["records"] = scene.records.low
        if scene.records.high is not None:
            found["records_high"] = scene.records.high
    return found


def _write(work: Path, scene: Scene, identity: list) -> None:
    known = {name: getattr(scene, name) for name in _LATER if getattr(scene, name) is not None}
    if scene.noise is not None:
        known["noise"] = scene.noise.sigma
    sums, record_sums = checksums(scene.points, scene.records)
    known |= {"cell_coords": scene.cell_coords, "offsets": scene.offsets, "checksums": sums}
    known |= {} if record_sums is None else {"record_sums": record_sums}
    arrays = {name: np.ascontiguousarray(array, _ARRAYS[name]) for name, array in known.items()}
    for name, array in arrays.items():
        np.save(work / f"{name}.npy", array, allow_pickle=False)
    head = {
        "magic": MAGIC,
        "version": VERSION,
        "identity": identity,
        "shapes": {name: list(array.shape) for name, array in {**_columns_of(scene), **arrays}.items()},
        "sums": {name: zlib.crc32(array.data) for name, array in arrays.items()},
        "origin": scene.origin.tolist(),
        "cell_size": float(scene.cell_size),
        "layers": scene.layers,
        "count": scene.count,
        "spacing": float(scene.spacing),
        "bounds": scene.bounds.tolist(),
        "parts": scene.parts,
        "head_checksums": head_checksums(scene.points, scene.offsets, scene.layers),
        "meta": to_json(scene.meta),
    }
    if (noise := scene.noise) is not None:
        head["noise"] = {
            "origin": noise.origin.tolist(), "voxel": noise.voxel, "curve": noise.curve.tolist(), "overall": noise.overall,
            "neighbourhoods": noise.neighbourhoods,
        }  # fmt: skip
    head["sum"] = checksum_of(head)
    (work / _META).write_text(json.dumps(head, indent=1, allow_nan=False), "utf-8")


def checksums(points: np.ndarray, records: PointRecords | None = None) -> tuple[np.ndarray, np.ndarray | None]:
    """(ceil(N / CHUNK),) uint32: the checksum of each chunk of points (N, 3) uint32, and of their running numbers, computed on
    all processors."""
    sums = np.zeros(-(-len(points) // CHUNK), np.uint32)
    of_records = None if records is None else np.zeros_like(sums)

    def run(start: int) -> int:
        stop = min(start + _JOB, len(sums))
        for chunk in range(start, stop):
            sums[chunk] = checksum(points[chunk * CHUNK : (chunk + 1) * CHUNK])
            if records is not None and of_records is not None:
                of_records[chunk] = sum_of(records.low, records.high, chunk)
        return stop - start

    pool = ThreadPoolExecutor(processors(), "checksum")
    try:
        with progress(len(sums), "checking the grid", " chunks") as meter:
            for done in pool.map(run, range(0, len(sums), _JOB)):
                meter.update(done)
    finally:
        pool.shutdown(cancel_futures=True)
    return sums, of_records


@contextmanager
def _written(folder: Path, remedy: Words, files: list[Path]) -> Iterator[Path]:
    """A new folder beside ``folder``, removed at the end in any case; failures to write become CacheError.  files: scans whose
    rights it has."""
    try:
        with scratch(folder, sources=files, private=remedy is _CACHE_REMEDY) as work:
            yield work
    except OSError as error:
        why = error.strerror or str(error)
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            why = "no space left" + why.removeprefix(os.strerror(error.errno)).removeprefix("no space left")
        raise CacheError(f"cannot be written ({why})", file=folder.parent, remedy=remedy) from None
