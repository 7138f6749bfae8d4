"""What the stress tests draw: one procedural place at any scale and origin, panels from 1 cm to 100 km, cameras for both.

Frame: a place is made in units of its own (a room of 8 x 6 x 4 with its corner in the origin), then written in file
coordinates as ``place * scale + origin``.  Its coordinates are multiples of 2**-20, so that powers of two and shifts by
whole cells are exact.  All of it is random, float64, and depends on the seed alone.
"""

import numpy as np

from viewer.camera import Camera, from_fov, look_at

ROOM = np.array([8.0, 6.0, 4.0])
_GRAIN = 2.0**20
_NOISE = 24  # of 255, on top of the pattern: no two neighbours are alike, as in a scan
DECADES = 7
"""Panels of :func:`panels` behind the first, each ten times as far as the one before."""


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
    xyz = np.round(np.concatenate(parts) * _GRAIN) / _GRAIN
    return xyz, _painted(rng, xyz)


def _painted(rng: np.random.Generator, xyz: np.ndarray) -> np.ndarray:
    """A pattern of waves with noise, (N, 3) uint8: a point that lands one pixel off costs little, one that lands on
    another surface much."""
    waves = rng.normal(0, 2.0, (3, 3))
    colour = 128 + 70 * np.sin(xyz @ waves.T + rng.uniform(0, 6, 3)) + rng.uniform(-_NOISE, _NOISE, xyz.shape)
    return np.clip(np.rint(colour), 0, 255).astype(np.uint8)


def panels(seed: int, size: tuple[int, int], near: float = 0.01, points: int = 24_000) -> tuple[np.ndarray, np.ndarray, Camera]:
    """Panels at ``near`` times 1, 10, ... 10**DECADES, each filling a column of the picture of its own.

    points: of the nearest; each further panel has half as many, at least 1000, since a scan thins out with distance.
    Returns xyz (N, 3), rgb (N, 3) and the camera, in the origin, looking along +x with +z up.
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
    """A camera above the boxes, looking anywhere, in place units; its position a multiple of 2**-20."""
    rng = np.random.default_rng(seed)
    eye, target = (np.round(rng.uniform((0.1, 0.1, low), 0.9) * ROOM * _GRAIN) / _GRAIN for low in (0.5, 0.1))
    return from_fov(*size, fov or rng.uniform(40, 100), look_at(eye, target), f"view{seed}")


def placed(camera: Camera, scale: float, origin: np.ndarray) -> Camera:
    """The camera in file coordinates."""
    pose = camera.camera_to_world.copy()
    pose[:3, 3] = pose[:3, 3] * scale + origin
    return camera.moved(pose)


def direction(seed: int) -> np.ndarray:
    """(3,) where an origin lies when it lies a given distance away: no axis, none of its coordinates round."""
    rng = np.random.default_rng(seed)
    return rng.choice([-1.0, 1.0], 3) * rng.uniform(0.3, 1.0, 3)


def axis_camera(size: tuple[int, int], position=(0.0, 0.0, 0.0), focal: float | None = None) -> Camera:
    """Looks along +y with +z up: a rotation whose entries are 0 and 1, so that view coordinates are differences."""
    pose = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    pose[:3, 3] = position
    width, height = size
    return Camera(width, height, focal or width / 2, focal or width / 2, width / 2, height / 2, pose)
