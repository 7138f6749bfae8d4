"""SPZ (Niantic, https://github.com/nianticlabs/spz): its header, checked against the file, and its columns, unpacked.

Versions 1 to 3 are one gzip stream of header and columns; version 4 has its header plain, then a table of the columns, each a
zstandard frame.  The columns are positions, opacities, colours, scales, rotations and spherical harmonics.  The first three
are kept; the others are unpacked to see that they are there.
"""

import json
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, cast

from ...common.errors import InputError
from ..own_folder import MOST_UNPACKED, may_unpack

MAGIC = b"NGSP"
GZIP = b"\x1f\x8b"
LATEST = 4
"""Versions from 1 on that are read."""
_HEAD, _HEAD_4, _ENTRY = 16, 32, 16
"""Bytes of the header, of that of version 4, and of a row of its table."""
_HARMONICS = (0, 9, 24, 45, 72)
"""Bytes of the spherical harmonics of a splat, by their degree."""
_MOST_BITS = 24
"""Bits behind the point of a coordinate of 24 bits, at most."""
_PIECE = 1 << 20
"""Bytes that are unpacked at once."""
FRONT = 1 << 15
"""Bytes of a gzip stream that are looked at for a header: twice as many as the comment of our export has at most, and over ten
times what its Huffman codes take."""
_COMMENT = 10
"""Where the comment of a gzip header begins, if that has only this."""


@dataclass(frozen=True)
class SpzHeader:
    """version: of the format.  count: of splats.  bits: of a coordinate, behind the point.  widths: bytes of a splat in each
    column, in their order.  data: where version 4 has its table."""

    version: int
    count: int
    bits: int
    widths: tuple[int, ...]
    data: int

    @property
    def kept(self) -> int:
        """Bytes of positions, opacities and colours."""
        return self.count * sum(self.widths[:3])


def spz_front(head: bytes) -> bytes:
    """The first bytes of what a gzip stream holds, where they are those of SPZ; else ``head`` itself, the first bytes of a
    file."""
    if not head.startswith(GZIP):
        return head
    try:
        front = zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(head, _HEAD)
    except zlib.error:
        return head
    return front if front.startswith(MAGIC) else head


def spz_comment(path: Path) -> Any:
    """The JSON in the comment of a gzip header, as our export writes it; None where there is none."""
    with path.open("rb") as file:
        head = file.read(FRONT)
    if not head.startswith(GZIP) or head[3:4] != b"\x10":
        return None
    try:
        return json.loads(head[_COMMENT : head.index(b"\0", _COMMENT)])
    except (ValueError, RecursionError):
        return None


