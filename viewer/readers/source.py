"""What every reader offers: facts about a scan file, and its points in chunks, as often as asked.

Coordinates are float64 in the file's own frame and units.  A reader never holds more than one chunk.  It leaves out
points the file itself marks as invalid and counts them in the chunk; values that are not finite are left to the grid.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from viewer.errors import InputError
from viewer.grid_folder import is_grid

CHUNK = 1 << 20
"""Most points in one chunk."""


@dataclass(frozen=True)
class ScanInfo:
    """One scanner station (or one file that does not say).  position: (x, y, z) of the scanner, file coordinates.
    inferred: the file does not say, the order of its points does."""

    name: str
    position: tuple[float, float, float] | None = None
    inferred: bool = False


@dataclass(frozen=True, eq=False)
class Chunk:
    """Up to CHUNK points of one scan.

    xyz: (n, 3) float64.  rgb: (n, 3) uint8, or uint16 where the file's fields are 16 bits wide, or None.
    intensity: (n,) uint16 or None.  scan: index into the source's ``scans`` (or (n,) uint8, one for each point).
    invalid: points left out of this chunk because the file marks them so.
    station: (n,) ids of the scanner positions or flight lines within the scan, where the file tells them apart.
    """

    xyz: np.ndarray
    rgb: np.ndarray | None = None
    intensity: np.ndarray | None = None
    scan: int | np.ndarray = 0
    invalid: int = 0
    station: np.ndarray | None = None


@dataclass(eq=False)
class Source:
    """A readable scan.  Subclasses fill the facts on construction and implement ``chunks``.

    count: points in the file as its header has it (None: unknown).  precision: relative resolution of the stored
    coordinates (2**-24 for float32).  metres_per_unit: None where the file does not say.
    turns: (len(scans) - 1,) ascending running numbers of points in the source from which on they are the next scan's, where
    chunks do not say.
    """

    path: Path
    format: str
    count: int | None = None
    units: str = "unknown"
    metres_per_unit: float | None = None
    crs: str | None = None
    precision: float = 2.0**-53
    scans: list[ScanInfo] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    turns: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))

    def chunks(self) -> Iterator[Chunk]:
        """Yields the points from the beginning.  Raises InputError where the file is damaged."""
        raise NotImplementedError


def told_beyond(path: Path, count: int | None) -> str:
    """The warning about a file that holds more points than its header says."""
    return f"{path.name}: its header counts {count:,} points, but more follow; they are left out, it may be damaged"


def stretch(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Maps ``low..high`` linearly to the whole of uint16, clipped; what is not a number becomes 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = (np.asarray(values, np.float64) - low) * (65535.0 / (high - low) if high > low else 0.0)
        return np.clip(np.nan_to_num(scaled, nan=0.0) + 0.5, 0, 65535).astype(np.uint16)


_MAGIC = {b"LASF": "las", b"ply\n": "ply", b"ply\r": "ply", b"ASTM": "e57"}
_SUFFIXES = {".las": "las", ".laz": "las", ".ply": "ply", ".e57": "e57"}
KNOWN = "PLY, LAS, LAZ, COPC or E57"


def check_file(path: Path) -> None:
    """Raises InputError unless ``path`` is a readable file that is not empty."""
    try:
        if not path.exists():
            raise InputError(f"{path}: no such file")
        if path.is_dir():
            if is_grid(path):
                raise InputError(f"{path}: a folder made by convert is opened alone; give the scans it was made from")
            raise InputError(f"{path}: is a folder, not a scan; give a {KNOWN} file, or a folder made by convert")
        if not path.is_file():
            raise InputError(f"{path}: not a regular file; copy it to disk first")
        if path.stat().st_size == 0:
            raise InputError(f"{path}: the file is empty (0 bytes); copy or export it again")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def is_scan(path: Path) -> bool:
    """Whether a file's name is that of a scan; what it holds is seen on opening."""
    return path.suffix.lower() in _SUFFIXES and path.is_file()


def open_source(path: Path) -> Source:
    """The reader for ``path``, chosen by the file's first bytes; a misleading suffix earns a warning."""
    check_file(path)
    try:
        with path.open("rb") as file:
            head = file.read(64)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    kind = _MAGIC.get(head[:4])
    suffix = path.suffix.lower()
    if kind is None:
        raise InputError(f"{path}: {_guess(head, suffix)}; expected a {KNOWN} file")
    if kind == "las":
        from viewer.readers.las import LasSource as Reader
    elif kind == "ply":
        from viewer.readers.ply import PlySource as Reader
    else:
        from viewer.readers.e57 import E57Source as Reader
    source = Reader(path)
    if _SUFFIXES.get(suffix) != kind:
        named = f"named {suffix}" if suffix else "named without a suffix"
        source.warnings.insert(0, f"{path.name}: {named} but holds {source.format}; read as that")
    return source


def _guess(head: bytes, suffix: str) -> str:
    if head.startswith((b"# .PCD", b"VERSION")) or suffix == ".pcd":
        return "PCD files are not supported, convert it to PLY or E57 (CloudCompare, Open3D)"
    if head.startswith(b"PK\x03\x04"):
        return "is a zip archive, unpack it first"
    if head.startswith(b"\x1f\x8b"):
        return "is gzip-compressed, unpack it first"
    if suffix in _SUFFIXES:
        return f"named {suffix} but does not begin like one (first bytes {head[:4]!r}), damaged or another format"
    return f"not a scan format known here (first bytes {head[:4]!r})"
