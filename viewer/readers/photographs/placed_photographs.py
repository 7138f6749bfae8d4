"""Photographs that a document has placed, as those that colour pictures."""

from functools import partial
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.photographs.placed_photograph import PlacedPhotograph
from ..decoded_picture import decoded_picture
from .posed_photograph import PosedPhotograph


def bytes_of(path: Path) -> bytes:
    """Of a file.  Raises InputError where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None


def posed(placed: PlacedPhotograph) -> PosedPhotograph:
    """The photograph with its pose, not decoded."""
    lens = placed.focal, placed.focal, placed.width / 2, placed.height / 2
    return PosedPhotograph(f"{placed.path}: photograph {placed.name!r}", "pinhole", placed.width, placed.height, lens, False,
                           np.array(placed.camera_to_world), partial(_decode, placed), placed.name)  # fmt: skip


def _decode(placed: PlacedPhotograph, longest: int) -> tuple[np.ndarray, None]:
    path = Path(placed.path)
    if placed.number is None:
        data = bytes_of(path)
    else:
        from ..e57.e57_pictures import picture_file, stored_pictures

        found = [stored for stored in stored_pictures(path) if stored.number == placed.number]
        if not found:
            raise InputError(f"photograph {placed.number + 1} is not there any more", file=path, remedy="place it again")
        data = picture_file(found[0])[0]
    picture, full = decoded_picture(data, f"{placed.path}: photograph {placed.name!r}", longest)
    if full != (placed.width, placed.height):
        raise InputError(f"{placed.path}: photograph {placed.name!r} has {full[0]}x{full[1]} pixels, {placed.width}x"
                         f"{placed.height} when it was placed", remedy="place it again")
    return picture, None
