"""Moving an orthographic camera: keys pan and zoom, the wheel zooms about a pixel, and views of a scan from its sides.

Pure functions of the camera's state.  ``distance``: viewer.picture.camera.Camera.orthographic, file units; where it is halved,
everything is seen twice as large.  Frame: file coordinates; pixels as in viewer.picture.camera.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...picture.camera import SCALE_DISTANCES
from ...work.places.outside_view import inner_points
from .navigation import FAST, SLOW, FlyState, Motion
from .orbit import ZOOM_STEP

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...work.places.standing_place import Sampled

PACE = 0.6
"""Heights of the picture a second that a held key pans, and, as a power of two, how much it zooms."""
_MARGIN = 0.86
"""Share of the picture that a scan in view takes; as in viewer.work.places.outside_view."""
_AWAY = 1.5
"""Diagonals of the scan from its middle to the camera: no point is behind the camera, also where it orbits any of them."""
_OUTLIERS = 20.0
"""Diagonals of the middle 98 % of the points, beyond which points are outliers that a view need not hold."""
_LIMITS = 1e-6, 4.0
"""Height of the picture, in diagonals of the scan: from what float32 resolves to where the scan is a dot."""


def bounded(distance: float, seen: "Sampled", lens: float) -> float:
    """A scale that shows something of the scan.  lens: Camera.fy over the picture's height."""
    diagonal = max(float(np.linalg.norm(seen.high - seen.low)), 1e-300)
    least, most = (share * diagonal * lens for share in _LIMITS)
    return float(np.clip(distance, max(least, SCALE_DISTANCES[0]), min(most, SCALE_DISTANCES[1])))


def zoomed_at(state: FlyState, camera: "Camera", pixel: tuple[float, float], distance: float) -> FlyState:
    """Moved so that what lies at ``pixel`` stays there when the scale becomes that of ``distance``, at every depth.

    camera: as it is before, orthographic."""
    assert camera.orthographic is not None
    less = camera.orthographic - distance
    across, down = (pixel[0] - camera.cx) / camera.fx * less, (pixel[1] - camera.cy) / camera.fy * less
    return replace(state, position=state.position + camera.right * across - camera.up * down)


def zoom_of(notches: float) -> float:
    """Factor of the distance after so many notches of the wheel; positive: larger."""
    return ZOOM_STEP**notches


def stepped(state: FlyState, motion: Motion, height: float, dt: float) -> tuple[FlyState, float]:
    """The state ``dt`` seconds later, and the factor of the distance: forward and back zoom, the others pan.

    height: of the picture, file units.  There is no momentum: a plan is placed, not flown over."""
    pace = PACE * dt * motion.strength * (FAST if motion.fast else 1.0) * (SLOW if motion.slow else 1.0)
    turned = state.camera_to_world
    shift = (turned[:3, 0] * motion.right + turned[:3, 1] * motion.up) * (pace * height)
    return replace(state, position=state.position + shift, velocity=np.zeros(3)), float(2.0 ** (-2.0 * pace * motion.forward))


def whole_scan(seen: "Sampled", like: FlyState, aspect: float, lens: float) -> tuple[FlyState, float, float]:
    """The whole scan in view, looking as ``like`` does: the state, the distance of its scale, and the depth of its middle.

    seen: in file coordinates.  aspect: width over height of the picture.  lens: as of :func:`bounded`."""
    points = inner_points(seen)
    if len(points) < 8:
        points = np.array([seen.low, seen.high])
    every = max(float(np.linalg.norm(np.ptp(seen.points, axis=0))) if len(seen.points) else 0.0, 1e-300)
    middle, turned = (seen.low + seen.high) / 2, like.camera_to_world[:3, :3]
    right, up = ((points - middle) @ turned[:, :2]).T
    high = max(float(np.ptp(up)), float(np.ptp(right)) / aspect, 1e-6 * float(np.linalg.norm(seen.high - seen.low)), 1e-300)
    away = _AWAY * min(every, _OUTLIERS * max(float(np.linalg.norm(seen.high - seen.low)), 1e-300))
    centre = middle + turned[:, 0] * (right.max() + right.min()) / 2 + turned[:, 1] * (up.max() + up.min()) / 2
    state = replace(like, position=centre + turned[:, 2] * away, velocity=np.zeros(3))
    return state, bounded(high / _MARGIN * lens, seen, lens), away


def state_of_camera(camera: "Camera", like: FlyState) -> FlyState:
    """Where a camera is and how it looks, at the speed of ``like`` and level in its up axis; also straight up and down."""
    right, ahead = like.upright.T @ camera.right, like.upright.T @ camera.forward
    return replace(like, position=np.array(camera.position), yaw=float(np.arctan2(right[0], -right[1])),
                   pitch=float(np.arcsin(np.clip(ahead[2], -1.0, 1.0))), velocity=np.zeros(3))
