"""How measurements are drawn over the picture, whichever tool is selected."""

from typing import TYPE_CHECKING

import numpy as np

from ....work.fits.surfaces import frame_of
from ....work.measuring.measure_text import value_text
from ....work.measuring.measurement import Measurement
from ....work.measuring.planes import on_plane
from ....work.measuring.values import evaluate, fitted_plane
from ..editing import unit_of
from ..tool import Overlay, ToolContext

if TYPE_CHECKING:
    from ....work.fits.fit import Fit
    from ....work.measuring.measurement import MeasuredPoint
    from ...kit.overlay import OverlayCanvas

_ROUND = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
_LINES_ALONG = 4  # drawn along a pipe


def label_place(measurement: Measurement) -> np.ndarray:
    """(3,) file coordinates: where the value is written."""
    points = np.array([point.position for point in measurement.points])
    if (place := evaluate(measurement).place) is not None:
        return np.array(place)
    if (way := _way(measurement)) is not None:
        return way.mean(axis=0)
    if measurement.kind == "angle":
        return points[1]
    if measurement.kind == "polyline":
        return points[-1]
    return points.mean(axis=0)


def draw_measurement(overlay: "OverlayCanvas", measurement: Measurement, text: str, colour: str) -> None:
    """Lines, points and the value of a measurement, over the picture."""
    points = np.array([point.position for point in measurement.points])
    if measurement.fits:
        at = label_place(measurement)
        for fit in measurement.fits:
            _draw_fit(overlay, fit, colour)
        if measurement.kind == "corner":
            for point in points:
                overlay.polyline([at, point], colour, 1.0)
            overlay.marker(at, colour, 5.0)
        elif (way := _way(measurement)) is not None:
            overlay.polyline(way, colour)
        overlay.label(at, text)
    elif measurement.kind == "height":
        up = np.array(measurement.up)
        corner = points[0] + up * ((points[1] - points[0]) @ up)  # above or below the first, as high as the second
        overlay.polyline([points[0], corner], colour)
        overlay.polyline([corner, points[1]], colour, 1.0)
        overlay.label((points[0] + corner) / 2, text)
    else:
        closed = measurement.kind == "area"
        if closed:
            middle, normal, _ = fitted_plane(points)
            flat = points - np.outer((points - middle) @ normal, normal)
            for a, b in zip(flat, np.roll(flat, -1, axis=0)):  # a fan: polygons need not be convex
                overlay.polygon([flat.mean(axis=0), a, b], colour, 0.22)
        overlay.polyline(points, colour, closed=closed)
        overlay.label(label_place(measurement), text)
    for point in points:
        overlay.marker(point, colour, 4.0)


def draw_begun(overlay: "OverlayCanvas", points: "list[MeasuredPoint]", colour: str) -> None:
    """The points of a measurement that is not ended, what is fitted at them, and a line through them where nothing is."""
    for point in points:
        overlay.marker(point.position, colour, 4.0)
        if point.fit is not None:
            _draw_fit(overlay, point.fit, colour)
    if not any(point.fit for point in points):
        overlay.polyline([point.position for point in points], colour)


def _way(measurement: Measurement) -> np.ndarray | None:
    """(2, 3) the shortest way from the second point to the first plane, of distances from a plane; None of others."""
    if measurement.kind not in ("point to plane", "plane to plane"):
        return None
    first, second = measurement.points
    begin = np.array(second.position) if second.fit is None else on_plane(second)
    assert first.fit is not None
    normal = np.array(first.fit.direction)
    return np.array([begin, begin - ((begin - np.array(first.fit.place)) @ normal) * normal])


def _draw_fit(overlay: "OverlayCanvas", fit: "Fit", colour: str) -> None:
    """The outline of a fitted surface: rings and lines along a pipe, a ring, or a square on a plane and its normal."""
    u, v, axis = frame_of(np.array(fit.direction))
    place = np.array(fit.place)
    if fit.kind == "plane":
        half = fit.high / np.sqrt(2.0)
        overlay.polyline([place + half * (a * u + b * v) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))], colour, closed=True)
        return
    ring = fit.radius * (np.outer(np.cos(_ROUND), u) + np.outer(np.sin(_ROUND), v))
    ends = [0.0] if fit.kind == "circle" else [fit.low, fit.high]
    for end in ends:
        overlay.polyline(place + end * axis + ring, colour, closed=True)
    if fit.kind == "pipe":
        for side in ring[:: len(ring) // _LINES_ALONG]:
            overlay.polyline([place + fit.low * axis + side, place + fit.high * axis + side], colour, 1.0)


class Measurements(Overlay):
    """All measurements of the document."""

    name = "measurements"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        unit = unit_of(context)
        for measurement in context.document.measurements:
            draw_measurement(overlay, measurement, value_text(measurement, unit), "accent")
