"""The meta.json of a grid on disk: parsed into typed fields, each checked, before any array is used.

Only what the file says can make a grid "damaged": conversions of its values are the only code whose TypeError or ValueError is
read as damage.  An error anywhere else in reading a grid is a bug and keeps its traceback.
"""

import json
import os
import stat
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...model.appearance.noise import KNOTS
from ..common.errors import InputError
from ..preprocess.scan_description import ScanDescription, described_scan
from ..readers.grid_folder import MAGIC, META
from .density_layers import EARLIER_PARTS, PARTS

VERSION = 4
"""Of the folder's format."""
LARGEST = 1e100
"""Numbers of this size and beyond are damage: no coordinate is near it, and its square is finite."""
_CONVERSION_ERRORS = (KeyError, TypeError, ValueError, OverflowError, AttributeError, RecursionError, InputError)


class DamagedGrid(Exception):
    """A folder does not hold a complete grid whose parts fit together; the text names the part and what is wrong with it."""


class OtherGrid(DamagedGrid):
    """The grid was made by another version of the format, or from other files."""


@dataclass(frozen=True, eq=False)
class NoiseHeader:
    """As in model.appearance.noise.NoiseModel, without the array of standard deviations."""

    origin: np.ndarray
    voxel: float
    curve: np.ndarray
    overall: float
    neighbourhoods: int


@dataclass(frozen=True, eq=False)
class GridHeader:
    """shapes: of each array.  sums: CRC-32 of each array except the points; None in folders of earlier versions, which have
    none.  noise: None where none was stored.  first, scan_first: as ``first`` and ``scans`` in
    viewer.grid.records.point_records, None where they are not stored.  Others as in Scene."""

    shapes: dict[str, tuple[int, ...]]
    sums: dict[str, int] | None
    origin: np.ndarray
    cell_size: float
    layers: int
    count: int
    spacing: float
    bounds: np.ndarray
    parts: int
    meta: ScanDescription
    noise: NoiseHeader | None
    first: np.ndarray | None
    scan_first: np.ndarray | None
    head_checksums: tuple[int, ...] | None = None


def read_header(folder: Path, identity: list | None) -> GridHeader:
    """The header of the grid in ``folder``.  identity: of the files that it must have been made from; None: of any.

    Raises OtherGrid where version or files differ, DamagedGrid where the file is missing or damaged.
    """
    head = _checked(folder, last=True)
    if identity is not None and head.get("identity") != identity:
        raise OtherGrid("made from other files")
    try:
        with np.errstate(over="ignore"):  # infinite numbers are refused below
            header = _parsed(head)
    except _CONVERSION_ERRORS as error:
        raise DamagedGrid(f"{META}: {first_line(error)}") from None
    numbers = [header.cell_size, header.spacing, *header.origin.reshape(-1), *header.bounds.reshape(-1)]
    shaped = header.origin.shape == (3,) and header.bounds.shape == (2, 3)
    if not (shaped and _usable(numbers) and min(numbers[:2]) > 0):
        raise DamagedGrid("its numbers are not usable")
    if header.parts not in (1, EARLIER_PARTS, PARTS):
        raise DamagedGrid(f"its points lie in {header.parts} parts")
    if (first := header.first) is not None and (first.ndim != 1 or len(first) < 2 or first[0] or (np.diff(first) < 0).any()):
        raise DamagedGrid("the first record numbers of its files are not usable")
    if (starts := header.scan_first) is not None and (starts.ndim != 1 or (np.diff(starts) < 0).any()):
        raise DamagedGrid("the first record numbers of its scans are not usable")
    if (noise := header.noise) is not None:
        numbers = np.concatenate([noise.origin.reshape(-1), noise.curve.reshape(-1), [noise.voxel, noise.overall]])
        fits = noise.origin.shape == (3,) and noise.curve.shape == (KNOTS,) and _usable(numbers)
        if not (fits and numbers[3:].min() >= 0 and noise.voxel > 0):
            raise DamagedGrid("its noise is not usable")
    return header


