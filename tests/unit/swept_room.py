"""A room as scanners sweep it: points in the order in which they are measured.  Metres, z up, the room centred on zero."""

import numpy as np

ROOM = np.array([3.0, 2.5, 1.4])
"""Half its sides."""
PLACES = np.array([[-1.2, -0.7, 0.1], [1.5, 0.9, 0.25], [0.3, 1.6, -0.1]])


def hits(place: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """(n, 3): where rays (n, 3) from a place inside meet the room, or one of two cupboards in it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.min(np.where(rays > 0, ROOM - place, -ROOM - place) / rays, axis=1)
        for low, high in (((1.0, -2.5, -1.4), (2.0, -1.9, 0.6)), ((-3.0, 1.0, -1.4), (-2.4, 1.9, -0.3))):
            first, last = (np.array(low) - place) / rays, (np.array(high) - place) / rays
            enter, leave = np.minimum(first, last).max(axis=1), np.maximum(first, last).min(axis=1)
            far = np.where((enter > 0) & (enter < leave), np.minimum(far, enter), far)
    return place + far[:, None] * rays


def sweep(place: np.ndarray, seed: int, columns: int = 300, rows: int = 300, noise: float = 0.001) -> np.ndarray:
    """(n, 3) points column by column, as a mirror turns about a level axis and the scanner about an upright one."""
    random = np.random.default_rng(seed)
    azimuth = np.repeat(np.linspace(0, 2 * np.pi, columns, endpoint=False) + random.uniform(0, 6), rows)
    elevation = np.tile(np.linspace(-1.0, 1.5, rows), columns)
    rays = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1)
    return hits(place, rays) + noise * random.normal(size=(len(rays), 1)) * rays


def pictures(place: np.ndarray, size: int = 200) -> np.ndarray:
    """(n, 3) points of six pictures that look along the axes, row by row."""
    side = (np.arange(size) + 0.5) / size * 2 - 1
    down, across = np.meshgrid(side, side, indexing="ij")
    ahead = np.stack([np.ones_like(down), across, down], axis=-1).reshape(-1, 3)
    faces = [sign * np.roll(ahead, axis, axis=1) for axis in range(3) for sign in (1.0, -1.0)]
    return np.concatenate([hits(place, face) for face in faces])
