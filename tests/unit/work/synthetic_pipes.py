"""Synthetic pipes of known diameter as a scanner measures them, with other things near.  Metres, any frame."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Pipe:
    """xyz: (n, 3) all points; the first ``own`` are the pipe's.  click: (3,) one of these.  axis: (3,) unit vector.
    middle: (3,) on the axis, half way along.  seen: degrees of the circumference that hold points."""

    xyz: np.ndarray
    own: int
    click: np.ndarray
    axis: np.ndarray
    middle: np.ndarray
    radius: float
    length: float
    spacing: float
    noise: float
    seen: float


def frame(random) -> tuple[np.ndarray, np.ndarray]:
    """A random rotation, (3, 3) whose columns are the turned axes, and a shift to map coordinates."""
    return np.linalg.qr(random.normal(size=(3, 3)))[0], random.uniform(1e5, 1e6, 3) * random.choice([-1, 1], 3)


def plate(random, spacing: float, corner, first, second) -> np.ndarray:
    """(n, 3) random points of a flat rectangle, given by one corner and its two sides."""
    first, second = np.asarray(first, float), np.asarray(second, float)
    count = int(np.linalg.norm(np.cross(first, second)) / spacing**2)
    return corner + random.random((count, 1)) * first + random.random((count, 1)) * second


def made_pipe(random, radius: float, length: float, spacing: float, noise: float, seen: float, *, along_beam: bool,
              slope: float = 0.0, others: bool = True) -> Pipe:  # fmt: skip
    """A pipe whose seen part faces +x before it is turned, a wall half a radius behind it, and a plate across one end.

    noise: standard deviation, along each axis or along the beam.  The beam comes from a scanner on the side that is seen; more
    than half the circumference is seen from three scanners around the pipe, each point from the one that it faces.
    slope: change of the radius along the axis, of a cone; ``radius`` is that at the click.
    """
    arc = np.radians(seen)
    count = int(radius * arc * length / spacing**2)
    angle, along = random.uniform(-arc / 2, arc / 2, count), random.uniform(-length / 2, length / 2, count)
    target = random.uniform(-0.3, 0.3, 2) * (arc, length)
    clicked = int(np.hypot(angle - target[0], (along - target[1]) / radius).argmin())
    away = radius + slope * (along - along[clicked])
    xyz = np.stack([away * np.cos(angle), away * np.sin(angle), along], 1)
    if others:
        wide, end = 2 * radius, length / 2
        wall = plate(random, spacing, (-1.5 * radius, -wide, -end), (0, 2 * wide, 0), (0, 0, length))
        across = plate(random, spacing, (-1.5 * radius, -wide, end), (2 * wide, 0, 0), (0, 2 * wide, 0))
        xyz = np.concatenate([xyz, wall, across])
    if along_beam:
        turns = np.radians([0.0] if seen <= 180 else [-120.0, 0.0, 120.0])
        scanners = 20 * max(radius, 0.1) * np.stack([np.cos(turns), np.sin(turns), np.zeros(len(turns))], 1)
        beams = xyz - scanners[np.argmax(xyz @ scanners.T, axis=1)]
        xyz = xyz + beams / np.linalg.norm(beams, axis=1, keepdims=True) * random.normal(size=(len(xyz), 1)) * noise
    else:
        xyz = xyz + random.normal(size=xyz.shape) * noise
    axes, shift = frame(random)
    xyz = xyz @ axes.T + shift
    return Pipe(xyz, count, xyz[clicked], axes[:, 2], shift, radius, length, spacing, noise, seen)


def random_pipe(random, number: int) -> Pipe:
    """Of ordinary pipes of a building; of two that follow each other, one has noise in all directions, one along the beam."""
    radius = float(np.exp(random.uniform(np.log(0.04), np.log(0.3))))
    noise = float(random.uniform(0.001, min(0.005, radius / 15)))
    length = min(float(random.uniform(3, 6)) * radius, 0.6)
    spacing = float(random.uniform(0.003 if radius < 0.1 else 0.0045, 0.006))  # fewer points, for time
    return made_pipe(random, radius, length, spacing, noise, float(random.uniform(120, 360)),
                     along_beam=bool(number % 2))  # fmt: skip
