"""Photographs that a document has placed, as those that colour pictures and as those that are shown in place."""

from functools import partial
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.photographs.placed_photograph import PlacedPhotograph
from ..decoded_picture import decoded_picture
from ..e57.e57_photographs import LONGEST, StationPhoto
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
                           np.array(placed.camera_to_world), partial(_decode, placed))  # fmt: skip


def shown_in_place(placed: PlacedPhotograph) -> StationPhoto:
    """The photograph decoded, to be laid over the view.  Raises InputError where it is damaged or not there any more."""
    picture, _ = _decode(placed, LONGEST)
    height, width = picture.shape[:2]
    across, down = width / placed.width, height / placed.height
    return StationPhoto(placed.name, "pinhole", picture, placed.focal * across, placed.focal * down, width / 2, height / 2,
                        np.array(placed.camera_to_world))  # fmt: skip


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
