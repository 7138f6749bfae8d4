"""How measurements are drawn over the picture, whichever tool is selected."""

from typing import TYPE_CHECKING

import numpy as np

from ....work.measuring.measure_shapes import Line, Ring, shapes_of, shapes_of_fits
from ....work.measuring.measure_text import labels_of, text_of
from ....work.measuring.measurement import KINDS, MeasuredPoint, Measurement
from ....work.measuring.values import evaluate
from ..editing import unit_of
from ..tool import Overlay, ToolContext

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas

COMPUTED = {"volume": "area", "profile": "distance"}
"""Kinds that are found on a thread, and what is drawn of each until then."""


def draw_measurement(overlay: "OverlayCanvas", measurement: Measurement, colour: str) -> np.ndarray:
    """Lines and points of a measurement, over the picture.  Returns (3,) where its value is to be written."""
    shapes = shapes_of(measurement)
    if (flat := shapes.area) is not None:
        for a, b in zip(flat, np.roll(flat, -1, axis=0)):  # a fan: polygons need not be convex
            overlay.polygon([flat.mean(axis=0), a, b], colour, 0.22)
    _draw_lines(overlay, shapes.lines, shapes.rings, colour)
    if shapes.place is not None:
        overlay.marker(shapes.place, colour, 6.0, "ring")
    for point in shapes.points:
        overlay.marker(point, colour, 4.0)
    return shapes.label


def draw_begun(overlay: "OverlayCanvas", kind: str, points: list[MeasuredPoint], context: ToolContext) -> None:
    """A measurement that is not ended: its value where the points have one, else the points, what is fitted at them, and a line
    through them where nothing is."""
    of, colour = KINDS[kind], "warn"
    if len(points) >= of.fewest and (of.most is None or len(points) <= of.most):
        made = Measurement(COMPUTED.get(kind, kind), tuple(points), "", context.document.up)
        # the uncertainty is complete with the last point only: it gives the digits and is not written
        overlay.label(draw_measurement(overlay, made, colour), text_of(evaluate(made), unit_of(context), stated=False))
        return
    for point in points:
        overlay.marker(point.position, colour, 4.0)
    fits = [point.fit for point in points if point.fit is not None]
    _draw_lines(overlay, *shapes_of_fits(fits), colour)
    if not fits:
        overlay.polyline([point.position for point in points], colour)


def _draw_lines(overlay: "OverlayCanvas", lines: list[Line], rings: list[Ring], colour: str) -> None:
    for ring in rings:
        overlay.polyline(ring.points, colour, closed=True)
    for line in lines:
        overlay.polyline(line.points, colour, *([1.0] if line.helper else []), closed=line.closed)


class Measurements(Overlay):
    """All measurements of the document."""

    name = "measurements"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        found, unit = context.document.measurements, unit_of(context)
        places = [draw_measurement(overlay, measurement, "accent") for measurement in found]
        if found:
            overlay.labels(places, labels_of(found, unit), of_marks=True)
