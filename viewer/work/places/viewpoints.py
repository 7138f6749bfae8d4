"""The cameras of benches and of `evaluate`: eight named views of a scan, and a smooth path of 48 frames through it.

Those of the demo scan are shipped (assets/demo_cameras.json; the path is a curve through them).  Those of any other scan depend
on the scan alone: from the start viewpoint (at a scanner, otherwise where most was measured at eye height) four
directions, the floor and a close-up, then a view from a corner of the bounds and one from afar.
Frame: file coordinates, world up = +z.
"""

import itertools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...picture.camera import Camera, from_fov, look_at
from .standing_place import FIELD_OF_VIEW, OUTSIDE_DIRECTION, overview_position, sample_scene, view_axes
from .start_view import standing_view

if TYPE_CHECKING:
    from ...grid.scene import Scene

PATH_FRAMES = 48
CORNER_FIELD = 90.0
"""Degrees, vertical; from a corner of a box everything in it is within 90 degrees across."""
_FAR = 2.0  # times the distance from which everything is in view
_REST = 0.6  # of the free way ahead is walked
_SWAY = np.radians(50.0)


def named_views(scene: "Scene", size: tuple[int, int]) -> list[Camera]:
    """Eight cameras, named after what they look at.  size: width, height in pixels."""
    shipped = _shipped(scene, size)
    if shipped:
        return shipped
    seen = sample_scene(scene)
    aspect = size[0] / size[1]
    view = standing_view(scene, seen)
    if view is None:
        outside = np.array(OUTSIDE_DIRECTION)
        view = overview_position(seen, aspect, outside), outside
    place, ahead = view[0], -view_axes(view[1])[:, 2]
    inside = bool(((place > seen.low) & (place < seen.high)).all())
    flat = np.array([ahead[0], ahead[1], 0.0])
    flat /= np.linalg.norm(flat) or 1.0
    right = np.array([flat[1], -flat[0], 0.0])
    middle = (seen.low + seen.high) / 2
    stops: list[tuple[str, np.ndarray, np.ndarray]] = []
    for name, direction in (("ahead", flat), ("right", right), ("behind", -flat), ("left", -right)):
        if inside:
            stops.append((f"place-{name}", place, place + direction - (0, 0, 0.04)))
        else:  # nowhere to stand: views from around it
            eye = overview_position(seen, aspect, direction - (0, 0, 0.4))
            stops.append((f"around-{name}", eye, middle))
    surface = _nearest_ahead(seen.points, place, flat if inside else ahead)
    eye = place if inside else overview_position(seen, aspect, np.array([0.0, 0.0, -1.0]))
    stops.append(("down", eye, eye + flat - (0, 0, 1.0)))
    stops.append(("close", surface + 0.2 * (place - surface), surface))
    away = overview_position(seen, aspect, ahead - (0, 0, 0.35))
    stops.append(("far", middle + _FAR * (away - middle), middle))
    views = [from_fov(*size, FIELD_OF_VIEW, look_at(a, b), name) for name, a, b in stops]
    views.insert(6, _corner(seen.points, seen.low, seen.high, size))
    return views


def camera_path(scene: "Scene", size: tuple[int, int], frames: int = PATH_FRAMES) -> list[Camera]:
    """``frames`` cameras along a smooth path through the scan: position and direction change evenly and without a jump."""
    shipped = _shipped(scene, size)
    if shipped:
        return _curve(shipped, frames)
    seen = sample_scene(scene)
    views = {view.name: view for view in named_views(scene, size)}
    share = np.linspace(0, 1, frames)
    eased = share * share * (3 - 2 * share)
    if "place-ahead" in views:
        first = views["place-ahead"]
        way = _nearest_ahead(seen.points, first.position, first.forward) - first.position
        reach = _REST * float(way @ first.forward)
        facing = np.arctan2(first.forward[1], first.forward[0])
        turns = facing + _SWAY * np.sin(2 * np.pi * share)
        eyes = [first.position + e * reach * first.forward for e in eased]
        targets = [eye + (np.cos(t), np.sin(t), -0.04) for eye, t in zip(eyes, turns, strict=True)]
    else:  # a quarter of a turn around it, coming nearer
        middle = (seen.low + seen.high) / 2
        arm = views["around-ahead"].position - middle
        eyes = []
        for e in eased:
            c, s = np.cos(e * np.pi / 2), np.sin(e * np.pi / 2)
            eyes.append(middle + (1 - 0.5 * e) * np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], arm[2]]))
        targets = [middle] * frames
    return [from_fov(*size, FIELD_OF_VIEW, look_at(eye, target), f"path{n:02d}")
            for n, (eye, target) in enumerate(zip(eyes, targets, strict=True))]


