"""Cameras from Python: placed by hand, read from a file, written to one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from ..picture.camera import Camera, from_fov
from ..picture.camera import look_at as _pose
from .arguments import PathLike, path_of, python_names, vector_of

_BACK = 1000.0
"""Heights of an orthographic picture that the camera stands back: depths in float32 are exact to 0.06 pixels of a thousand."""


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
        raise InputError("expected (width, height) in pixels, such as (960, 720)", option="size", value=size) from None
    try:
        degrees = float(fov)
    except (TypeError, ValueError):
        raise InputError("expected degrees above 0 and below 180", option="fov", value=fov) from None
    Camera(width, height, 1, 1, 0, 0, np.eye(4), name)  # refuses a bad size in words before anything is computed from it
    with python_names():
        return from_fov(width, height, degrees, _pose(*places, axis), name)


def orthographic(
    target: npt.ArrayLike,
    *,
    direction: npt.ArrayLike = (0.0, 0.0, -1.0),
    up: npt.ArrayLike | None = None,
    height: float,
    back: float | None = None,
    size: tuple[int, int] = (960, 720),
    name: str = "",
) -> Camera:
    """A camera whose rays are parallel: a plan, an elevation or an isometric view, to one scale everywhere.

    target: (3,) file coordinates, the middle of the picture.  direction: (3,) of view; straight down is a plan.  up: (3,) the
    direction that is upward in the picture; None: the file's z, of a plan its y.  height: file units from the picture's top
    edge to its bottom edge.  back: file units from the target to the plane across the line of sight in front of which nothing
    is drawn; None: far enough for scenes that are not more than a thousand heights deep.  size: (width, height) in pixels.
    Raises InputError naming the first bad value.
    """
    place, ahead = vector_of("target", target), vector_of("direction", direction)
    if not ahead.any():
        raise InputError("direction [0, 0, 0]: expected a direction, such as (0, 0, -1)")
    ahead = ahead / np.linalg.norm(ahead)
    usual = (0.0, 1.0, 0.0) if np.hypot(*ahead[:2]) < 1e-9 else (0.0, 0.0, 1.0)
    upward = vector_of("up", usual if up is None else up)
    if np.linalg.norm(np.cross(upward, ahead)) < 1e-9 * max(float(np.linalg.norm(upward)), 1e-300):
        raise InputError(f"up {upward.tolist()} is along the direction of view {ahead.tolist()}; expected another direction")
    for option, value in (("height", height), ("back", 1.0 if back is None else back)):
        if not isinstance(value, (int, float, np.integer, np.floating)) or not 0 < float(value) < np.inf:
            raise InputError("expected file units above 0", option=option, value=value)
    away = _BACK * float(height) if back is None else float(back)
    seen = look_at(place - ahead * away, place, up=upward, fov=60.0, size=size, name=name)
    with python_names():
        return replace(seen, orthographic=float(height) * seen.fy / seen.height)


def read_cameras(path: PathLike, *, size: tuple[int, int] | None = None) -> list[Camera]:
    """The cameras of a file: nerfstudio transforms.json or camera_path.json, a COLMAP folder, a TUM trajectory.

    size: (width, height) every camera is resized to.  Raises InputError, one line with file, frame and value.
    """
    from ..work.cameras.camera_files import read_cameras as read

    with python_names():
        return read(path_of(path), size=size)


def write_cameras(
    path: PathLike, cameras: Camera | Iterable[Camera], *, format: Literal["transforms", "camera_path"] | None = None
) -> None:
    """Writes cameras as nerfstudio's JSON, from which :func:`read_cameras` and ``render --cameras`` read them; an existing file
    is replaced, in one step.

    format: transforms: transforms.json, which holds every camera as it is; camera_path: camera_path.json, as ``video --path``
    takes it, for cameras of one size with square pixels and the principal point in the middle.  None: camera_path where the
    file's name contains it, else transforms.
    Names are read back where they are file names, each once; others are changed by :func:`read_cameras`.
    Raises InputError naming the first camera that the format cannot hold.
    """
    from ..work.cameras.camera_files import write_camera_path, write_transforms

    file = path_of(path)
    listed = [cameras] if isinstance(cameras, Camera) else list(cameras)
    for camera in listed:
        if not isinstance(camera, Camera):
            raise InputError(f"{camera!r}: expected a pointglass.Camera", option="cameras")
    chosen = format or ("camera_path" if "camera_path" in file.name else "transforms")
    if chosen not in ("transforms", "camera_path"):
        raise InputError("expected transforms, camera_path or None", option="format", value=format)
    try:
        (write_camera_path if chosen == "camera_path" else write_transforms)(file, listed)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=file) from None
