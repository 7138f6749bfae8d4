"""Rendered views of a scan, with features whose points are known: what photographs are compared with.

Points are relative to the origin of the views, file units.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...picture.camera import Camera, from_fov, look_at
from ..places.standing_place import overview_position
from .picture_features import Features, features_of

if TYPE_CHECKING:
    from ..places.standing_place import Sampled

Draw = Callable[[Camera], tuple[np.ndarray, np.ndarray]]
"""Camera -> its filled picture, (H, W, 4) uint8, and its depth, (H, W) float32 view-space z, 0 where it is not opaque."""
SIZE = 640
"""Pixels along a side of a view."""
FIELD = 70.0
"""Degrees that a view shows: neighbours overlap by a third, and its corners are not drawn out much."""
FEATURES = 1500
"""Of one view at most."""
TURNS = ((0.0, 8, 0.0), (-45.0, 5, 0.5), (45.0, 4, 0.5))
"""Views from a place: pitch in degrees, how many around, and the first one's turn in steps of these."""
PER_PLACE = sum(count for _, count, _ in TURNS)
RINGS = ((0.0, 12), (25.0, 12))
"""Views from outside: degrees of the fall of the line of sight, and how many around."""
EDGE = 0.03
"""Share of its depth by which the surface around a feature may vary: a feature at an outline is of no one place."""


@dataclass(frozen=True, eq=False)
class ReferenceView:
    """points: (n, 3) float64 of its features."""

    camera: Camera
    features: Features
    points: np.ndarray


def around(place: np.ndarray, upright: np.ndarray) -> list[Camera]:
    """The cameras at a place, (3,) file coordinates.  upright: (3, 3) rotation, columns are the level axes and up."""
    cameras = []
    for pitch, count, first in TURNS:
        for turn in range(count):
            yaw, rise = 2 * np.pi * (turn + first) / count, np.radians(pitch)
            ahead = np.array([np.cos(rise) * np.cos(yaw), np.cos(rise) * np.sin(yaw), np.sin(rise)])
            right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
            pose = np.eye(4)
            pose[:3, :3] = upright @ np.stack([right, np.cross(right, ahead), -ahead], axis=1)
            pose[:3, 3] = place
            cameras.append(from_fov(SIZE, SIZE, FIELD, pose))
    return cameras


def outside(seen: "Sampled", upright: np.ndarray) -> list[Camera]:
    """Cameras around a scan that look at its middle, from where it fills the view, level and from above.  seen: in file axes.
    upright: as of around."""
    cameras, middle = [], (seen.low + seen.high) / 2
    for pitch, count in RINGS:
        for turn in range(count):
            yaw, fall = 2 * np.pi * turn / count, np.radians(pitch)
            ahead = upright @ np.array([np.cos(fall) * np.cos(yaw), np.cos(fall) * np.sin(yaw), -np.sin(fall)])
            place = overview_position(seen, 1.0, ahead)
            cameras.append(from_fov(SIZE, SIZE, FIELD, look_at(place, middle, upright[:, 2])))
    return cameras


def view_of(draw: Draw, camera: Camera, origin: np.ndarray, most: int = FEATURES) -> ReferenceView:
    """The view of a camera, with the features of surfaces."""
    picture, depth = draw(camera)
    features = features_of(picture, most)
    column, row = np.minimum(features.places.astype(int), (camera.width - 1, camera.height - 1)).T
    there, near, far = depth[row, column].astype(np.float64), np.full(len(row), np.inf), np.zeros(len(row))
    for dy in (-2, 0, 2):
        for dx in (-2, 0, 2):
            beside = depth[np.clip(row + dy, 0, camera.height - 1), np.clip(column + dx, 0, camera.width - 1)]
            near, far = np.minimum(near, beside), np.maximum(far, beside)
    with np.errstate(invalid="ignore", divide="ignore"):
        sure = np.flatnonzero((there > 0) & (near > 0) & (far <= near * (1 + EDGE)))
    z = there[sure]
    slope = (features.places[sure] - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    seen = np.column_stack([slope * z[:, None], z])
    return ReferenceView(camera, features.chosen(sure), seen @ camera.view_rotation + (camera.position - origin))
