"""Run time of frustum culling: a floor of rooms with a million cells, seen from inside.

The cells of a procedural floor are repeated side by side; its points are not, as they are not drawn.
Frame: metres, z up, the camera above the middle of the floor.
"""

import math
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera

CELLS = 1_000_000
"""Least number of cells.  This and the values below are what the bench is."""
DETAIL = {"every point": None, "1 point a pixel": 1.0}
"""Name -> level of detail, points per pixel; None: all points."""
_ROOMS, _POINTS = 9, 9_000_000
"""Rooms and points of the floor that is repeated."""
_VIEWS, _FOV = 8, 60.0
"""Number of views, and their vertical field of view in degrees."""


def repeated(scene: "Scene", cells: int) -> tuple["Scene", int]:
    """The scene repeated until it has at least ``cells`` cells, for culling only, and the number of copies."""
    times = -(-cells // len(scene.cell_coords))
    columns = math.isqrt(times - 1) + 1
    extent = np.ptp(scene.cell_coords, axis=0) + 1
    places = [np.array([n % columns, n // columns, 0]) * extent for n in range(times)]
    coords = np.concatenate([scene.cell_coords + place for place in places]).astype(np.int32)
    counts = np.tile(np.diff(scene.offsets).reshape(scene.layers, -1), (1, times))

    def tiled(each: np.ndarray | None) -> np.ndarray | None:
        return None if each is None else np.tile(each, (times, 1))

    return replace(scene, cell_coords=coords, offsets=np.append(0, counts.ravel().cumsum()), faces=tiled(scene.faces),
                   boxes=tiled(scene.boxes)), times


def views_around(scene: "Scene", size: tuple[int, int]) -> "list[Camera]":
    """Horizontal views in all directions from the middle of the floor, at eye height."""
    from ...picture.camera import from_fov, look_at
    from ..procedural_scan import EYE

    middle = scene.origin + (scene.cell_coords.min(axis=0) + scene.cell_coords.max(axis=0) + 1) / 2 * scene.cell_size
    eye = np.array([middle[0], middle[1], EYE])
    angles = np.linspace(0.0, 2 * np.pi, _VIEWS, endpoint=False)
    return [from_fov(*size, _FOV, look_at(eye, eye + [np.cos(a), np.sin(a), 0.0]), f"around-{n}") for n, a in enumerate(angles)]


def run_culling(size: tuple[int, int], repeats: int, seed: int) -> dict:
    """Milliseconds to find the visible cells and to list their points, p50 over views and rounds, by level of detail."""
    from ...render.culling.cull import Culler
    from ..procedural_scan import ProceduralScan, procedural_scene

    scene, times = repeated(procedural_scene(ProceduralScan(_POINTS, _ROOMS, seed)), CELLS)
    culler = Culler(scene)
    cameras = views_around(scene, size)
    found: dict[str, dict] = {}
    for name, lod in DETAIL.items():
        cell_ms, list_ms, seen, runs = [], [], [], []
        for round_ in range(repeats + 1):
            for camera in cameras:
                begun = time.perf_counter()
                visible = len(culler.visible(camera, lod or 0.0))
                between = time.perf_counter()
                draw = culler.select(camera, lod)
                ended = time.perf_counter()
                if round_:
                    cell_ms.append(1e3 * (between - begun))
                    list_ms.append(1e3 * (ended - between) - cell_ms[-1])
                    seen.append(visible)
                    runs.append(len(draw.first))
        found[name] = {"cells_ms": float(np.median(cell_ms)), "list_ms": float(np.median(list_ms)),
                       "visible": float(np.median(seen)), "runs": float(np.median(runs))}
    return {"scans": [f"a floor of {times * _ROOMS:,} rooms, seed {seed}"], "size": list(size), "repeats": repeats,
            "cells": len(scene.cell_coords), "rooms": times * _ROOMS, "layers": scene.layers, "detail": found}


def rows(result: dict) -> list[tuple[str, str]]:
    """The table."""
    return [("cells", f"{result['cells']:,} in {result['rooms']:,} rooms, {result['layers']} layers"), *(
        (f"p50, {name}", f"{held['visible']:,.0f} cells in view found in {held['cells_ms']:.2f} ms, "
                         f"{held['runs']:,.0f} runs of their points listed in {held['list_ms']:.2f} ms")
        for name, held in result["detail"].items())]


def plot(result: dict, path: Path) -> None:
    """A bar for each level of detail: time for cells, then for lists of points."""
    from ..plots import INK, figure, save

    made, axes = figure(7.0, 1.8)
    names = list(result["detail"])
    left = np.zeros(len(names))
    for number, (part, label) in enumerate((("cells_ms", "cells in view"), ("list_ms", "lists of their points"))):
        values = np.array([result["detail"][name][part] for name in names])
        axes.barh(names, values, left=left, color=INK[number], label=label)
        left += values
    axes.invert_yaxis()
    axes.legend(fontsize="x-small")
    axes.set_xlabel(f"milliseconds, p50, {result['cells']:,} cells")
    save(made, path, result)
