"""Text files in UTF-16, as some programs on Windows save them: a copy in UTF-8 is read, made a block at a time.

The byte order mark at the beginning of the file decides.  The copy is a temporary file without a name, gone with the process.
"""

import codecs
import os
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

from ...common.text import bytes_text
from ..nameless_copy import can_copy, nameless_copy, path_of

_LITTLE, _BIG = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE
_COPIED = 1 << 22  # bytes at a time: half or twice changes neither CPU time nor memory of reading 62 MB, beyond the noise
_MARK = "\ufeff"


def encoding_of(head: bytes) -> str | None:
    """The encoding of a file with this beginning, of four bytes or more; None where it is not UTF-16 with a byte order mark."""
    if head.startswith(codecs.BOM_UTF32_LE):  # begins with the mark of UTF-16
        return None
    return "utf-16-le" if head.startswith(_LITTLE) else "utf-16-be" if head.startswith(_BIG) else None


def as_utf8(head: bytes) -> bytes:
    """The beginning of a file, in UTF-8 where it is UTF-16 and its copy can be opened."""
    encoding = encoding_of(head) if can_copy() else None
    return head if encoding is None else head.decode(encoding, "replace").removeprefix(_MARK).encode()


def open_text(path: Path) -> BinaryIO:
    """Opens a text file for reading bytes: of the file, or of its copy in UTF-8.  Raises OSError, and InputError where there is
    no room for the copy."""
    file = path.open("rb")
    encoding = encoding_of(file.read(4)) if can_copy() else None
    file.seek(0)
    if encoding is None:
        return file
    with file:
        stat = os.fstat(file.fileno())
        copy = _copy(path, encoding, stat.st_mtime_ns, stat.st_size)
    return path_of(copy).open("rb")


def size_of(file: BinaryIO) -> int:
    """Bytes of a file that :func:`open_text` opened."""
    return os.fstat(file.fileno()).st_size


@lru_cache(maxsize=4)
def _copy(path: Path, encoding: str, _time: int, size: int) -> BinaryIO:
    """The copy in UTF-8, opened; it has no name.  Bytes that are not UTF-16 become U+FFFD, which no number holds."""

    def fill(file: BinaryIO, copy: BinaryIO) -> None:
        decoder = codecs.getincrementaldecoder(encoding)("replace")
        file.seek(len(_LITTLE))
        while block := file.read(_COPIED):
            copy.write(decoder.decode(block).encode("utf-8", "replace"))
        copy.write(decoder.decode(b"", final=True).encode())

    return nameless_copy(path, fill, "is UTF-16 text", f"a copy in UTF-8 of about {bytes_text(size // 2)}", "")
