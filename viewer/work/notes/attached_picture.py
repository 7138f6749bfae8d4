"""The picture that is attached to a note: a file of its own, read when a person asks for it, and never by its name alone.

A project may come from a stranger: what it names is read only if it is a regular file, called as pictures are, of a size that a
photograph may have, and is decoded as JPEG or PNG (viewer.readers.decoded_picture).
"""

from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...readers.decoded_picture import decoded_picture, ending_of
from .annotation import PICTURE_ENDINGS, is_picture_name

LARGEST = 256 << 20
"""Bytes of an attached picture."""


def attached_bytes(path: str) -> bytes:
    """The bytes of an attached picture.  Raises InputError naming the file."""
    file = Path(path)
    if not is_picture_name(path):
        raise InputError("is not attached as a picture", file=file, remedy=f"attach one of {', '.join(PICTURE_ENDINGS)}")
    try:
        if not file.is_file():
            raise InputError("the attached picture is not there", file=file, remedy="attach it again, or put it back")
        size = file.stat().st_size
        if size > LARGEST:
            raise InputError(f"{size:,} bytes are too many for an attached picture", file=file, remedy="attach a smaller one")
        with file.open("rb") as opened:
            data = opened.read(LARGEST)
    except (OSError, ValueError) as error:  # ValueError: of a path with a zero byte
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=file) from None
    ending_of(data, str(file))
    return data


def attached_picture(path: str, longest: int) -> tuple[np.ndarray, tuple[int, int]]:
    """The picture, (H, W, 3) uint8 sRGB, at most ``longest`` pixels wide and high, and the (width, height) of its file.  Raises
    InputError."""
    return decoded_picture(attached_bytes(path), path, longest)
