"""What the colours of a picture mean, drawn over it at any size: bottom left, as the window shows it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...common.text_line import TextLine
from .drawn_over import PLATE, TEXT, drawn_over, unit_length

_MARGIN, _ROW, _SWATCH, _RAMP, _PAD, _LETTERS = 14.0, 22.0, 13.0, 220.0, 10.0, 14.0
"""Design units of the window (viewer.window.kit.legend)."""


@dataclass(frozen=True, eq=False)
class Legend:
    """title: what is shown.  rows: sRGB colour and text of each; or, in place of them, ramp: (256, 3) uint8, from the value
    ``low`` to ``high``, which are texts with their unit."""

    title: str
    rows: Sequence[tuple[tuple[int, int, int], str]] = ()
    ramp: np.ndarray | None = None
    low: str = ""
    high: str = ""


def with_legend(picture: np.ndarray, legend: Legend) -> np.ndarray:
    """The picture with the legend over it.

    picture: (H, W, 3) or (H, W, 4) uint8, premultiplied; it is not changed.  Texts longer than the picture is wide are cut off.
    """
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    unit = unit_length(height)
    size = max(round(_LETTERS * unit), 9)
    sheet = Image.new("RGBA", (width, height))
    draw = ImageDraw.Draw(sheet)
    row, swatch, pad = _ROW * unit, _SWATCH * unit, _PAD * unit
    texts = [legend.title] if legend.ramp is not None else [legend.title, *(text for _, text in legend.rows)]
    wide = max(TextLine(text, size).width for text in texts)
    if legend.ramp is None:
        wide, tall = wide + swatch + pad, row * len(texts) + pad
    else:
        wide = max(wide, TextLine(f"{legend.low}    {legend.high}", size).width, _RAMP * unit)
        tall = 2 * row + swatch + pad
    left = _MARGIN * unit
    top = height - _MARGIN * unit - tall
    draw.rounded_rectangle([left, top, left + wide + 2 * pad, height - _MARGIN * unit], 5 * unit, fill=PLATE)

    def write(x: float, middle: float, text: str, *, ends: bool = False) -> None:
        line = TextLine(text, size)
        line.draw(draw, x - line.width * ends, middle + (line.ascent - line.descent) / 2, TEXT)

    left, middle = left + pad, top + pad / 2 + row / 2
    write(left, middle, legend.title)
    if legend.ramp is None:
        for colour, text in legend.rows:
            middle += row
            draw.rectangle([left, middle - swatch / 2, left + swatch, middle + swatch / 2], fill=(*colour, 255))
            write(left + swatch + pad, middle, text)
        return drawn_over(picture, np.asarray(sheet))
    start, end, upper = round(left), round(left + wide), round(middle + row / 2)
    band = legend.ramp[np.linspace(0, len(legend.ramp) - 1, max(end - start, 1)).round().astype(int)]
    sheet.paste(Image.fromarray(np.repeat(band[None], max(round(swatch), 1), axis=0)), (start, upper))
    middle = upper + swatch + row / 2
    write(left, middle, legend.low)
    write(left + wide, middle, legend.high, ends=True)
    return drawn_over(picture, np.asarray(sheet))
