"""A view that is kept: where a camera stands and how wide it sees, without the size of a picture.

Frame: the file's own coordinates, float64.
"""

from dataclasses import dataclass

import numpy as np

from ..common.text import with_whole_characters
from ..picture.camera import Camera, from_fov

Matrix = tuple[
    tuple[float, float, float, float],
    tuple[float, float, float, float],
    tuple[float, float, float, float],
    tuple[float, float, float, float],
]


@dataclass(frozen=True)
class Viewpoint:
    """A bookmarked view.  camera_to_world: OpenGL axes (viewer.picture.camera).  vertical_fov: degrees."""

    name: str
    camera_to_world: Matrix
    vertical_fov: float

    def __post_init__(self) -> None:
        from_fov(2, 2, self.vertical_fov, np.array(self.camera_to_world, np.float64), self.name)  # raises InputError

    def camera(self, width: int, height: int) -> Camera:
        """This view in a picture of so many pixels."""
        return from_fov(width, height, self.vertical_fov, np.array(self.camera_to_world), self.name)

    @staticmethod
    def of(camera: Camera, name: str) -> "Viewpoint":
        """The view of a camera; its principal point is not kept."""
        fov = float(np.degrees(2 * np.arctan(0.5 * camera.height / camera.fy)))
        a, b, c, d = (tuple(float(value) for value in row) for row in camera.camera_to_world)
        return Viewpoint(with_whole_characters(name), (a, b, c, d), fov)  # type: ignore[arg-type]
