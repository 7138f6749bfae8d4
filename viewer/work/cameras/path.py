"""A camera path: a smooth curve through keyframes, sampled at one camera a video frame.

Position and field of view follow a cubic spline through the keyframes, the direction a rotation spline with continuous angular
velocity (scipy's RotationSpline); the parameter is centripetal (square root of the distance), which makes no loops between
unevenly spaced keyframes (Yuksel et al. 2011).  The curve is then sampled at constant speed, or at that of a pace
(viewer.work.cameras.pace): equal distances from frame to frame, except where the camera turns much faster than on average along
the path, and slows down.

Frame: file coordinates, camera_to_world with OpenGL camera axes.
"""

from collections.abc import Sequence

import numpy as np

from ...common.errors import InputError, Option
from ...picture.camera import Camera
from .pace import Pace

DENSE = 256
"""Samples of the curve between two keyframes, from which its length is summed."""
AROUND = 5
"""Keyframes of a closed path that are repeated beyond its ends: what lies further away bends a cubic spline by less than a
thousandth (0.27 a keyframe)."""
TURN_SHARE = 0.5
"""A turn counts as movement where it is faster than 1 / TURN_SHARE times the path's average turn a distance."""
_NO_TURN = 1e-4
"""Radians along a whole path below which its direction is the same throughout."""
_STILL = 1e-12
"""Share of the path's extent below which two positions are the same."""


def interpolate(keys: Sequence[Camera], count: int, pace: Pace | None = None) -> list[Camera]:
    """``count`` cameras along the smooth path through ``keys``, named ``frame_00000`` onwards.

    keys: one or more cameras of one size; lenses may differ.  pace: None: constant.  The first and last frames are the first
    and last keyframes, to rounding.  Raises InputError where sizes differ.
    """
    if count < 1:
        raise InputError(f"{count} frames: a path has at least one", remedy=("choose a longer ", Option("--seconds")))
    first = keys[0]
    for key in keys:
        if (key.width, key.height) != (first.width, first.height):
            raise InputError(f"camera path: keyframe {key.name!r} is {key.width}x{key.height}, the first "
                             f"{first.width}x{first.height}", remedy=("give ", Option("--size")))
    if len(keys) == 1 or count == 1:
        return [_named(first, number) for number in range(count)]
    curve = _Curve(keys)
    return curve.cameras(curve.even(count) if pace is None or pace.constant else curve.paced(count, pace))


def passing_shares(keys: Sequence[Camera]) -> np.ndarray:
    """(K,) share of the film, 0 to 1, after which it passes each of K keyframes."""
    if len(keys) < 2:
        return np.zeros(len(keys))
    return _Curve(keys).passing()


def _around(keys: Sequence[Camera]) -> int:
    """Keyframes beyond either end that the splines see of a path that ends where it begins: it then has no bend there."""
    closed = len(keys) > 2 and np.array_equal(keys[0].camera_to_world, keys[-1].camera_to_world)
    return min(AROUND, len(keys) - 1) if closed else 0


class _Curve:
    """The spline through the keyframes over its parameter u from 0 to 1."""

    def __init__(self, keys: Sequence[Camera]):
        from scipy.interpolate import CubicSpline, PchipInterpolator
        from scipy.spatial.transform import Rotation, RotationSpline

        self._first = keys[0]
        around = _around(keys)
        keys = [*keys[len(keys) - 1 - around : -1], *keys, *keys[1 : 1 + around]]
        positions = np.array([key.position for key in keys])
        turns = Rotation.from_matrix(np.array([key.camera_to_world[:3, :3] for key in keys]))
        steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        angles = (turns[:-1].inv() * turns[1:]).magnitude()
        still = steps <= _STILL * max(float(np.ptp(positions, axis=0).max()), 1e-300)
        # where the camera only turns, the parameter goes by the angle; it must grow even where nothing changes
        typical = np.sqrt(steps[~still]).mean() if (~still).any() else 1.0
        widths = np.where(still, typical * np.clip(angles, 1e-3, None), np.sqrt(steps))
        knots = np.concatenate([[0.0], np.cumsum(widths)])
        begin, end = knots[around], knots[len(keys) - 1 - around]
        knots = (knots - begin) / (end - begin)
        self._knots = knots[around : len(keys) - around]
        boundary = "natural" if len(keys) > 2 else "not-a-knot"
        self._centre = positions.mean(axis=0)  # map coordinates have seven digits: the spline works on differences
        self._position = CubicSpline(knots, positions - self._centre, bc_type=boundary)
        self._turn = RotationSpline(knots, turns)
        lens = np.array([(key.fx / key.height, key.fy / key.height, key.cx / key.width, key.cy / key.height) for key in keys])
        self._lens = PchipInterpolator(knots, lens)  # monotone between keyframes: a zoom does not overshoot

    def even(self, count: int) -> np.ndarray:
        """(count,) parameters at constant speed."""
        dense, along = self._progress()
        return np.interp(np.linspace(0.0, 1.0, count), along, dense)

    def paced(self, count: int, pace: Pace) -> np.ndarray:
        """(count,) parameters at equal times of a film of this pace."""
        dense, along = self._progress()
        times = np.linspace(0.0, pace.seconds, count)
        return np.interp(pace.shares(times, np.interp(self._knots, dense, along)), along, dense)

    def passing(self) -> np.ndarray:
        """(K,) share of the film at each keyframe."""
        dense, along = self._progress()
        return np.interp(self._knots, dense, along)

    def _progress(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters, and the share of the film at each, strictly increasing; without movement the parameters themselves."""
        dense = np.unique(np.concatenate([np.linspace(a, b, DENSE + 1) for a, b in zip(self._knots, self._knots[1:])]))
        moved = np.linalg.norm(np.diff(self._position(dense), axis=0), axis=1)
        turns = self._turn(dense)
        turned = (turns[:-1].inv() * turns[1:]).magnitude()
        if moved.sum() > 0 and turned.sum() > _NO_TURN:
            length = np.maximum(moved, TURN_SHARE * moved.sum() / turned.sum() * turned)
        else:
            length = moved if moved.sum() > 0 else turned
        if not length.sum() > 0:
            return dense, dense
        along = np.concatenate([[0.0], np.cumsum(length)]) / length.sum()
        increasing = np.concatenate([[True], np.diff(along) > 0])
        return dense[increasing], along[increasing]

    def cameras(self, us: np.ndarray) -> list[Camera]:
        """The camera at each of these parameters, (N,)."""
        matrices = np.tile(np.eye(4), (len(us), 1, 1))
        matrices[:, :3, :3] = self._turn(us).as_matrix()
        matrices[:, :3, 3] = self._position(us) + self._centre
        width, height = self._first.width, self._first.height
        lenses = (self._lens(us) * (height, height, width, height)).tolist()
        return [Camera(width, height, fx, fy, cx, cy, matrix, frame_name(number))
                for number, ((fx, fy, cx, cy), matrix) in enumerate(zip(lenses, matrices))]


def frame_name(number: int) -> str:
    """``frame_00042``: names of frames sort as they are shown."""
    return f"frame_{number:05d}"


def frame_number(name: str) -> int:
    """The number of a frame, from the name that :func:`frame_name` gave."""
    return int(name.rpartition("_")[2])


def _named(camera: Camera, number: int) -> Camera:
    from dataclasses import replace

    return replace(camera, name=frame_name(number))
