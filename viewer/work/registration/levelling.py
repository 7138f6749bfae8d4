"""Levelling a scan to its floor, and turning it about the vertical, as to north or along a wall.

Frame: file coordinates, file units, float64; the vertical is +z unless given.  Angles in degrees; a bearing is clockwise from
the y axis, which leads north in maps.
"""

import math

import numpy as np

from ...common.errors import InputError
from ...common.rigid_transform import Rows, rigid, rotation_about, rotation_between, turned_about

UPRIGHT = np.array([0.0, 0.0, 1.0])
STEEPEST = 45.0
"""Degrees: a plane tilted further is not taken for a floor, but for a wall or a roof."""
_STEEPEST_LINE = 80.0
"""Degrees: two points whose line is steeper say nothing about a bearing."""


def plane_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle (3,) and unit normal (3,) of the plane nearest to (n, 3) points, n >= 3.

    Raises InputError where they lie on a line, or in no plane."""
    points = np.asarray(points, np.float64)
    if len(points) < 3:
        raise InputError("a plane needs three points or more")
    middle = points.mean(axis=0)
    _, (length, width, depth), axes = np.linalg.svd(points - middle, full_matrices=False)
    if not width > 1e-3 * length:
        raise InputError("the points lie on a line; a plane needs one beside it")
    if depth > 0.5 * width:
        raise InputError("the points lie in no plane; choose them on the floor")
    return middle, axes[2]


def levelled(place: np.ndarray, normal: np.ndarray, up: np.ndarray = UPRIGHT) -> Rows:
    """The smallest rotation that makes a plane horizontal, about a (3,) place on it.  normal: (3,) of the plane, to either
    side.

    Raises InputError where the plane is steeper than STEEPEST, and so is no floor.
    """
    normal = np.asarray(normal, np.float64) / np.linalg.norm(normal)
    up = np.asarray(up, np.float64) / np.linalg.norm(up)
    normal = normal if normal @ up >= 0 else -normal
    tilt = math.degrees(math.acos(min(1.0, float(normal @ up))))
    if tilt > STEEPEST:
        raise InputError(f"the plane is tilted by {tilt:.0f} degrees: no floor", remedy="choose a plane that is nearly level")
    return turned_about(rotation_between(normal, up), np.asarray(place, np.float64))


def set_bearing(first: np.ndarray, second: np.ndarray, bearing: float) -> Rows:
    """The rotation about the vertical through ``first`` that gives the line from there to ``second``, both (3,), a bearing.

    bearing: degrees clockwise from the y axis (0 north, 90 east).  Raises InputError where the line is almost vertical.
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    x, y, z = second - first
    if math.hypot(x, y) <= abs(z) / math.tan(math.radians(_STEEPEST_LINE)):
        raise InputError("the line between both points is almost vertical and has no bearing",
                         remedy="choose two points of about the same height")
    return turned_about(rotation_about(UPRIGHT, math.degrees(math.atan2(x, y)) - bearing), first)


def by_numbers(shift: tuple[float, float, float], degrees: float, about: np.ndarray, up: np.ndarray = UPRIGHT) -> Rows:
    """A turn about the vertical through ``about`` (3,), counterclockwise seen from above, and then a shift (x, y, z)."""
    rotation, about = rotation_about(up, degrees), np.asarray(about, np.float64)
    return rigid(rotation, about - rotation @ about + np.asarray(shift, np.float64))
