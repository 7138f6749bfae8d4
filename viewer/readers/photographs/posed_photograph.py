"""Photographs with a pose, as far as they are known before their pictures are decoded."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Lens = tuple[float, float, float, float]
"""fx, fy, cx, cy in pixels; of a panorama fx and fy are pixels per radian."""


@dataclass(frozen=True, eq=False)
class PosedPhotograph:
    """A photograph that is decoded when it is needed.

    name: for messages, with its file.  kind: of viewer.readers.e57.e57_photographs.KINDS.  width, height: pixels of the file.
    lens: at that size.  around: whether the columns close a circle.  camera_to_world: (4, 4) float64, the scan's coordinates,
    in the frame of viewer.readers.e57.e57_photographs.
    decode: the picture, (h, w, 3) uint8 sRGB with at most that many pixels along a side, and (h, w) bool where it holds
    anything, None: everywhere.  Raises InputError where it is damaged.  title: for lists.  number: in the images2D of its E57,
    None of another file.
    """

    name: str
    kind: str
    width: int
    height: int
    lens: Lens
    around: bool
    camera_to_world: np.ndarray
    decode: Callable[[int], tuple[np.ndarray, np.ndarray | None]]
    title: str = ""
    number: int | None = None

    @property
    def key(self) -> tuple:
        """Equal for the same photograph at the same pose, read again."""
        return self.name, self.kind, self.width, self.height, self.lens, self.camera_to_world.tobytes()

    @property
    def position(self) -> np.ndarray:
        """(3,) centre of projection, the scan's coordinates."""
        return self.camera_to_world[:3, 3]

    @property
    def forward(self) -> np.ndarray:
        """(3,) unit vector, the scan's frame: towards the centre of the picture."""
        return self.camera_to_world[:3, :3] @ ((0.0, 0.0, -1.0) if self.kind == "pinhole" else (1.0, 0.0, 0.0))
