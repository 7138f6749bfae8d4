"""Renders points that are NumPy arrays: a coloured sphere on a floor, measured from two scanner positions.

    python assets/examples/points_from_numpy.py out/numpy
"""

import sys
from pathlib import Path

import numpy as np

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(60_000, 3))
    sphere = direction / np.linalg.norm(direction, axis=1, keepdims=True) + (0, 0, 1)  # radius 1, on the floor
    floor = np.column_stack([rng.uniform(-3, 3, (90_000, 2)), np.zeros(90_000)])
    xyz = np.concatenate([sphere, floor])  # z is up
    stripes = np.floor(4 * sphere[:, 2:]) % 2 * (0.8, 0.2, 0.1) + (0.1, 0.3, 0.6)
    checks = np.floor(2 * floor).sum(axis=1, keepdims=True) % 2 * (0.5, 0.5, 0.5) + (0.3, 0.3, 0.3)
    rgb = np.concatenate([stripes, checks])  # floats from 0 to 1; uint8 and uint16 are taken too

    scanners = np.array([(-3.0, -3.0, 1.6), (3.0, -2.0, 1.6)])
    nearest = np.linalg.norm(xyz[:, None] - scanners, axis=2).argmin(axis=1)  # row of scanners for each point
    with pointglass.from_points(xyz, rgb, station=nearest, stations=scanners, metres_per_unit=1.0) as scan:
        camera = pointglass.look_at((-3.5, -4.0, 2.5), (0, 0, 0.8), fov=50, size=(320, 240))
        scan.render(camera, view="filled").save(out / "sphere.png", background="gradient")
        print(f"{scan.count:,} points, {len(scan.stations)} stations: {out / 'sphere.png'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/numpy"))
