"""A view that is kept: where a camera stands and how wide it sees, without the size of a picture.

Frame: the file's own coordinates, float64.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..common.text import with_whole_characters
from ..picture.camera import Camera, from_fov
from ..picture.json_values import UNLESS_DEFAULT

Matrix = tuple[
    tuple[float, float, float, float],
    tuple[float, float, float, float],
    tuple[float, float, float, float],
    tuple[float, float, float, float],
]


@dataclass(frozen=True)
class Viewpoint:
    """A bookmarked view.  camera_to_world: OpenGL axes (viewer.picture.camera).  vertical_fov: degrees.  orthographic: as of a
    camera."""

    name: str
    camera_to_world: Matrix
    vertical_fov: float
    orthographic: float | None = field(default=None, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        self.camera(2, 2)  # raises InputError

    def camera(self, width: int, height: int) -> Camera:
        """This view in a picture of so many pixels."""
        made = from_fov(width, height, self.vertical_fov, np.array(self.camera_to_world, np.float64), self.name)
        return made if self.orthographic is None else replace(made, orthographic=self.orthographic)

    @staticmethod
    def of(camera: Camera, name: str) -> "Viewpoint":
        """The view of a camera; its principal point is not kept."""
        fov = float(np.degrees(2 * np.arctan(0.5 * camera.height / camera.fy)))
        a, b, c, d = (tuple(float(value) for value in row) for row in camera.camera_to_world)
        return Viewpoint(with_whole_characters(name), (a, b, c, d), fov, camera.orthographic)  # type: ignore[arg-type]
