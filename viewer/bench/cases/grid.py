"""Time to build a grid from arrays in memory, milliseconds per million points.

The points are random on the walls of a room, with millimetre noise, in random order, which is slower than a scanner's order.
"""

import time
from pathlib import Path

import numpy as np

from ...grid.building.grid_threads import processors
from ...grid.open_scene import scene_from_arrays


def random_surface(points: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """xyz (points, 3) float64 metres on the six sides of a 10 x 8 x 3 m room, and rgb (points, 3) uint8."""
    random = np.random.default_rng(seed)
    sides = np.array([10.0, 8.0, 3.0])
    xyz = random.random((points, 3)) * sides
    axis, far = random.integers(0, 3, points), random.integers(0, 2, points)
    xyz[np.arange(points), axis] = sides[axis] * far
    xyz += random.normal(0, 0.002, (points, 3))
    return xyz, random.integers(0, 256, (points, 3), dtype=np.uint8)


def run(points: int = 10_000_000, repeats: int = 3) -> dict:
    """Builds the same grid ``repeats`` times, after a warm-up that compiles the kernels.

    Returns the best total and all totals, the stages of the best run, in ms per 1M points, and facts of the grid.
    """
    return measure(*random_surface(points), repeats)


def measure(xyz: np.ndarray, rgb: np.ndarray, repeats: int = 3) -> dict:
    """:func:`run` for given points: xyz (N, 3) float64, rgb (N, 3) uint8."""
    scene_from_arrays(xyz[:100_000], rgb[:100_000])
    runs = []
    scene = None
    for _ in range(repeats):
        stages: dict[str, float] = {}
        start = time.perf_counter()
        scene = scene_from_arrays(xyz, rgb, stages=stages)
        total = time.perf_counter() - start
        per_million = 1e9 / len(xyz)
        runs.append((total * per_million, {name: seconds * per_million for name, seconds in stages.items()}))
    assert scene is not None
    best, stages = min(runs, key=lambda run: run[0])
    return {
        "points": len(xyz),
        "processors": processors(),
        "ms_per_million": round(best, 2),
        "all_ms_per_million": [round(total, 2) for total, _ in runs],
        "stages_ms_per_million": {name: round(value, 2) for name, value in stages.items()},
        "cells": len(scene.cell_coords),
        "layers": scene.layers,
        "cell_size": scene.cell_size,
        "spacing": scene.spacing,
    }


def rows(result: dict) -> list[tuple[str, str]]:
    """The table."""
    found = [(name, f"{value:.2f} ms per 1M points") for name, value in result["stages_ms_per_million"].items()]
    return [*found, ("total, best", f"{result['ms_per_million']:.2f} ms per 1M points")]


def plot(result: dict, path: Path) -> None:
    """A bar for each stage of the best run."""
    from ..plots import INK, figure, save

    made, axes = figure(7.0, 2.4)
    axes.barh(list(result["stages_ms_per_million"]), list(result["stages_ms_per_million"].values()), color=INK[0])
    axes.invert_yaxis()
    axes.set_xlabel(f"milliseconds per 1M points, {result['points']:,} random points")
    save(made, path, result)
