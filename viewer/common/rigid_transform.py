"""Rigid transformations: a rotation and a shift, as four rows of four numbers.

A transformation leads from one frame to another: ``x' = R x + t``, with R in the first three columns and t in the last.
float64 throughout; the shift has the unit of the coordinates.
"""

import math

import numpy as np

from .errors import InputError

Row = tuple[float, float, float, float]
Rows = tuple[Row, Row, Row, Row]
"""A 4 x 4 matrix by rows; it can be compared, hashed and written as JSON."""

IDENTITY: Rows = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
TOLERANCE = 1e-6
"""How far R times its transpose may be from the identity, per entry: a matrix that was written with 7 digits is accepted."""
_FARTHEST = 1e12
"""Largest shift, units: coordinates beyond it have steps above 0.1 mm in float64."""


def rows_of(matrix: np.ndarray) -> Rows:
    """A (4, 4) array as rows of plain numbers."""
    a, b, c, d = (tuple(float(value) for value in row) for row in np.asarray(matrix, np.float64))
    return a, b, c, d  # type: ignore[return-value]


def rigid(rotation: np.ndarray, shift: np.ndarray) -> Rows:
    """The transformation of a (3, 3) rotation, which is applied first, and a (3,) shift."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift
    return rows_of(matrix)


def turned_about(rotation: np.ndarray, place: np.ndarray) -> Rows:
    """The (3, 3) rotation about a (3,) place, which stays where it is."""
    return rigid(rotation, place - rotation @ place)


def check_rigid(rows: Rows, what: str) -> None:
    """Raises InputError, beginning with ``what``, unless the matrix is finite and rigid: no scale, shear or mirror image."""
    matrix = np.array(rows, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or np.abs(matrix[:3, 3]).max() > _FARTHEST:
        raise InputError(f"{what}: expected 4 rows of 4 finite numbers")
    rotation = matrix[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers whose squares are not finite
        wrong = float(np.nan_to_num(np.abs(rotation @ rotation.T - np.eye(3)), nan=np.inf).max())
    if wrong > TOLERANCE or np.abs(matrix[3] - IDENTITY[3]).max() > 0.0 or np.linalg.det(rotation) < 0:
        raise InputError(f"{what}: is not rigid (a rotation and a shift, last row 0 0 0 1; off by {wrong:.2g})")


def moved_points(rows: Rows, xyz: np.ndarray) -> np.ndarray:
    """(n, 3) float64: points after the transformation; values that are not finite stay so."""
    x, y, z = np.asarray(xyz, np.float64).T
    moved = np.empty((len(x), 3))
    with np.errstate(invalid="ignore", over="ignore"):
        for axis, (a, b, c, shift) in enumerate(rows[:3]):  # not by BLAS, whose last bit depends on how many points there are
            moved[:, axis] = a * x + b * y + c * z + shift
    return moved


def turned_directions(rows: Rows, directions: np.ndarray) -> np.ndarray:
    """(n, 3) float64: directions after the transformation, which its shift does not change."""
    return np.asarray(directions, np.float64) @ np.array(rows)[:3, :3].T


def combined(later: Rows, earlier: Rows) -> Rows:
    """First ``earlier``, then ``later``, as one."""
    return rows_of(np.array(later) @ np.array(earlier))


def inverse(rows: Rows) -> Rows:
    """The transformation back."""
    rotation, shift = np.array(rows)[:3, :3], np.array(rows)[:3, 3]
    return rigid(rotation.T, -(rotation.T @ shift))


def turn_in_degrees(rows: Rows) -> float:
    """The angle of the rotation about its own axis, 0..180."""
    rotation = np.array(rows)[:3, :3]
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return math.degrees(math.atan2(float(np.linalg.norm(axis)), float(np.trace(rotation)) - 1.0))


def motion_text(rows: Rows, middle: np.ndarray) -> str:
    """A transformation in words: "turned 12.3456 degrees, shifted by 1.000, 2.000, 3.000 at the middle".

    middle: (3,) of the scene, where the transformation leads to.  The shift of the origin, which is in the matrix, is
    kilometres for a small turn at map coordinates.
    """
    place = np.asarray(middle, np.float64)[None]
    shift = ", ".join(f"{value:.3f}" for value in (place - moved_points(inverse(rows), place))[0])
    return f"turned {turn_in_degrees(rows):.4f} degrees, shifted by {shift} at the middle"


def rotation_about(axis: np.ndarray, degrees: float) -> np.ndarray:
    """(3, 3): the rotation about a (3,) axis of any length above 0, counterclockwise seen from its tip (Rodrigues)."""
    x, y, z = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.radians(degrees)
    return np.eye(3) + math.sin(angle) * across + (1.0 - math.cos(angle)) * across @ across


def rotation_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(3, 3): the smallest rotation that turns one direction (3,) to another."""
    a, b = (np.asarray(way, np.float64) / np.linalg.norm(way) for way in (first, second))
    axis = np.cross(a, b)
    if float(np.linalg.norm(axis)) < 1e-15:  # parallel, or opposite: about any axis across
        return np.eye(3) if a @ b > 0 else rotation_about(np.cross(a, np.eye(3)[np.argmin(np.abs(a))]), 180.0)
    return rotation_about(axis, math.degrees(math.atan2(float(np.linalg.norm(axis)), float(a @ b))))
