"""Reads coordinates, colours and attributes of a scan's points as NumPy arrays, and plots how high the points lie.

    python assets/examples/read_points.py out/points
"""

import sys
from pathlib import Path

import numpy as np

import pointglass


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with pointglass.open(pointglass.demo_scan()) as scan:
        print(f"{scan.count:,} points, {scan.info['format']}, spacing {scan.info['spacing']:.3g}")
        print("bounds, file coordinates:", *scan.bounds.round(2).tolist())
        some = scan.points[::100]  # every hundredth, spread evenly; nothing is read yet
        xyz = some.xyz  # (n, 3) float64, exact to the file's resolution
        print("attributes:", ", ".join(some.attributes))
        intensity = some["intensity"]  # by name, in the file's own type; some.rgb: the colours as drawn
        floor = some[np.abs(xyz[:, 2]) < 0.05]  # boolean masks and whole numbers choose points too
        print(f"{len(some):,} points read; mean colour of the {len(floor):,} near height 0: {floor.rgb.mean(axis=0).round()}")
        np.savez_compressed(out / "points.npz", xyz=xyz, rgb=some.rgb, intensity=intensity)
    plot(xyz[:, 2], out / "heights.png")


def plot(heights: np.ndarray, path: Path) -> None:
    from matplotlib.figure import Figure

    axes = (figure := Figure((5, 3), layout="constrained")).subplots()
    axes.hist(heights, 80, orientation="horizontal")
    axes.set(xlabel="points", ylabel="height, m")
    figure.savefig(path)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/points"))
