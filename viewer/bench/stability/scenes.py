"""Scenes of the stability claims: a procedural place at any scale and origin, panels from 1 cm to 100 km, and cameras.

Frame: a place is defined in place units (a room of 8 x 6 x 4 with a corner at the origin); its file coordinates are
``place * scale + origin``.  Place coordinates are multiples of 2**-20, so that scaling by powers of two and shifts by whole
cells are exact.  Everything is random, float64, and depends only on the seed.
"""

import numpy as np

from ...picture.camera import Camera, from_fov, look_at

ROOM = np.array([8.0, 6.0, 4.0])
"""Size of the room, place units.  Chosen by hand."""
GRAIN = 2.0**20
"""Steps of coordinates per place unit."""
_NOISE = 24
"""Largest noise added to a colour channel, 0 to 255, so that neighbours differ as in a scan.  Chosen by hand."""
DECADES = 7
"""Number of panels of :func:`panels` behind the first, each ten times farther than the previous one."""


def walls(seed: int, points: int = 40_000) -> tuple[np.ndarray, np.ndarray]:
    """A closed room with five boxes in it: xyz (N, 3) float64 in place units, rgb (N, 3) uint8."""
    rng = np.random.default_rng(seed)
    corners = [(np.zeros(3), ROOM)]
    for _ in range(5):
        low = np.append(rng.uniform(0.5, (6.0, 4.0)), 0.0)
        corners.append((low, low + rng.uniform(0.4, 1.5, 3)))
    shares = np.array([0.6, *[0.08] * 5])
    parts = []
    for (low, high), count in zip(corners, (shares * points).astype(int), strict=True):
        xyz = rng.uniform(low, high, (count, 3))
        sides = np.array([(high - low)[[1, 2, 0]] * (high - low)[[2, 0, 1]]]).ravel()
        axis = rng.choice(3, count, p=sides / sides.sum())
        xyz[np.arange(count), axis] = np.where(rng.random(count) < 0.5, low[axis], high[axis])
        parts.append(xyz)
    xyz = np.round(np.concatenate(parts) * GRAIN) / GRAIN
    return xyz, _painted(rng, xyz)


def _painted(rng: np.random.Generator, xyz: np.ndarray) -> np.ndarray:
    """(N, 3) uint8: smooth waves with noise, so that a shift by a pixel is a small error, and another surface a large one."""
    waves = rng.normal(0, 2.0, (3, 3))
    colour = 128 + 70 * np.sin(xyz @ waves.T + rng.uniform(0, 6, 3)) + rng.uniform(-_NOISE, _NOISE, xyz.shape)
    return np.clip(np.rint(colour), 0, 255).astype(np.uint8)


def panels(seed: int, size: tuple[int, int], near: float = 0.01, points: int = 24_000) -> tuple[np.ndarray, np.ndarray, Camera]:
    """Panels at depths ``near`` times 1, 10, ... 10**DECADES, each in a column of the picture.

    points: number of the nearest panel; each farther panel has half as many, at least 1000, as the density of scans falls with
    distance.  Returns xyz (N, 3), rgb (N, 3) and the camera at the origin, which looks along +x with +z up.
    """
    rng = np.random.default_rng(seed)
    camera = from_fov(*size, 50.0, look_at((0, 0, 0), (1, 0, 0)))
    half = size[1] / 2 / camera.fy
    width = 2 * size[0] / 2 / camera.fx / (DECADES + 1)
    parts = []
    for number in range(DECADES + 1):
        left = -size[0] / 2 / camera.fx + number * width
        count = max(points >> number, 1000)
        across = rng.uniform(left + 0.1 * width, left + 0.9 * width, count)
        parts.append(near * 10.0**number * np.stack([np.ones(count), -across, rng.uniform(-half, half, count)], 1))
    xyz = np.concatenate(parts)
    return xyz, rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8), camera


def view_inside(seed: int, size: tuple[int, int], fov: float | None = None) -> Camera:
    """A random camera in the room, place units; its position is a multiple of 2**-20.  fov: vertical, degrees; None: random."""
    rng = np.random.default_rng(seed)
    eye, target = (np.round(rng.uniform((0.1, 0.1, low), 0.9) * ROOM * GRAIN) / GRAIN for low in (0.5, 0.1))
    return from_fov(*size, fov or rng.uniform(40, 100), look_at(eye, target), f"view{seed}")


def placed(camera: Camera, scale: float, origin: np.ndarray) -> Camera:
    """The camera in file coordinates."""
    pose = camera.camera_to_world.copy()
    pose[:3, 3] = pose[:3, 3] * scale + origin
    return camera.moved(pose)


def direction(seed: int) -> np.ndarray:
    """(3,) random direction of an origin, not along an axis, with coordinates that are not round numbers."""
    rng = np.random.default_rng(seed)
    return rng.choice([-1.0, 1.0], 3) * rng.uniform(0.3, 1.0, 3)


def axis_camera(size: tuple[int, int], position=(0.0, 0.0, 0.0), focal: float | None = None) -> Camera:
    """A camera that looks along +y with +z up.  Its rotation has entries 0 and 1, so that view coordinates are exact
    differences.

    focal: pixels; None: half the width.
    """
    pose = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    pose[:3, 3] = position
    width, height = size
    return Camera(width, height, focal or width / 2, focal or width / 2, width / 2, height / 2, pose)
