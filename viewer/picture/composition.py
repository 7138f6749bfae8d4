"""What is put together from finished pictures: one, or two side by side with their labels, over a background.

Plain NumPy.  F12, ``render --like`` and the window's canvas divide a comparison at the same column.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..common.errors import InputError
from .background import as_saved

_LETTERS, _MARGIN = 0.028, 0.018
"""Height of a comparison's labels and their distance from the edges, shares of the picture's height."""


def joined(images: "list[np.ndarray]", background: str, views: tuple[str, ...], split_at: float) -> np.ndarray:
    """One picture, or two side by side with their labels, over a background.

    images: (H, W, 4) uint8, premultiplied, one or two.  views: their names.  background: a key of
    viewer.picture.settings.BACKGROUNDS.  split_at: share of the width at which the second begins.
    Returns (H, W, 3) uint8, with a transparent background (H, W, 4).  Raises InputError for a transparent comparison.
    """
    picture = as_saved(images[0], background).copy()
    if len(images) == 1:
        return picture
    if background == "transparent":
        raise InputError("a comparison has no transparent background", remedy="choose another")
    column = split_column(split_at, picture.shape[1])
    picture[:, column:] = as_saved(images[1], background)[:, column:]
    return labelled(picture, column, (views[0], views[1]))


def split_column(split_at: float, width: int) -> int:
    """Column at which the second picture of a comparison begins.  split_at: share of the width, 0 to 1."""
    return round(split_at * width)


def labelled(picture: np.ndarray, column: int, names: tuple[str, str]) -> np.ndarray:
    """A comparison with the name of each side at its top, on a dark plate.  picture: (H, W, 3) uint8; changed in place."""
    height, width = picture.shape[:2]
    size = max(round(_LETTERS * height), 9)
    margin, pad = max(round(_MARGIN * height), 4), max(size // 2, 3)
    for name, left, right in ((names[0], 0, column), (names[1], column, width)):
        mask = _lettering(name, size)
        tall, wide = mask.shape[0] + pad, mask.shape[1] + 2 * pad
        if right - left < wide + 2 * margin or height < tall + 2 * margin:
            continue  # no room on this side
        x = margin if left == 0 else right - margin - wide
        plate = picture[margin : margin + tall, x : x + wide]
        plate[:] = plate // 4
        inner = plate[pad // 2 : pad // 2 + mask.shape[0], pad : pad + mask.shape[1]]
        share = mask[..., None].astype(np.uint16)
        inner[:] = ((255 - share) * inner + share * 240 + 127) // 255
    return picture


@cache
def _lettering(text: str, size: int) -> np.ndarray:
    """(h, w) uint8: how much of each pixel a text covers."""
    from PIL import Image, ImageDraw, ImageFont

    font: Any = ImageFont.load_default(size)
    if not text.isascii():  # of a file; Pillow's own font has Latin letters only
        import matplotlib

        font = ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", size)
    left, top, right, bottom = font.getbbox("Ag" + text)
    canvas = Image.new("L", (int(right - left) + size, int(bottom - top) + 2))
    ImageDraw.Draw(canvas).text((0, -top + 1), text, fill=255, font=font)
    mask = np.asarray(canvas)
    return mask[:, : int(np.nonzero(mask.any(axis=0))[0][-1]) + 1]
