"""The regions of a view cube: six faces, twelve edges and eight corners, and which way the camera looks that is turned to one.

Frame: the upright world of the camera (viewer.window.flight.navigation), the cube from -1 to 1 along each axis.  A region is a
sign along each axis, 0 where it is in the middle: (0, 0, 1) is the top, (1, -1, 1) a corner.  Pictures of the cube: x right,
y up.
"""

import numpy as np

BORDER = 0.62
"""Where a face ends and its edges begin: edges of a fifth of a side are hit at 84 design units."""
FACES = {"TOP": (0, 0, 1), "BOTTOM": (0, 0, -1), "FRONT": (0, -1, 0), "BACK": (0, 1, 0), "RIGHT": (1, 0, 0), "LEFT": (-1, 0, 0)}
"""Name -> region.  The front is seen by a camera that looks along +y."""
Region = tuple[int, int, int]


def region_at(to_view: np.ndarray, x: float, y: float) -> Region | None:
    """The region seen at a place of the cube's picture; None beside the cube.

    to_view: (3, 3) rotation from the upright world to the camera's axes, x right, y up, z towards the viewer.
    """
    found, nearest = None, -np.inf
    for normal in FACES.values():
        towards = to_view @ normal
        if towards[2] <= 1e-9:
            continue
        z = (1.0 - towards[0] * x - towards[1] * y) / towards[2]  # on the plane of the face
        place = to_view.T @ (x, y, z)
        if np.abs(place).max() <= 1 + 1e-9 and z > nearest:
            nearest, found = z, place
    if found is None:
        return None
    i, j, k = (int(np.sign(along)) if abs(along) > BORDER else 0 for along in found)
    return i, j, k


def cells_of(region: Region) -> list[np.ndarray]:
    """(4, 3) corners of the parts of faces that make a region, in order around each."""
    parts = []
    for axis in range(3):
        if region[axis] == 0:
            continue
        spans = {0: (-BORDER, BORDER), 1: (BORDER, 1.0), -1: (-1.0, -BORDER)}
        (a, b), (c, d) = (spans[region[(axis + n) % 3]] for n in (1, 2))
        corners = np.zeros((4, 3))
        corners[:, axis] = region[axis]
        corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = (a, b, b, a), (c, c, d, d)
        parts.append(corners)
    return parts


def view_of(region: Region, yaw: float) -> tuple[float, float]:
    """Yaw and pitch, radians, of the camera that looks at a region from outside.

    yaw: of the camera now; from straight above and below it is kept, to the next quarter turn.
    """
    i, j, k = region
    pitch = float(np.arctan2(-k, np.hypot(i, j)))
    if i == j == 0:
        return float(np.round(yaw / (np.pi / 2)) * np.pi / 2), pitch
    return float(np.arctan2(-j, -i)), pitch
