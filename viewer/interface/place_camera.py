"""Cameras from Python: placed by hand, or read from a file."""

import numpy as np
import numpy.typing as npt

from ..camera import Camera, from_fov
from ..camera import look_at as _pose
from ..errors import InputError
from .arguments import PathLike, path_of, vector_of


def look_at(
    eye: npt.ArrayLike,
    target: npt.ArrayLike,
    *,
    up: npt.ArrayLike = (0.0, 0.0, 1.0),
    fov: float = 60.0,
    size: tuple[int, int] = (960, 720),
    name: str = "",
) -> Camera:
    """A camera at ``eye`` that looks at ``target``, with square pixels and the principal point in the middle.

    eye, target: (3,) file coordinates.  up: (3,) the direction that is upward in the picture.  fov: vertical field of view in
    degrees, above 0 and below 180.  size: (width, height) in pixels.  Raises InputError naming the first bad value.
    """
    places = vector_of("eye", eye), vector_of("target", target)
    if np.array_equal(*places):
        raise InputError(f"eye and target are both {places[0].tolist()}; a camera needs a direction to look in")
    axis = vector_of("up", up)
    if not axis.any():
        raise InputError("up [0, 0, 0]: expected a direction, such as (0, 0, 1)")
    try:
        width, height = size
    except (TypeError, ValueError):
        raise InputError(f"size {size!r}: expected (width, height) in pixels, such as (960, 720)") from None
    try:
        degrees = float(fov)
    except (TypeError, ValueError):
        raise InputError(f"field of view {fov!r}: expected degrees above 0 and below 180") from None
    Camera(width, height, 1, 1, 0, 0, np.eye(4), name)  # refuses a bad size in words before anything is computed from it
    return from_fov(width, height, degrees, _pose(*places, axis), name)


def read_cameras(path: PathLike, *, size: tuple[int, int] | None = None) -> list[Camera]:
    """The cameras of a file: nerfstudio transforms.json or camera_path.json, a COLMAP folder, a TUM trajectory.

    size: (width, height) every camera is resized to.  Raises InputError, one line with file, frame and value.
    """
    from ..tools.camera_files import read_cameras as read

    return read(path_of(path), size=size)
