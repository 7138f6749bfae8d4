"""The camera path of a document, as cameras: keyframes with times, a spline through them at the pace of the path."""

from dataclasses import replace
from functools import lru_cache

from ...picture.camera import Camera
from ..document import CameraPath
from ..pictures.film_titles import NO_TITLES, FilmTitles, timed_titles
from .pace import Pace

MOST_PREVIEWED = 3000
"""Frames that a preview is sampled at, at most."""


def cameras_along(path: CameraPath, count: int, size: tuple[int, int]) -> list[Camera]:
    """``count`` cameras of ``size`` pixels along the path, at its pace."""
    from .path import interpolate

    return interpolate(_key_cameras(path, size), count, pace_of(path))


def pace_of(path: CameraPath) -> Pace | None:
    """How the camera moves along the path; None where it does not move."""
    seconds = path_seconds(path)
    return Pace(seconds, tuple(key.stay for key in path.keyframes), path.ease) if seconds > 0 else None


def _key_cameras(path: CameraPath, size: tuple[int, int]) -> list[Camera]:
    """The cameras of the keyframes; closed, the first one again."""
    cameras = [key.view.camera(*size) for key in path.keyframes]
    if path.closed and len(cameras) > 1:
        cameras.append(replace(cameras[0], name="again"))
    return cameras


@lru_cache(8)
def preview_cameras(path: CameraPath) -> list[Camera]:
    """Cameras of a small picture, one a frame of the path, at most MOST_PREVIEWED."""
    count = max(2, min(round(path_seconds(path) * path.fps), MOST_PREVIEWED))
    return cameras_along(path, count, (160, 90))


@lru_cache(8)
def passing_seconds(path: CameraPath) -> tuple[float, ...]:
    """Seconds after which the film reaches each keyframe."""
    from .path import passing_shares

    passing, pace = passing_shares(_key_cameras(path, (160, 90))), pace_of(path)
    seconds = passing * 0.0 if pace is None else pace.arrivals(passing)
    return tuple(map(float, seconds))[: len(path.keyframes)]


def titles_along(path: CameraPath, *, panorama: bool = False) -> FilmTitles:
    """The opening title and the captions of the path's film."""
    captions = [key.caption for key in path.keyframes]
    if path.title is None and not any(captions):
        return NO_TITLES
    length = max(1, round(path_seconds(path) * path.fps)) / path.fps  # of whole frames, as `video` has it
    return FilmTitles(timed_titles(path.title, captions, passing_seconds(path), length), path.fps, panorama)


def path_seconds(path: CameraPath) -> float:
    """How long the path takes: to its last keyframe and, closed, on to the first at the same mean pace."""
    if len(path.keyframes) < 2:
        return 0.0
    last = path.keyframes[-1].time - path.keyframes[0].time
    return last * len(path.keyframes) / (len(path.keyframes) - 1) if path.closed else last
