"""What the camera formats share: text, numbers, rotations, and errors of one line that name file, frame and value.

``where`` is always the beginning of such a line: the file, then the line or frame.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...common.errors import InputError
from ...picture.camera import Camera

TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Camera axes: OpenCV (x right, y down, z forward) <-> OpenGL (x right, y up, -z forward)."""


class Lens(NamedTuple):
    """Everything about a camera but its pose.  Pixels; sizes whole, but still as the file's floats."""

    width: float
    height: float
    fx: float
    fy: float
    cx: float
    cy: float


def read_text(path: Path) -> str:
    """The file's text, a byte order mark taken off.  Raises InputError."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("not a text file", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None


def shown(value: object) -> str:
    """A value from a file, short and on one line."""
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    text = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return text if len(text) <= 60 else text[:57] + "..."


def numbers(values: object, count: int, where: str) -> np.ndarray:
    """(count,) float64, all finite, from numbers or their text; nested lists are flattened."""
    expected = "a number" if count == 1 else f"{count} numbers"
    try:
        if values is None:
            raise TypeError
        array = np.asarray(values, np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{where}: expected {expected}, got {shown(values)}") from None
    if array.size != count:
        raise InputError(f"{where}: expected {expected}, got {array.size}: {shown(values)}")
    if not np.isfinite(array).all():
        raise InputError(f"{where}: holds a value that is not finite ({array[~np.isfinite(array)][0]})")
    return array


def json_numbers(values: object, count: int, where: str) -> np.ndarray:
    """(count,) float64, all finite, from JSON: a list of numbers, or of rows of them.

    NumPy takes true for 1 and "5" for 5; in a camera file either is a mistake.
    """
    rows = values if isinstance(values, list) else [None]
    flat = [value for row in rows for value in (row if isinstance(row, list) else [row])]
    if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in flat):
        raise InputError(f"{where}: expected {count} numbers, got {shown(values)}")
    return numbers(flat, count, where)


def number(entry: dict, key: str, where: str) -> float:
    """``entry[key]``, from JSON, as a finite number; no boolean, text or list."""
    if key not in entry:
        raise InputError(f"{where}: {key} is missing")
    value = entry[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f"{where}: {key}: expected a number, got {shown(value)}")
    return float(numbers(value, 1, f"{where}: {key}")[0])


def pose_matrix(values: object, where: str) -> np.ndarray:
    """(4, 4) float64, row-major; the last row must be 0 0 0 1, or a column-major matrix would lose its position."""
    matrix = json_numbers(values, 16, where).reshape(4, 4)
    if np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-6:
        raise InputError(f"{where}: its last row is {shown(matrix[3].tolist())}, expected 0, 0, 0, 1 (row-major)")
    return matrix


def rotation(quaternion: np.ndarray, where: str) -> np.ndarray:
    """(3, 3) from w, x, y, z of any length above 0."""
    largest = np.abs(quaternion).max()
    if not largest > 1e-9:
        raise InputError(f"{where}: the quaternion {shown(quaternion.tolist())} (w, x, y, z) is zero")
    from scipy.spatial.transform import Rotation

    scaled = quaternion / largest  # to size 1: squares must neither vanish nor overflow
    return Rotation.from_quat(np.roll(scaled, -1)).as_matrix()  # x, y, z, w


def camera(where: str, lens: Lens, camera_to_world: np.ndarray, name: str) -> Camera:
    """A camera (camera_to_world in OpenGL axes) whose errors begin with ``where``."""
    try:
        width, height = (int(v) if v == int(v) else float(v) for v in lens[:2])
        return Camera(width, height, *(float(v) for v in lens[2:]), camera_to_world, name)  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def checked(where: str, lens: Lens) -> Lens:
    """``lens``, refused here, where it was written, rather than at the first pose that uses it."""
    camera(where, lens, np.eye(4), "")
    return lens
