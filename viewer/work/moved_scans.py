"""Scans of a project that are no longer where the project says: where they are looked for, and whether one is the same scan.

A project file keeps, beside its document, the absolute and the relative path of each scan, its size in bytes, and the SHA-256
of its first and last 64 KiB ("places"; older programs ignore it, and older projects lack it, or the last).  A scan
is looked for at its stored path, at its absolute and relative place, and below the folder of the project and the two above it
under the last names of its old path, so that a project finds its scans where both were moved together or the scan lies beside
it.  A file found elsewhere than stored counts only where size and checksum are the recorded ones.
"""

import hashlib
import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath, PureWindowsPath

from ..common.errors import InputError
from ..readers.remote.address import address_in, is_address
from ..readers.remote.local_copies import local_file

ENDS = 64 << 10
"""Bytes at either end of a scan that are compared; headers and the last points differ between scans."""
FOLDERS_UP = 2
"""Folders above the project in which scans are looked for."""
_NAMES = 6
"""Last names of an old path that are looked for together."""


@dataclass(frozen=True)
class ScanPlace:
    """absolute, relative: paths of a scan as they were when the project was saved, the latter to the project's folder, ""
    across drives.  size: bytes of a file, None of a folder and where it was not there.  ends: its checksum (ends_of)."""

    absolute: str = ""
    relative: str = ""
    size: int | None = None
    ends: str = ""


class MissingScans(InputError):
    """Scans of a project are not there.  project: its file.  scans: their paths as the project has them."""

    def __init__(self, project: Path, scans: list[Path]):
        self.project, self.scans = project, scans
        more = f" (and {len(scans) - 1} more)" if len(scans) > 1 else ""
        super().__init__(f"{project}: its scan {scans[0]} is not there{more}; move it back, or open the project in the window "
                         "and locate it there")


def size_of(path: Path) -> int | None:
    """Bytes of a file; None of a folder, and where there is nothing."""
    try:
        path = local_file(path, fetch=False)
        return path.stat().st_size if path.is_file() else None
    except (OSError, ValueError):
        return None


def ends_of(path: Path) -> str:
    """SHA-256 of the first and the last ENDS bytes of a file, which tells scans of the same size apart without reading all of
    them; "" of a folder, and where it cannot be read."""
    try:
        path = local_file(path, fetch=False)
        if not path.is_file():
            return ""
        stat = path.stat()
        return _ends(path, stat.st_size, stat.st_mtime_ns)
    except (OSError, ValueError):
        return ""


@lru_cache(4096)
def _ends(path: Path, size: int, _changed: int) -> str:
    """Read once while a file stays as it is: a project may have hundreds of scans, on a slow disk."""
    with path.open("rb") as file:
        digest = hashlib.sha256(file.read(ENDS))
        file.seek(max(size - ENDS, 0))
        digest.update(file.read(ENDS))
    return digest.hexdigest()


def place_of(path: str, project: Path, known: ScanPlace | None = None) -> ScanPlace:
    """The place of a scan, seen from the folder of a project file that is written.  known: what is known of the file that was
    loaded, or was recorded before.  Its size and checksum stay, whatever is at the path now: a file that has been replaced
    since is not the scan that the work belongs to."""
    if (address := address_in(path)) is not None:
        return ScanPlace(address.kept, "", size_of(Path(path)), ends_of(Path(path)))
    whole, folder = os.path.abspath(path), os.path.abspath(project.parent)
    try:
        relative = Path(os.path.relpath(whole, folder)).as_posix()
    except ValueError:  # another drive
        relative = ""
    file = Path(whole)
    kept = known is not None and (known.ends or not _exists(file))
    size, ends = (known.size, known.ends) if known is not None and kept else (size_of(file), ends_of(file))
    return ScanPlace(file.as_posix(), relative, size, ends)


def places_from(data) -> list[ScanPlace]:
    """The places in a parsed project file; what is damaged there counts as unknown: it only helps to find scans."""
    def place(row) -> ScanPlace:
        row = row if isinstance(row, dict) else {}
        absolute, relative, ends = (value if isinstance(value := row.get(name), str) else ""
                                    for name in ("absolute", "relative", "ends"))
        size = row.get("size")
        return ScanPlace(absolute, relative, size if type(size) is int and size >= 0 else None, ends)

    return [place(row) for row in data] if isinstance(data, list) else []


def found_scan(project: Path, stored: str, place: ScanPlace) -> Path | str:
    """Where a scan is: ``stored`` where that is there, is an address, or nothing else is found.  stored: its path, absolute or
    relative to the working folder."""
    if is_address(stored):
        return stored
    first = Path(stored)
    if _exists(first):
        return first
    for other in _elsewhere(project, stored, place):
        if _exists(other) and place.size in (None, size_of(other)) and place.ends in ("", ends_of(other)):
            return other
    return first


def difference(path: Path, stored: str, place: ScanPlace) -> str:
    """Why a scan that is at its place, or that a person located, may be another than that of the project, in words; "" where
    nothing says so."""
    name, size = _names(stored)[-1:], size_of(path)
    if place.size is not None and size is not None and size != place.size:
        return f"It has {size:,} bytes; the scan of the project had {place.size:,}."
    if place.ends and ends_of(path) not in ("", place.ends):
        return "It is as large as the scan of the project, but its contents are others: another scan, or one changed since."
    if name and path.name != name[0] and (place.size is None or size is None):
        return f"Its name is not {name[0]}."
    return ""


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _names(path: str) -> tuple[str, ...]:
    """The names that a path consists of, of either kind of system, without its root."""
    pure = PureWindowsPath(path) if "\\" in path else PurePosixPath(path)
    return tuple(part for part in pure.parts if part != pure.anchor and part not in ("..", "."))


def _elsewhere(project: Path, stored: str, place: ScanPlace) -> list[Path]:
    """Paths where a scan that is not at its stored path may be, the likeliest first."""
    folder = Path(os.path.abspath(project.parent))
    found = [folder / place.relative] if place.relative else []
    found += [Path(place.absolute)] if place.absolute else []
    for names in dict.fromkeys((_names(place.absolute), _names(stored))):
        for base in (folder, *folder.parents[:FOLDERS_UP]):
            found += [base.joinpath(*names[-count:]) for count in range(min(_NAMES, len(names)), 0, -1)]
    return list(dict.fromkeys(Path(os.path.normpath(path)) for path in found))
