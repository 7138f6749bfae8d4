"""Distances, angles and corners of fitted planes, with their uncertainty.

A fitted plane is known by how far it may be off along its normal at the middle of its piece, and by how far it may be tilted,
which are independent there (viewer.work.fits.fit.Fit).  At a distance r from the middle it may be off by both,
``sqrt(offset^2 + (r tilt)^2)``: what is measured beside a surface is less certain than on it.
Uncertainties: expanded to 95 %; frame: file coordinates, file units; angles in degrees.
"""

import math
from collections.abc import Callable

import numpy as np

from ...picture.clip import Vector, vector
from ..fits.fit import Fit
from .measurement import MeasuredPoint

Found = tuple[float, float, Vector | None]
"""Value, uncertainty, and the place that is the value where it is none."""
_EXPANDED = 2.0  # of a point, as in viewer.work.measuring.values


def beside(plane: Fit, place: np.ndarray) -> float:
    """The uncertainty of a plane along its normal, at a place (3,) on it or not."""
    across = place - np.array(plane.place)
    across -= (across @ np.array(plane.direction)) * np.array(plane.direction)
    return float(np.hypot(plane.offset_uncertainty, np.radians(plane.tilt_uncertainty) * np.linalg.norm(across)))


def on_plane(point: MeasuredPoint) -> np.ndarray:
    """(3,) the foot of a measured point on the plane that was fitted there, without the point's own noise."""
    assert point.fit is not None
    normal, place = np.array(point.fit.direction), np.array(point.position)
    return place - ((place - np.array(point.fit.place)) @ normal) * normal


def _point_to_plane(points: tuple[MeasuredPoint, ...]) -> Found:
    plane, place = _plane(points[0]), np.array(points[1].position)
    value = abs(float((place - np.array(plane.place)) @ np.array(plane.direction)))
    short = 0.0 if points[1].beyond is None else abs(float(np.dot(points[1].beyond, plane.direction)))
    return value, float(np.hypot(beside(plane, place), _EXPANDED * np.sqrt(points[1].variance))) + short, None


def _plane_to_plane(points: tuple[MeasuredPoint, ...]) -> Found:
    """Of the second plane, at its point, from the first one."""
    first, second = _plane(points[0]), _plane(points[1])
    place = on_plane(points[1])
    normal = np.array(first.direction)
    value = abs(float((place - np.array(first.place)) @ normal))
    alike = abs(float(normal @ np.array(second.direction)))
    return value, float(np.hypot(beside(first, place), alike * beside(second, place))), None


def _edge(points: tuple[MeasuredPoint, ...]) -> Found:
    """0..180: a room's wall to its other wall in front of both, or a beam's side to its other side through the beam; 180 of two
    pieces of one plane."""
    return edge_angle(*points), math.hypot(*(_plane(point).tilt_uncertainty for point in points)), None


def edge_angle(first: MeasuredPoint, second: MeasuredPoint) -> float:
    """The angle of the wedge between two planes in which both points lie on the faces, in degrees."""
    one, other = _plane(first), _plane(second)
    normals = [np.array(plane.direction) for plane in (one, other)]
    way = on_plane(second) - on_plane(first)
    sides = [float(normals[0] @ way), float(normals[1] @ -way)]
    # Two pieces of one plane face nothing: what separates them is not more than what is unsure.
    unsure = [beside(one, on_plane(second)) + beside(other, on_plane(second)),
              beside(other, on_plane(first)) + beside(one, on_plane(first))]  # fmt: skip
    if all(abs(side) <= limit for side, limit in zip(sides, unsure, strict=True)):
        sides = [1.0, float(normals[0] @ normals[1])]
    a, b = (normal if side >= 0 else -normal for normal, side in zip(normals, sides, strict=True))
    return 180.0 - float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _corner(points: tuple[MeasuredPoint, ...]) -> Found:
    """Each plane gives one equation n x = n c.  Its error moves the corner along a column of the inverse; the errors of three
    planes are independent."""
    planes = [_plane(point) for point in points]
    middle = np.mean([plane.place for plane in planes], axis=0)  # numbers near 0: map coordinates cost digits
    normals = np.array([plane.direction for plane in planes])
    heights = np.array([np.array(plane.direction) @ (np.array(plane.place) - middle) for plane in planes])
    inverse = np.linalg.inv(normals)
    place = middle + inverse @ heights
    moves = inverse * [beside(plane, place) for plane in planes]
    return 0.0, float(np.linalg.norm(moves, 2)), vector(place)


def _plane(point: MeasuredPoint) -> Fit:
    assert point.fit is not None and point.fit.kind == "plane"
    return point.fit


OF_PLANES: dict[str, Callable[[tuple[MeasuredPoint, ...]], Found]] = {
    "point to plane": _point_to_plane,
    "plane to plane": _plane_to_plane,
    "edge": _edge,
    "corner": _corner,
}
"""How each kind of viewer.work.measuring.measurement.KINDS is computed that is of planes."""
