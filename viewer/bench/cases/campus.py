"""A place of many files: time to convert, open and change it, memory, and a frame's time from few files to many.

The files are those of a procedural campus (viewer.bench.procedural_campus), one scanner position each.  Grids are kept in
the cache, which tests and people choose with POINTGLASS_CACHE.  The camera rotates at the first scanner; frames of all sizes
are timed alternately with those of the smallest place that is like it, and growth is the median ratio of such pairs, of all and
of the direction in which it is largest.  Alike are
whole buildings, since a part of one has less to see, and places in both of which the camera counts as indoors, or as outdoors,
where filled pictures test each hole: that costs a constant time, whatever the size.
"""

import gc
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.system import resident_memory
from ...common.text import counted
from ...picture.camera import Camera, from_fov, look_at
from ...picture.settings import Settings
from ..memory_headroom import POOL
from ..procedural_campus import make_campus, scanner
from .frame_times import summary

if TYPE_CHECKING:
    from ...render.renderer import Renderer

FILES = (30, 90, 300)
"""Default numbers of files: whole buildings."""
POINTS = 1_000_000
"""Default points of a file."""
VIEWS = ("raw", "filled")
TURNS = 12
LOD = 1.0


def run_campus(folder: Path, files: Sequence[int], points: int, size: tuple[int, int], settings: Settings, repeats: int,
               seed: int = 1) -> dict:
    """Measures the campus in ``folder``, which is made if missing, with each of the numbers of ``files``."""
    from ...grid.open_scene import open_scene
    from ...render.culling.enclosed_directions import Enclosure
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    settings = replace(settings, lod=settings.lod or LOD)
    paths, context, rows = make_campus(folder, max(files), points, seed), create_context(), []
    eye = scanner(0, seed)
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    cameras = [from_fov(*size, 60.0, look_at(eye, eye + (np.cos(a), np.sin(a), -0.1)), f"turn{n}")
               for n, a in enumerate(angles)]
    beside: dict[bool, Renderer] = {}
    for count in sorted(files):
        gc.collect()
        before, start = resident_memory(), time.perf_counter()
        open_scene(paths[:count])
        converted_s = time.perf_counter() - start
        start = time.perf_counter()
        scene = open_scene(paths[:count])
        opened_s = time.perf_counter() - start
        renderer = Renderer(context, scene, memory=POOL)
        renderer.render(cameras[0], settings, views=("raw",), streaming=True).image("raw")
        first_s = time.perf_counter() - start
        outdoors = Enclosure(scene).around(eye).occupancy is not None
        times, growth = _frames(renderer, beside.get(outdoors, renderer), cameras, settings, repeats)
        rows.append({
            "files": count, "points": scene.count, "cells": len(scene.cell_coords), "convert_s": converted_s,
            "open_s": opened_s, "first_picture_s": first_s, "milliseconds": times,
            "growth": growth if outdoors in beside else None, "outdoors": outdoors,
            "resident_bytes": resident_memory(), "resident_before_bytes": before,
            "matched": None if scene.meta.exposures is None else scene.meta.exposures.matched,
        })  # fmt: skip
        if outdoors in beside:
            renderer.release()
        else:
            beside[outdoors] = renderer
    for renderer in beside.values():
        renderer.release()
    context.release()
    return {"scans": [f"procedural campus, {points:,} points a file, seed {seed}"], "size": list(size), "lod": settings.lod,
            "repeats": repeats, "rows": rows}


def _frames(renderer: "Renderer", beside: "Renderer", cameras: Sequence[Camera], settings: Settings, repeats: int
            ) -> tuple[dict[str, dict], dict[str, float]]:
    """Times of frames whose points are resident, and their ratio to those of ``beside``, by view: the median, and that of the
    worst direction."""
    times, growth = {}, {}
    for view in VIEWS:
        spent, other = [], []
        for number in range(-1, len(cameras) * repeats):
            pair = [_frame(one, cameras[number % len(cameras)], settings, view) for one in (renderer, beside)]
            if number >= 0:
                spent.append(pair[0])
                other.append(pair[1])
        ratios = np.divide(spent, other).reshape(repeats, len(cameras))
        times[view], growth[view] = summary(spent), float(np.median(ratios))
        growth[f"{view}, worst direction"] = float(np.median(ratios, axis=0).max())
    return times, growth


def _frame(renderer: "Renderer", camera: Camera, settings: Settings, view: str) -> float:
    while renderer.prefetch(camera, settings):
        time.sleep(0.002)
    return renderer.render(camera, settings, (view,), streaming=True).stats["total_ms"]


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    found = []
    for row in result["rows"]:
        times = "   ".join(f"{view} {v['p50']:6.1f} ms" for view, v in row["milliseconds"].items())
        grown = ", ".join(f"{view} {v:.2f}x" for view, v in (row["growth"] or {}).items())
        opened = f"converted in {row['convert_s']:.1f} s, opened in {row['open_s']:.2f} s"
        found.append((f"{counted(row['files'], 'file')}, {row['points'] / 1e6:.0f}M points",
                      f"{times}   growth {grown or '-'}   {opened}, first picture after {row['first_picture_s']:.2f} s   adds "
                      f"{(row['resident_bytes'] - row['resident_before_bytes']) / 1e6:.0f} MB of memory"))  # fmt: skip
    return found


def plot(result: dict, path: Path) -> None:
    """Frame time and opening time against the number of files."""
    from ..plots import INK, figure, save

    made, axes = figure(5.0, 4.0)
    x = [row["files"] for row in result["rows"]]
    for colour, view in enumerate(VIEWS):
        axes.plot(x, [row["milliseconds"][view]["p50"] for row in result["rows"]], "-o", color=INK[colour], label=view)
    axes.plot(x, [1e3 * row["open_s"] for row in result["rows"]], "-o", color=INK[3], label="opening from the cache")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("files")
    axes.set_ylabel("milliseconds")
    axes.legend(fontsize="x-small")
    save(made, path, result)