def cell_size_of(folder: Path) -> float:
    """The size of the cells of the grid in ``folder``, without the rest of the header, which takes most of the time.

    Raises OtherGrid where the version differs, DamagedGrid where the file is missing or damaged.
    """
    try:
        size = float(_checked(folder)["cell_size"])
    except _CONVERSION_ERRORS as error:
        raise DamagedGrid(f"{META}: {first_line(error)}") from None
    if not 0 < size < LARGEST:
        raise DamagedGrid("its numbers are not usable")
    return size


_SEEN_MOST = 10_000
_seen: dict[Path, tuple[tuple[int, int, int], dict[str, Any]]] = {}
"""Headers that were checked and not used yet, at most _SEEN_MOST, with what tells one state of their file from another: a place
of a thousand grids asks for the sizes of cells twice before it opens them, 0.1 s each time."""


def _checked(folder: Path, *, last: bool = False) -> dict[str, Any]:
    """The contents of meta.json, checked.  last: they are not kept for another call."""
    try:
        found = os.stat(folder / META)
    except (OSError, ValueError):
        raise DamagedGrid(f"{META} is no file") from None
    if not stat.S_ISREG(found.st_mode):  # opening a pipe would block
        raise DamagedGrid(f"{META} is no file")
    state, (before, head) = (found.st_mtime_ns, found.st_size, found.st_ino), _seen.pop(folder, (None, {}))
    if before != state:
        head = _read_and_checked(folder)
    if not last and len(_seen) < _SEEN_MOST:
        _seen[folder] = state, head
    return head


def _read_and_checked(folder: Path) -> dict[str, Any]:
    head = _object_in(folder / META)
    if head.get("magic") != MAGIC or head.get("version") != VERSION:
        raise OtherGrid(f"version {head.get('version')!r} where {VERSION} is expected")
    if head.pop("sum", None) not in (None, checksum_of(head)):  # earlier versions stored none
        raise DamagedGrid(f"{META} does not match its checksum")
    return head


def _usable(numbers) -> bool:
    """Whether numbers are finite and leave room: what is made of two of them is finite, too."""
    return bool((np.abs(numbers) < LARGEST).all())


def checksum_of(head: dict) -> int:
    """CRC-32 of the contents of meta.json, independent of its white space."""
    return zlib.crc32(json.dumps(head).encode())


def first_line(error: Exception) -> str:
    """The first line of an error's text, or its class where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0][:120]


def _object_in(path: Path) -> dict[str, Any]:
    try:
        head = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DamagedGrid(f"{path.name}: {first_line(error)}") from None
    if not isinstance(head, dict):
        raise DamagedGrid(f"{path.name}: holds no JSON object")
    return head


def _parsed(head: dict[str, Any]) -> GridHeader:
    """Conversions only: raises _CONVERSION_ERRORS where a value is missing or of the wrong kind."""
    noise, sums = head.get("noise"), head.get("sums")
    meta = described_scan(head["meta"])
    return GridHeader(
        shapes={str(name): tuple(int(side) for side in shape) for name, shape in head["shapes"].items()},
        sums=None if sums is None else {str(name): int(value) for name, value in sums.items()},
        origin=np.array(head["origin"], np.float64),
        cell_size=float(head["cell_size"]),
        layers=int(head["layers"]),
        count=int(head["count"]),
        spacing=float(head["spacing"]),
        bounds=np.array(head["bounds"], np.float64),
        parts=int(head.get("parts", EARLIER_PARTS if head.get("spread") else 1)),
        meta=meta,
        noise=None if noise is None else NoiseHeader(
            np.array(noise["origin"], np.float64), float(noise["voxel"]), np.array(noise["curve"], np.float32),
            float(noise["overall"]), int(noise["neighbourhoods"]),
        ),
        first=_numbers(meta.records and meta.records.first),
        scan_first=_numbers(meta.records and meta.records.scan_first),
        head_checksums=tuple(map(int, head["head_checksums"])) if "head_checksums" in head else None,
    )  # fmt: skip


def _numbers(values: tuple[int, ...] | None) -> np.ndarray | None:
    return None if values is None else np.array(values, np.int64)
