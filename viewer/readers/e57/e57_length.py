"""E57 files whose length differs from what their header states, although all points are there: a repaired copy is read.

libe57 refuses such a file.  A transfer may add bytes to the end or lose bytes of the last page, which ends with a checksum and
usually with the padding behind the XML.  The copy has no name and is gone with the process.
"""

import shutil
import struct
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

from ..nameless_copy import can_copy, nameless_copy, path_of
from .e57_packets import PAGE, PAGE_DATA

_HEADER = struct.Struct("<8sII4Q")  # signature, version, physical length, place and length of the XML, bytes of a page
_LENGTH_AT = 16
_CHECKSUM = 4


def length_warning(path: Path) -> str | None:
    """The warning about a file whose length is not what its header states; None where it is."""
    stated, size = _lengths(path)
    if stated == size or _target(path) is None:
        return None
    return f"{path.name}: has {size:,} bytes, its header states {stated:,}; all points are there, a repaired copy is read"


def readable(path: Path) -> str:
    """The path that libe57 reads: of the file, or of a repaired copy without a name.  Raises InputError where there is no room
    for the copy."""
    if not can_copy() or (target := _target(path)) is None:
        return str(path)
    stat = path.stat()
    return str(path_of(_copy(path, stat.st_mtime_ns, stat.st_size, target)))


def _lengths(path: Path) -> tuple[int, int]:
    """The length by the header, and that of the file."""
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
    size = path.stat().st_size
    return (_HEADER.unpack(head)[3] if len(head) == _HEADER.size else size), size


def _target(path: Path) -> int | None:
    """The length of a repaired copy; None where the length is right, or bytes are lost that nothing tells."""
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
    if len(head) < _HEADER.size:
        return None
    signature, _, _, stated, place, length, page = _HEADER.unpack(head)
    size = path.stat().st_size
    if signature != b"ASTM-E57" or page != PAGE or stated == size:
        return None
    target = stated if stated % PAGE == 0 else size // PAGE * PAGE  # the header is wrong, not the file
    end = place // PAGE * PAGE_DATA + place % PAGE + length  # of the XML, without checksums
    end = end // PAGE_DATA * PAGE + end % PAGE_DATA
    lost = target - size
    known = lost <= _CHECKSUM or (lost < PAGE and end <= size)
    return target if known and PAGE <= end <= target and target - end < 2 * PAGE else None


@lru_cache(maxsize=4)
def _copy(path: Path, _time: int, size: int, target: int) -> BinaryIO:
    """The repaired copy, opened; it has no name."""

    def fill(file: BinaryIO, copy: BinaryIO) -> None:
        shutil.copyfileobj(file, copy)
        copy.truncate(min(size, target))
        copy.truncate(target)
        if size < target:
            _seal(copy, target - PAGE)
        copy.seek(_LENGTH_AT)
        copy.write(struct.pack("<Q", target))
        _seal(copy, 0)

    return nameless_copy(path, fill, "its length is not what its header states", "a repaired copy", "copy it again or ")


def _seal(file: BinaryIO, place: int) -> None:
    """Writes the checksum of the page at byte ``place``."""
    file.seek(place)
    data = file.read(PAGE_DATA)
    file.seek(place + PAGE_DATA)
    file.write(struct.pack(">I", crc32c(data)))


def crc32c(data: bytes) -> int:
    """The checksum of a page (Castagnoli)."""
    table, value = _table(), 0xFFFFFFFF
    for byte in data:
        value = table[(value ^ byte) & 0xFF] ^ (value >> 8)
    return value ^ 0xFFFFFFFF


@lru_cache(maxsize=1)
def _table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table
