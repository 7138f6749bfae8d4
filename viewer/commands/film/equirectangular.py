"""Equirectangular panoramas from six pinhole pictures, the faces of a cube that overlap.

Longitude runs from -180 degrees (left edge) to 180 (right edge), 0 in the middle: the camera's heading, projected into the
horizontal plane of the file's third axis.  Latitude runs from 90 degrees (top row) to -90.  Each pixel blends the faces that
show its direction, weighted down towards a face's border, so that what depends on the border (holes, the network) leaves no
seam.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...picture.camera import Camera, from_fov, look_at

if TYPE_CHECKING:
    from collections.abc import Iterator

OVERLAP = 5.0
"""Degrees by which a face reaches beyond its 90 on every side.  Measured where two faces meet, in panoramas 768 pixels wide
from the start views of demo.laz and studio.laz: their neural pictures differ by 3.5 and 3.5 levels, with half by 3.6 and 3.6,
with a quarter by 4.9 and 3.7, with twice by 3.8 and 3.2; filled pictures of these and plant_room.laz by at most 16 % more or
less than here."""
_EDGE = np.tan(np.radians(45 + OVERLAP))  # of a face, where its axis is 1
_FACES = {"front": (0, 0), "right": (-90, 0), "back": (180, 0), "left": (90, 0), "up": (0, 90), "down": (0, -90)}
"""Degrees: heading to the left, pitch upwards."""


@dataclass(frozen=True)
class Panorama:
    """Pictures of ``width`` x ``height`` pixels, width = 2 * height."""

    width: int
    height: int

    @property
    def face_side(self) -> int:
        """Pixels of a face: at its centre as fine as the panorama at its equator."""
        return 2 * int(np.ceil(self.width / np.pi * _EDGE / 2))

    def faces(self, camera: Camera) -> "Iterator[tuple[str, Camera]]":
        """The six cameras at a camera's position."""
        for name, (heading, pitch) in _FACES.items():
            forward, up = _direction(camera, heading, pitch)
            pose = look_at(camera.position, camera.position + forward, up)
            yield name, from_fov(self.face_side, self.face_side, 90 + 2 * OVERLAP, pose, f"{camera.name}-{name}")

    def picture(self, camera: Camera, draw: Callable[[Camera], np.ndarray]) -> np.ndarray:
        """(H, W, 4) uint8, premultiplied, from draw: a camera -> (side, side, 4) uint8, premultiplied."""
        total = np.zeros((self.height, self.width, 4), np.float32)
        weight = np.zeros((self.height, self.width, 1), np.float32)
        rays = self.rays(camera)
        for _, face in self.faces(camera):
            shown, share = _sample(draw(face), face, rays)
            total += shown * share
            weight += share
        return np.rint(total / weight).astype(np.uint8)

    def rays(self, camera: Camera) -> np.ndarray:
        """(H, W, 3) float64 unit vectors, file axes: the direction of each pixel's centre."""
        longitude = ((np.arange(self.width) + 0.5) / self.width - 0.5) * 2 * np.pi
        latitude = (0.5 - (np.arange(self.height) + 0.5) / self.height) * np.pi
        forward, up = _direction(camera, 0, 0)
        right = np.cross(forward, up)
        flat = np.cos(longitude)[:, None] * forward + np.sin(longitude)[:, None] * right
        return np.cos(latitude)[:, None, None] * flat + np.sin(latitude)[:, None, None] * up


def _direction(camera: Camera, heading: float, pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """(forward, up), unit vectors, degrees from the camera's horizontal heading."""
    level = np.array([*camera.forward[:2], 0.0])
    if np.linalg.norm(level) < 1e-6:  # it looks straight up or down: the top of its picture is the heading
        level = np.array([*(camera.up[:2] * -np.sign(camera.forward[2])), 0.0])
    level /= np.linalg.norm(level)
    vertical = np.array([0.0, 0.0, 1.0])
    side = np.cross(vertical, level)  # to the left
    h, p = np.radians(heading), np.radians(pitch)
    flat = np.cos(h) * level + np.sin(h) * side
    return np.cos(p) * flat + np.sin(p) * vertical, np.cos(p) * vertical - np.sin(p) * flat


def _sample(image: np.ndarray, face: Camera, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear colours (H, W, 4) float32 of the rays in a face's picture and their weights (H, W, 1), 0 outside the face."""
    x, y, z = (rays @ face.right), -(rays @ face.up), rays @ face.forward
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = face.cx + face.fx * x / z - 0.5, face.cy + face.fy * y / z - 0.5
    side = face.width - 1
    inside = (z > 0) & (u >= 0) & (v >= 0) & (u <= side) & (v <= side)
    u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
    edge = np.minimum(np.minimum(u, side - u), np.minimum(v, side - v))
    band = face.width * (1 - 1 / _EDGE)  # twice the overlap: at a cube's edge both faces weigh the same
    share = np.where(inside, np.clip((edge + 1) / band, 0, 1), 0).astype(np.float32)[..., None]
    column, row = np.minimum(u.astype(int), side - 1), np.minimum(v.astype(int), side - 1)
    a, b = (u - column)[..., None].astype(np.float32), (v - row)[..., None].astype(np.float32)
    picture = image.astype(np.float32)
    top = picture[row, column] * (1 - a) + picture[row, column + 1] * a
    bottom = picture[row + 1, column] * (1 - a) + picture[row + 1, column + 1] * a
    return top * (1 - b) + bottom * b, share
