"""Measurements drawn over a finished picture of any size: their lines, points and values, as the window shows them."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...picture.drawn_lines import clipped, in_front, label_places
from ..measuring.measure_shapes import Shapes, shapes_of
from ..measuring.measure_text import labels_of

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ..measuring.measurement import Measurement

_ACCENT, _EDGE, TEXT, PLATE = (92, 196, 192, 255), (10, 12, 14, 200), (233, 235, 238, 255), (29, 32, 37, 235)
"""sRGB and opacity, the window's (viewer.window.kit.theme)."""
_UNIT, _LEAST_UNIT = 1 / 720, 0.75
"""A design unit of the window, in which sizes below are given: a share of the picture's height, and pixels at least."""
_LINE, _HELPER, _POINT, _LETTERS, _GAP, _PAD = 2.0, 1.0, 4.0, 15.0, 10.0, 5.0
_FINE = 8e6
"""Pixels up to which lines are drawn at twice the size, for smooth edges; above, a pixel's edge is not seen."""


def with_measurements(picture: np.ndarray, camera: "Camera", measurements: "Sequence[Measurement]", unit: str) -> np.ndarray:
    """The picture with all measurements over it.

    picture: (H, W, 3) or (H, W, 4) uint8, premultiplied; it is not changed.  camera: of it, at its size.  unit: as the file's
    lengths are named.
    """
    from PIL import Image, ImageDraw

    if not measurements:
        return picture
    height, width = picture.shape[:2]
    size = unit_length(height)
    times = 2 if height * width <= _FINE else 1
    sheet = Image.new("RGBA", (width * times, height * times))
    large = camera.resized(*sheet.size)
    drawn = [shapes_of(measurement) for measurement in measurements]
    draw = ImageDraw.Draw(sheet)
    for shapes in drawn:
        _draw(draw, large, shapes, size * times)
    if times > 1:
        sheet = sheet.resize((width, height), Image.Resampling.BOX)
    texts = labels_of(measurements, unit)
    _draw_labels(ImageDraw.Draw(sheet), camera, [shapes.label for shapes in drawn], texts, size)
    return drawn_over(picture, np.asarray(sheet))


def unit_length(height: int) -> float:
    """Pixels of a design unit of the window in a picture so many pixels high."""
    return max(_UNIT * height, _LEAST_UNIT)


def _draw(draw: Any, camera: "Camera", shapes: Shapes, unit: float) -> None:
    segments = [(line.points, line.closed, _HELPER if line.helper else _LINE) for line in shapes.lines]
    segments += [(ring.points, True, _LINE) for ring in shapes.rings]
    area = (0.0, 0.0, float(camera.width), float(camera.height))
    for shade, more in ((_EDGE, 2.5), (_ACCENT, 0.0)):
        for points, closed, wide in segments:
            ends = np.roll(points, -1, axis=0) if closed else points[1:]
            for a, b in zip(points, ends, strict=False):
                pixels = in_front(camera, a, b)
                part = clipped(pixels[0], pixels[1], area, 8 * unit) if pixels is not None else None
                if part is not None:
                    draw.line([*part[0], *part[1]], fill=shade, width=max(round((wide + more) * unit), 1))
        marks = shapes.points if shapes.place is None else np.concatenate([shapes.points, shapes.place[None]])
        places, depths = camera.project(marks)
        for (x, y), depth in zip(places, depths, strict=True):
            if depth > 0 and abs(x) < 1e6 and abs(y) < 1e6:
                radius = (_POINT + more / 2) * unit
                draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=shade)


def _draw_labels(draw: Any, camera: "Camera", at: list[np.ndarray], texts: list[str], unit: float) -> None:
    font, pad = letters(max(round(_LETTERS * unit), 9)), _PAD * unit
    boxes = [draw.textbbox((0, 0), text, font=font) for text in texts]
    sizes = [(right - left + 2 * pad, bottom - top + 2 * pad) for left, top, right, bottom in boxes]
    places, depths = camera.project(np.array(at))
    area = (0.0, 0.0, float(camera.width), float(camera.height))
    for number, (x, y) in label_places(places, depths, sizes, _GAP * unit, area, 4 * unit).items():
        width, height = sizes[number]
        draw.rounded_rectangle([x, y, x + width, y + height], 4 * unit, fill=PLATE)
        draw.text((x + pad - boxes[number][0], y + pad - boxes[number][1]), texts[number], font=font, fill=TEXT)


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
