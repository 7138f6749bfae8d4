"""The scale bar of an orthographic picture, drawn over it at any size: bottom right, as the window shows it."""

from typing import TYPE_CHECKING

import numpy as np

from ..measuring.measure_text import length_text
from .drawn_over import PLATE, TEXT, drawn_over, letters, unit_length

if TYPE_CHECKING:
    from ...picture.camera import Camera

LONGEST = 160.0
"""Design units: the longest scale bar."""
_MARGIN, _PAD, _LETTERS, _TICK = 14.0, 10.0, 14.0, 4.0
"""Design units."""


def bar_length(most: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not more than ``most``, which is above 0."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1, 2, 5) if step * power <= most * (1 + 1e-12)))


def with_scale_bar(picture: np.ndarray, camera: "Camera", metres_per_unit: float | None) -> np.ndarray:
    """The picture with a scale bar; itself where the camera is no orthographic one.

    picture: (H, W, 3) or (H, W, 4) uint8, premultiplied; it is not changed.  camera: of it, at its size.  metres_per_unit: of
    the file, None where it is not known.
    """
    from PIL import Image, ImageDraw

    if camera.orthographic is None:
        return picture
    height, width = picture.shape[:2]
    size = unit_length(height)
    a_pixel = camera.orthographic / camera.fx
    length = bar_length(a_pixel * min(LONGEST * size, 0.5 * width))
    wide, label, font = length / a_pixel, length_text(length, metres_per_unit), letters(max(round(_LETTERS * size), 9))
    sheet = Image.new("RGBA", (width, height))
    draw = ImageDraw.Draw(sheet)
    right, bottom = width - _MARGIN * size, height - _MARGIN * size
    left = right - max(wide, font.getlength(label)) - 2 * _PAD * size
    top = bottom - (_LETTERS + 18) * size
    draw.rounded_rectangle([left, top, right, bottom], 5 * size, fill=PLATE)
    start, line, thick = round(left + _PAD * size), bottom - 9 * size, max(round(1.5 * size), 1)
    draw.text((start, top + 3 * size), label, font=font, fill=TEXT, anchor="la")
    end = round(start + wide)
    draw.rectangle([start, line - thick / 2, end, line + thick / 2], fill=TEXT)
    for x in (start, end):
        draw.rectangle([x - thick / 2, line - _TICK * size, x + thick / 2, line + _TICK / 2 * size], fill=TEXT)
    return drawn_over(picture, np.asarray(sheet))
