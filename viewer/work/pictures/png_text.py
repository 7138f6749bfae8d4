"""The texts that a PNG keeps beside its picture, read without decoding the picture: of any size, in little memory.

Chunks up to the picture's data are walked and their checksums checked; a compressed text is decompressed in bounded steps.
"""

import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from ...common.errors import InputError

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_MOST = 16 << 20
"""Bytes of the longest text: over a thousand times those of pointglass, which have thousands."""


def png_text(path: Path, keyword: str) -> str | None:
    """The text of ``keyword``, None where the file has none.  Raises InputError where it is no PNG, or a damaged one."""
    try:
        with path.open("rb") as file:
            if file.read(len(_SIGNATURE)) != _SIGNATURE:
                raise InputError("is no readable PNG", file=path)
            return _text_in(path, file, keyword.encode("latin-1"))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None


def _text_in(path: Path, file: BinaryIO, keyword: bytes) -> str | None:
    damaged = InputError("is no readable PNG, it is damaged", file=path, remedy="copy it again")
    while True:
        head = file.read(8)
        if len(head) < 8:
            raise damaged
        length, kind = struct.unpack(">I4s", head)
        if kind in (b"IDAT", b"IEND"):
            return None
        if kind not in (b"iTXt", b"tEXt", b"zTXt") or length > _MOST:
            file.seek(length + 4, 1)
            continue
        data, end = file.read(length), file.read(4)
        if len(data) < length or len(end) < 4 or struct.unpack(">I", end)[0] != zlib.crc32(kind + data):
            raise damaged
        name, _, rest = data.partition(b"\0")
        if name == keyword:
            found = _decoded(kind, rest)
            if found is None:
                raise damaged
            return found


def _decoded(kind: bytes, rest: bytes) -> str | None:
    """The text behind a keyword; None where it is damaged, or longer than _MOST."""
    packed = kind == b"zTXt"
    if kind == b"iTXt":
        if len(rest) < 2:
            return None
        packed = rest[0] == 1
        parts = rest[2:].split(b"\0", 2)  # language, translated keyword, text
        if len(parts) < 3:
            return None
        rest = parts[2]
    elif packed:
        rest = rest[1:]
    try:
        if packed:
            unpack = zlib.decompressobj()
            rest = unpack.decompress(rest, _MOST)
            if unpack.unconsumed_tail:
                return None
        return rest.decode("utf-8" if kind == b"iTXt" else "latin-1")
    except (zlib.error, UnicodeDecodeError):
        return None
