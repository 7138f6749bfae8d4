"""A camera path around a point: the camera keeps its height and distance, and the point its place in the picture."""

from collections.abc import Sequence

import numpy as np

from ...picture.camera import Camera
from ..document import Keyframe
from ..viewpoint import Viewpoint

STEPS = 8
"""Keyframes of a turn; the spline through eight of a circle departs from it by less than a thousandth of its radius."""


def orbit(camera: Camera, centre: Sequence[float], up: Sequence[float], *, step: float) -> tuple[Keyframe, ...]:
    """Keyframes of one turn around the line through ``centre`` along ``up``, counterclockwise seen from above, beginning at the
    camera; a closed path leads back.

    centre: (3,) file coordinates.  up: (3,) unit vector.  step: seconds from one keyframe to the next.
    """
    from scipy.spatial.transform import Rotation

    middle, axis = np.asarray(centre, np.float64), np.asarray(up, np.float64)
    keys = []
    for number in range(STEPS):
        turn = Rotation.from_rotvec(2 * np.pi * number / STEPS * axis).as_matrix()
        matrix = camera.camera_to_world.copy()
        matrix[:3, :3] = turn @ matrix[:3, :3]
        matrix[:3, 3] = middle + turn @ (matrix[:3, 3] - middle)
        moved = Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, matrix)
        keys.append(Keyframe(step * number, Viewpoint.of(moved, f"Orbit {number + 1}")))
    return tuple(keys)