def read_spz_header(path: Path) -> SpzHeader:
    """The header of a file.  Raises InputError where it is not valid, or the file too short for what it says."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(FRONT)
    plain = not head.startswith(GZIP)
    if not plain and not spz_front(head).startswith(MAGIC):
        raise InputError("its gzip data does not begin like SPZ, it is damaged or of another format", file=path,
                         remedy="copy or export it again")
    front = head[:_HEAD_4] if plain else spz_front(head)
    if len(front) < (_HEAD_4 if plain else _HEAD):
        raise InputError(f"truncated: its header ends after {len(front)} bytes", file=path, remedy="copy or export it again")
    version, count, degree, bits, _, streams = struct.unpack_from("<IIBBBB", front, 4)
    if not 1 <= version <= LATEST or plain != (version >= 4):
        what = f"SPZ version {version}{'' if plain else ', compressed with gzip,'} is not read (1 to 3 with gzip and 4 are)"
        raise InputError(what, file=path, remedy="save it as version 3 or as PLY")
    if degree >= len(_HARMONICS) or bits > _MOST_BITS:
        raise InputError(f"damaged: spherical harmonics of degree {degree}, {bits} bits behind the point", file=path,
                         remedy="copy or export it again")
    if count == 0:
        raise InputError("holds no splats (its header says 0)", file=path, remedy="export it again")
    widths = (6 if version == 1 else 9, 1, 3, 3, 4 if version >= 3 else 3, _HARMONICS[degree])
    header = SpzHeader(version, count, bits, widths, struct.unpack_from("<I", front, _HEAD)[0] if plain else 0)
    if header.kept > MOST_UNPACKED:
        raise InputError(f"its header counts {count:,} splats, {MOST_UNPACKED // sum(widths[:3]):,} are read at most",
                         file=path, remedy="save it as PLY, or in parts")
    if not may_unpack(size, count * sum(widths)):
        raise InputError(f"damaged: its {size:,} bytes cannot hold the {count:,} splats that its header counts", file=path,
                         remedy="copy or export it again")
    if plain and streams != sum(width > 0 for width in widths):
        raise InputError(f"damaged: {streams} columns for spherical harmonics of degree {degree}", file=path,
                         remedy="copy or export it again")
    return header


def kept_columns(path: Path, header: SpzHeader) -> tuple[bytes, bytes, bytes]:
    """Positions, opacities and colours as the file packs them.  Raises InputError where one of the columns is not whole."""
    columns = _gzip_columns if header.version < 4 else _zstd_columns
    with path.open("rb") as file:
        position, opacity, colour = columns(path, file, header)
    return position, opacity, colour


def _gzip_columns(path: Path, file: BinaryIO, header: SpzHeader) -> list[bytes]:
    pieces = _unzipped(path, file)
    taken = _Taker(pieces, lambda done, whole: _short(path, done, whole))
    whole = _HEAD + header.count * sum(header.widths)
    taken.take(_HEAD, whole)
    found = [taken.take(header.count * width, whole) for width in header.widths[:3]]
    for width in header.widths[3:]:
        taken.take(header.count * width, whole, kept=False)
    next(pieces, None)  # reaches the checksum, where nothing else follows
    return found


def _unzipped(path: Path, file: BinaryIO) -> Iterator[bytes]:
    unpack = zlib.decompressobj(16 + zlib.MAX_WBITS)
    try:
        while packed := file.read(_PIECE):
            while packed and not unpack.eof:
                yield unpack.decompress(packed, _PIECE)
                packed = unpack.unconsumed_tail
            if unpack.eof:
                return
    except zlib.error:
        raise _unreadable(path) from None


class _Taker:
    """Takes runs of bytes from pieces.  short: makes the error where they end too early, from the bytes there and wanted."""

    def __init__(self, pieces: Iterator[bytes], short: Callable[[int, int], InputError]):
        self._pieces, self._short = pieces, short
        self._rest, self._done = memoryview(b""), 0

    def take(self, count: int, whole: int, *, kept: bool = True) -> bytes:
        """The next ``count`` bytes; of those that are not kept, nothing.  whole: for the error."""
        found = bytearray()
        while count:
            if not len(self._rest):
                if (piece := next(self._pieces, None)) is None:
                    raise self._short(self._done, whole)
                self._rest = memoryview(piece)
            some = self._rest[:count]
            if kept:
                found += some
            count, self._done, self._rest = count - len(some), self._done + len(some), self._rest[len(some) :]
        return bytes(found)


def _zstd_columns(path: Path, file: BinaryIO, header: SpzHeader) -> list[bytes]:
    import zstandard

    size, widths = path.stat().st_size, [width for width in header.widths if width]
    file.seek(header.data)
    table = file.read(_ENTRY * len(widths))
    at = header.data + len(table)
    sizes = list(struct.iter_unpack("<QQ", table)) if len(table) == _ENTRY * len(widths) else []
    if header.data < _HEAD_4 or not sizes or at + sum(packed for packed, _ in sizes) > size:
        raise InputError(f"truncated or damaged: the columns do not lie in its {size:,} bytes", file=path,
                         remedy="copy or export it again")
    for number, ((_, unpacked), width) in enumerate(zip(sizes, widths), 1):
        if unpacked != header.count * width:
            raise InputError(f"damaged: column {number} has {unpacked:,} bytes, {header.count:,} splats need "
                             f"{header.count * width:,}", file=path, remedy="copy or export it again")
    found = []
    for number, (packed, unpacked) in enumerate(sizes):
        file.seek(at)
        at += packed
        reader = zstandard.ZstdDecompressor(max_window_size=MOST_UNPACKED).stream_reader(cast(BinaryIO, _Part(file, packed)))
        try:
            taken = _Taker(iter(lambda r=reader: r.read(_PIECE) or None, None), lambda done, whole: _short(path, done, whole))
            column = taken.take(unpacked, unpacked, kept=number < 3)
        except zstandard.ZstdError:
            raise _unreadable(path) from None
        if number < 3:
            found.append(column)
    return found


class _Part:
    """The next ``count`` bytes of a file, as a file."""

    def __init__(self, file: BinaryIO, count: int):
        self._file, self._left = file, count

    def read(self, size: int = -1) -> bytes:
        data = self._file.read(self._left if size < 0 else min(size, self._left))
        self._left -= len(data)
        return data


def _short(path: Path, done: int, whole: int) -> InputError:
    return InputError(f"truncated: {done:,} of {whole:,} bytes of its splats could be unpacked", file=path,
                      remedy="copy or export it again")


def _unreadable(path: Path) -> InputError:
    return InputError("damaged: its compressed splats cannot be unpacked", file=path, remedy="copy or export it again")
