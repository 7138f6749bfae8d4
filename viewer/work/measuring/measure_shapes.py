"""What a measurement looks like: lines, rings and points in file coordinates, drawn over the picture and written to CAD files.

A helper line explains the value, and is no measured thing itself: the foot of a height, the wall of a pipe.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..fits.fit import Fit
from ..fits.surfaces import frame_of
from .measurement import Measurement
from .planes import on_plane
from .values import evaluate, fitted_plane

_TURN = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
_LINES_ALONG = 4
"""Along a pipe."""


@dataclass(frozen=True, eq=False)
class Line:
    """points: (n, 3)."""

    points: np.ndarray
    closed: bool = False
    helper: bool = False


@dataclass(frozen=True, eq=False)
class Ring:
    """A circle.  centre: (3,).  axis: (3,) unit vector."""

    centre: np.ndarray
    axis: np.ndarray
    radius: float

    @property
    def points(self) -> np.ndarray:
        """(48, 3) on it, at even steps."""
        u, v, _ = frame_of(self.axis)
        return self.centre + self.radius * (np.outer(np.cos(_TURN), u) + np.outer(np.sin(_TURN), v))


@dataclass(frozen=True, eq=False)
class Shapes:
    """label: (3,) where the value is written.  area: (n, 3) the corners of a polygon, projected on its plane; None without.
    place: (3,) the place that a measurement has found; None without.  points: (n, 3) those that were clicked."""

    label: np.ndarray
    lines: list[Line] = field(default_factory=list)
    rings: list[Ring] = field(default_factory=list)
    area: np.ndarray | None = None
    place: np.ndarray | None = None
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))


def shapes_of(measurement: Measurement) -> Shapes:
    """The shapes of a measurement."""
    points = np.array([point.position for point in measurement.points], np.float64)
    lines, rings = shapes_of_fits(measurement.fits)
    if measurement.fit is None:  # the planes are not the measurement, but what it was made from
        lines = [replace(line, helper=True) for line in lines]
    kind, middle = measurement.kind, points.mean(axis=0)
    if measurement.kind == "corner":
        at = np.array(evaluate(measurement).place)
        return Shapes(at, [*lines, *(Line(np.array([at, point]), helper=True) for point in points)], rings, None, at, points)
    if kind in ("point to plane", "plane to plane"):
        way = _way(measurement)
        return Shapes(way.mean(axis=0), [*lines, Line(way)], rings, points=points)
    if measurement.fits:
        return Shapes(middle, lines, rings, points=points)
    if kind == "height":
        up = np.array(measurement.up)
        corner = points[0] + up * ((points[1] - points[0]) @ up)  # above or below the first, as high as the second
        lines = [Line(np.array([points[0], corner])), Line(np.array([corner, points[1]]), helper=True)]
        return Shapes((points[0] + corner) / 2, lines, points=points)
    if (volume := measurement.volume) is not None:
        up, place = np.array(measurement.up), np.array(volume.place)
        base = points - np.outer((points - place) @ (up + volume.slope), up)  # along the up axis, onto the base
        return Shapes(place, [Line(points, closed=True), Line(base, closed=True, helper=True)], area=base, points=points)
    if measurement.profile is not None:
        line = profile_line(measurement)
        return Shapes(line[len(line) // 2], [Line(line), Line(points, helper=True)], points=points)
    if kind == "area":
        at, normal, _ = fitted_plane(points)
        flat = points - np.outer((points - at) @ normal, normal)
        return Shapes(middle, [Line(points, closed=True)], area=flat, points=points)
    label = {"angle": points[1] if kind == "angle" else middle, "polyline": points[-1]}.get(kind, middle)
    return Shapes(label, [Line(points)], points=points)


def shapes_of_fits(fits: list[Fit]) -> tuple[list[Line], list[Ring]]:
    """The outlines of fitted surfaces: rings and lines along a pipe, a ring, a square on a plane."""
    lines, rings = [], []
    for fit in fits:
        u, v, axis = frame_of(np.array(fit.direction))
        place = np.array(fit.place)
        if fit.kind == "plane":
            half = fit.high / np.sqrt(2.0)
            corners = [place + half * (a * u + b * v) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
            lines.append(Line(np.array(corners), closed=True))
            continue
        ends = [0.0] if fit.kind == "circle" else [fit.low, fit.high]
        rings += [Ring(place + end * axis, axis, fit.radius) for end in ends]
        if fit.kind == "pipe":
            sides = rings[-1].points[:: len(_TURN) // _LINES_ALONG]
            lines += [Line(np.array([side, side - (fit.high - fit.low) * axis]), helper=True) for side in sides]
    return lines, rings


def profile_line(measurement: Measurement) -> np.ndarray:
    """(n, 3) the places of a profile, file coordinates: above or below the line between its ends."""
    profile, up = measurement.profile, np.array(measurement.up)
    assert profile is not None
    first, second = (np.array(point.position) for point in measurement.points)
    level = (second - first) - ((second - first) @ up) * up
    level /= max(float(np.linalg.norm(level)), 1e-300)
    foot = first - (first @ up) * up
    return foot + np.outer(profile.stations, level) + np.outer(profile.heights, up)


def _way(measurement: Measurement) -> np.ndarray:
    """(2, 3) the shortest way from the second point, on its plane where it has one, to the first plane."""
    first, second = measurement.points
    begin = np.array(second.position) if second.fit is None else on_plane(second)
    assert first.fit is not None
    normal = np.array(first.fit.direction)
    return np.array([begin, begin - ((begin - np.array(first.fit.place)) @ normal) * normal])
