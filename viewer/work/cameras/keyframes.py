"""The camera path of a document, as cameras: keyframes with times, a spline through them at constant speed."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from ...picture.camera import Camera
from ..document import CameraPath, Keyframe

MOST_PREVIEWED = 3000
"""Frames that a preview is sampled at, at most."""


def cameras_along(keys: Sequence[Keyframe], count: int, size: tuple[int, int], *, closed: bool = False) -> list[Camera]:
    """``count`` cameras of ``size`` pixels along the path through keyframes, at constant speed."""
    from .path import interpolate

    cameras = [key.view.camera(*size) for key in keys]
    if closed and len(cameras) > 1:
        cameras.append(replace(cameras[0], name="again"))
    return interpolate(cameras, count)


@lru_cache(8)
def preview_cameras(path: CameraPath) -> list[Camera]:
    """Cameras of a small picture, one a frame of the path, at most MOST_PREVIEWED."""
    count = max(2, min(round(path_seconds(path) * path.fps), MOST_PREVIEWED))
    return cameras_along(path.keyframes, count, (160, 90), closed=path.closed)


@lru_cache(8)
def passing_seconds(path: CameraPath) -> tuple[float, ...]:
    """Seconds after which the film passes each keyframe: the camera moves at constant speed."""
    from .path import passing_shares

    cameras = [key.view.camera(160, 90) for key in path.keyframes]
    if path.closed and len(cameras) > 1:
        cameras.append(replace(cameras[0], name="again"))
    return tuple(path_seconds(path) * float(share) for share in passing_shares(cameras))[: len(path.keyframes)]


def path_seconds(path: CameraPath) -> float:
    """How long the path takes: to its last keyframe and, closed, on to the first at the same mean pace."""
    if len(path.keyframes) < 2:
        return 0.0
    last = path.keyframes[-1].time - path.keyframes[0].time
    return last * len(path.keyframes) / (len(path.keyframes) - 1) if path.closed else last
