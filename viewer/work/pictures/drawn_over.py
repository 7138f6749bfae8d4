"""Drawing over a finished picture of any size, in the window's sizes and colours: what measurements and notes share."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.text_line import TextLine
from ...picture.drawn_lines import Area, label_places, leader

if TYPE_CHECKING:
    from ...picture.camera import Camera

ACCENT, EDGE, TEXT, PLATE = (92, 196, 192, 255), (10, 12, 14, 200), (233, 235, 238, 255), (29, 32, 37, 235)
"""sRGB and opacity, the window's (viewer.window.kit.theme)."""
_UNIT, _LEAST_UNIT = 1 / 720, 0.75
"""A design unit of the window, in which sizes below are given: a share of the picture's height, and pixels at least."""
LETTERS, _GAP, _PAD = 15.0, 10.0, 5.0
_REACHES, _LEADER = (1.0, 2.5, 4.0, 7.0, 10.0, 14.0), 1.2
"""Multiples of the gap in which room is looked for, and the width of a line to a label that lies farther off."""
_CAPITALS, _TALL = 0.79, 0.97
"""Heights above the baseline, and from the top to below it, of a size."""
_FINE = 8e6
"""Pixels up to which shapes are drawn at twice the size, for smooth edges; above, a pixel's edge is not seen."""


def unit_length(height: int) -> float:
    """Pixels of a design unit of the window in a picture so many pixels high."""
    return max(_UNIT * height, _LEAST_UNIT)


def with_shapes(picture: np.ndarray, camera: "Camera", shapes: Callable[[Any, "Camera", float], object], at: list[np.ndarray],
                texts: Sequence[str], taken: list[Area] | None = None, marks: "Sequence[Sequence[float]]" = ()) -> np.ndarray:
    """The picture with shapes and labels over it.

    picture: (H, W, 3) or (H, W, 4) uint8, premultiplied; it is not changed.  camera: of it, at its size.  shapes: draws with
    an ImageDraw, for the camera that it is given, in a design unit of so many pixels.  at: places of the labels, file
    coordinates.  taken: where labels lie already, pixels, over which none of these is put; theirs are added.
    marks: (m, 3) places of other marks, to which no label is to seem to belong.
    """
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    size = unit_length(height)
    times = 2 if height * width <= _FINE else 1
    sheet = Image.new("RGBA", (width * times, height * times))
    shapes(ImageDraw.Draw(sheet), camera.resized(*sheet.size), size * times)
    if times > 1:
        sheet = sheet.resize((width, height), Image.Resampling.BOX)
    _draw_labels(ImageDraw.Draw(sheet), camera, at, texts, size, [] if taken is None else taken, marks)
    return drawn_over(picture, np.asarray(sheet))


def _draw_labels(draw: Any, camera: "Camera", at: list[np.ndarray], texts: Sequence[str], unit: float,
                 taken: list[Area], marks: Sequence[Sequence[float]]) -> None:
    """A label that has no room beside its point lies farther off, with a line to it."""
    if not at:
        return
    lines, pad = [TextLine(text, max(round(LETTERS * unit), 9)) for text in texts], _PAD * unit
    sizes = [(line.width + 2 * pad, _TALL * line.size + 2 * pad) for line in lines]
    places, depths = camera.project(np.array(at))
    area = (0.0, 0.0, float(camera.width), float(camera.height))
    before = tuple(taken)
    others = seen_places(camera, marks)
    found = label_places(places, depths, sizes, _GAP * unit, area, 4 * unit, taken, _REACHES, others)
    for number, (x, y) in found.items():
        end = leader(places[number], (x, y), sizes[number], _GAP * unit, [*places, *others])
        if end is not None:
            for fill, wide in ((EDGE, _LEADER + 1.8), (TEXT, _LEADER)):
                draw.line([*places[number], *end], fill=fill, width=max(round(wide * unit), 1))
        taken.append((x, y, *sizes[number]))
    for x, y, width, height in before:  # no line crosses a label that the picture has
        draw.rectangle([x, y, x + width, y + height], fill=(0, 0, 0, 0))
    for number, (x, y) in found.items():
        width, height = sizes[number]
        draw.rounded_rectangle([x, y, x + width, y + height], 4 * unit, fill=PLATE)
        lines[number].draw(draw, x + pad, y + pad + _CAPITALS * lines[number].size, TEXT)


def seen_places(camera: "Camera", points: "Sequence[Sequence[float]]") -> list[list[float]]:
    """Pixels of those points, (m, 3) file coordinates, that are in front of the camera."""
    if not len(points):
        return []
    places, depths = camera.project(np.array(points))
    with np.errstate(invalid="ignore"):
        return places[(depths > 0) & (np.abs(places) < 1e6).all(axis=1)].tolist()


@cache
def letters(size: int) -> Any:
    """The font, ``size`` pixels tall: Matplotlib's, which has Ø, ², Greek and Cyrillic letters; Pillow's own has not."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", size)


def drawn_over(picture: np.ndarray, sheet: np.ndarray) -> np.ndarray:
    """The sheet, (H, W, 4) uint8, not premultiplied, over a picture of that size that is."""
    alpha, colour = sheet[..., 3:].astype(np.uint32), sheet[..., :3]
    if picture.shape[2] == 4:
        colour = np.concatenate([colour, np.full(alpha.shape, 255, np.uint8)], axis=2)
    return ((picture * (255 - alpha) + colour * alpha + 127) // 255).astype(np.uint8)
