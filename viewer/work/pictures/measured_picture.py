"""Measurements drawn over a finished picture of any size: their lines, points and values, as the window shows them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...picture.drawn_lines import Area, clipped, in_front
from ..measuring.measure_shapes import Shapes, shapes_of
from ..measuring.measure_text import labels_of
from .drawn_over import ACCENT, EDGE, with_shapes

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ..measuring.measurement import Measurement

_LINE, _HELPER, _POINT = 2.0, 1.0, 4.0
"""Design units (:mod:`.drawn_over`): width of lines, radius of points."""


def with_measurements(picture: np.ndarray, camera: "Camera", measurements: "Sequence[Measurement]", unit: str,
                      taken: list[Area] | None = None) -> np.ndarray:
    """The picture with all measurements over it.

    picture: (H, W, 3) or (H, W, 4) uint8, premultiplied; it is not changed.  camera: of it, at its size.  unit: as the file's
    lengths are named.  taken: as :func:`.drawn_over.with_shapes` has it.
    """
    if not measurements:
        return picture
    drawn = [shapes_of(measurement) for measurement in measurements]

    def draw(on: Any, large: "Camera", size: float) -> None:
        for shapes in drawn:
            _draw(on, large, shapes, size)

    return with_shapes(picture, camera, draw, [shapes.label for shapes in drawn], labels_of(measurements, unit), taken)


def _draw(draw: Any, camera: "Camera", shapes: Shapes, unit: float) -> None:
    segments = [(line.points, line.closed, _HELPER if line.helper else _LINE) for line in shapes.lines]
    segments += [(ring.points, True, _LINE) for ring in shapes.rings]
    area = (0.0, 0.0, float(camera.width), float(camera.height))
    for shade, more in ((EDGE, 2.5), (ACCENT, 0.0)):
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