def _shipped(scene: "Scene", size: tuple[int, int]) -> list[Camera]:
    """The demo scan's cameras, if it is that."""
    from ...common.paths import assets_dir
    from ..cameras.camera_files import read_cameras

    if [Path(s) for s in scene.meta.sources] != [(assets_dir() / "demo.laz").absolute()]:
        return []
    return read_cameras(assets_dir() / "demo_cameras.json", size=size)


def _gap(a: Camera, b: Camera) -> float:
    """The distance between two cameras: file units and radians, added."""
    return float(np.linalg.norm(b.position - a.position) + np.arccos(np.clip(a.forward @ b.forward, -1, 1)))


def _in_turn(stops: list[Camera]) -> list[Camera]:
    """The cameras from the first on, each followed by the nearest of those left."""
    order, left = [stops[0]], stops[1:]
    while left:
        nearest = min(left, key=lambda stop: _gap(order[-1], stop))
        left = [stop for stop in left if stop is not nearest]
        order.append(nearest)
    return order


def _curve(stops: list[Camera], frames: int) -> list[Camera]:
    """A curve through the cameras, in an order that turns little."""
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, RotationSpline

    stops = _in_turn(stops)
    gaps = [max(_gap(a, b), 1e-6) for a, b in itertools.pairwise(stops)]
    times = np.concatenate([[0.0], np.cumsum(gaps)])  # so that no stretch is rushed
    places = CubicSpline(times, [stop.position for stop in stops])
    turns = RotationSpline(times, Rotation.from_matrix([stop.camera_to_world[:3, :3] for stop in stops]))
    fields = CubicSpline(times, [stop.vertical_fov for stop in stops])
    out = []
    for number, t in enumerate(np.linspace(0, times[-1], frames)):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turns(t).as_matrix(), places(t)
        field = float(np.clip(fields(t), 30.0, 90.0))
        out.append(from_fov(stops[0].width, stops[0].height, field, pose, f"path{number:02d}"))
    return out


def _corner(points: np.ndarray, low: np.ndarray, high: np.ndarray, size: tuple[int, int]) -> Camera:
    """A camera at that upper corner of the bounds from which most points are in the picture, looking at the middle."""
    best, most = None, -1
    for x in (0, 1):
        for y in (0, 1):
            eye = np.array([(low, high)[x][0], (low, high)[y][1], high[2]])
            camera = from_fov(*size, CORNER_FIELD, look_at(eye, (low + high) / 2), "corner")
            held = in_picture(camera, points)
            if held > most:
                best, most = camera, held
    assert best is not None
    return best


def in_picture(camera: Camera, points: np.ndarray) -> int:
    """How many of the points (N, 3), file coordinates, lie in front of the camera and inside its picture."""
    x, y, z = (camera.view_rotation @ (points - camera.position).T)
    with np.errstate(all="ignore"):
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    return int(((z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)).sum())


def _nearest_ahead(points: np.ndarray, eye: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """(3,) a point ahead of ``eye``: at the median distance of the points within 10 degrees, which ignores outlier points."""
    away = points - eye
    far = np.linalg.norm(away, axis=1)
    along = away @ ahead
    met = far[along > np.cos(np.radians(10.0)) * far]
    met = met[met > 0]
    return eye + ahead * (float(np.median(met)) if len(met) else float(np.median(far)) or 1.0)
