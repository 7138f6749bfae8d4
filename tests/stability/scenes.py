"""A camera whose view coordinates are exact differences; the scenes are those of ``pointglass bench stability``."""

import numpy as np

from pointglass.viewer.picture.camera import Camera


def axis_camera(size: tuple[int, int], position=(0.0, 0.0, 0.0), focal: float | None = None) -> Camera:
    """A camera that looks along +y with +z up.  Its rotation has entries 0 and 1, so that view coordinates are exact
    differences.

    focal: pixels; None: half the width.
    """
    pose = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    pose[:3, 3] = position
    width, height = size
    return Camera(width, height, focal or width / 2, focal or width / 2, width / 2, height / 2, pose)
