"""Time and memory against scan size, from 1M to 1G points: with more rooms, and with more points in the same rooms.

The camera rotates inside one room, so that its view does not depend on the number of rooms.  Each scan is written to a folder
of its own, opened, rendered and deleted, unless it is kept.  As in the window, points are streamed into a pool of fixed size,
and all views but raw use occlusion culling.  A frame is timed once all its points are resident.
Frames of larger scans are timed alternately with those of the 10M scan; growth is the median ratio of such pairs, so that other
load on the machine cancels.  Scans that would not fit into memory or on the disk are reported and skipped.
"""

import gc
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.system import resident_memory
from ...common.errors import InputError
from ...common.paths import cache_dir
from ...common.progress import progress
from ...common.text import counted
from ...picture.camera import Camera, from_fov, look_at
from ...picture.settings import Settings
from ..memory_headroom import POINT_BYTES, POOL, available, problem
from ..plots import INK, MARKS, figure, save
from ..procedural_scan import POINTS_PER_ROOM, STATIONS, ProceduralScan, procedural_scene
from .frame_times import summary

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...render.renderer import Renderer

LADDER = (1_000_000, 3_000_000, 10_000_000, 30_000_000, 100_000_000, 300_000_000, 1_000_000_000)
"""Default numbers of points, two a decade.  This and the values below are what the bench is."""
SERIES = ("rooms", "density")
"""The two series: more rooms, and more points per room."""
DENSITY_ROOMS = 2
"""Rooms of the density series.  Both series have the same scan at DENSITY_ROOMS * POINTS_PER_ROOM points."""
YARDSTICK = 10_000_000
"""Number of points of the scan with which larger ones are compared."""
WARM_POINTS = 100_000
"""Number of points of a scan that is opened and drawn first, for warm-up."""
LOD = 1.0
"""Default level of detail, points per pixel."""
VIEWS = ("raw", "filled", "neural")
"""Views that are timed."""
TURNS, TURN = 24, 3.75
"""Number of frames, and degrees between them."""
_TIME_LIMIT_S = 60.0
"""Time limit of streaming the points of one picture, seconds."""


def scan_of(series: str, points: int, seed: int) -> ProceduralScan:
    """The scan of a series with a number of points."""
    if series == "rooms":
        return ProceduralScan(points, seed=seed)
    return ProceduralScan(points, max(1, min(DENSITY_ROOMS, points // len(STATIONS))), seed)


def inside(scan: ProceduralScan, size: tuple[int, int]) -> list[Camera]:
    """Cameras that rotate at a station of the middle room."""
    eye = scan.station(len(STATIONS) * scan.middle_room)
    angles = np.radians(TURN) * np.arange(TURNS)
    return [from_fov(*size, 60.0, look_at(eye, eye + (np.cos(a), np.sin(a), -0.1)), f"turn{n}") for n, a in enumerate(angles)]


def run_scale(sizes: Sequence[int], size: tuple[int, int], settings: Settings, repeats: int, seed: int = 1,
              keep: Path | None = None) -> dict:
    """Both series for the numbers of points ``sizes``.

    Level of detail: that of the settings, else LOD.  keep: a folder in which grids are kept and reused; None: they are deleted.
    """
    from ...render.device.context import create_context

    settings = replace(settings, lod=settings.lod or LOD)
    context = create_context()
    found: list[dict] = []
    device = None
    with progress(len(SERIES) * len(sizes), "scale", "size") as meter:
        warm = False
        for series in SERIES:
            beside: TimedScan | None = None
            for points in sizes:
                scan = scan_of(series, points, seed)
                row = {"series": series, "points": points, "rooms": scan.rooms, "fits": True}
                parent = cache_dir() if keep is None else keep
                kept = None if keep is None else keep / f"{series}-{points}-{seed}"
                why = None if kept is not None and kept.is_dir() else problem(points, available(parent))
                if why:
                    found.append(row | {"fits": False, "why": why})
                else:
                    parent.mkdir(parents=True, exist_ok=True)
                    if not warm:  # warm-up: loading and compiling is not part of any row
                        warming = scan_of(series, min(points, WARM_POINTS), seed)
                        first = TimedScan(context, warming, None, parent, size, settings)
                        for view in VIEWS:
                            first.frame(0, view)
                        first.release()
                        warm = True
                    timed = TimedScan(context, scan, kept, parent, size, settings)
                    found.append(row | timed.measure(repeats, beside))
                    device = timed.renderer.device
                    if beside is None and points >= YARDSTICK:
                        beside = timed
                    else:
                        timed.release()
                meter.update(1)
            if beside is not None:
                beside.release()
    context.release()
    facts = {} if device is None else {"opengl": device.renderer, "driver": device.version}
    return {
        "scans": [f"procedural scans, seed {seed}, {POINTS_PER_ROOM:,} points a room or {DENSITY_ROOMS} rooms"], **facts,
        "size": list(size), "lod": settings.lod, "repeats": repeats, "rows": found, "growth": growth(found),
    }


class TimedScan:
    """A renderer of one scan, opened, with its first picture drawn.

    The grid is in the folder ``kept``, made if missing, or in a temporary folder in ``parent``, deleted on release.
    """

    def __init__(self, context: "moderngl.Context", scan: ProceduralScan, kept: Path | None, parent: Path,
                 size: tuple[int, int], settings: Settings):
        from ...grid.open_scene import open_scene
        from ...render.culling.occlusion import Occlusion
        from ...render.renderer import Renderer

        self._own = None if kept else tempfile.TemporaryDirectory(prefix="pointglass-scale-", dir=parent)
        folder = kept or Path(self._own.name if self._own else "") / "grid"
        self.made_s = None
        if not folder.is_dir():
            start = time.perf_counter()
            procedural_scene(scan, folder)
            self.made_s = time.perf_counter() - start
        self.cameras, self.settings = inside(scan, size), settings
        gc.collect()
        self.before = resident_memory()  # includes the scan that this one is compared with
        start = time.perf_counter()
        self.scene: Scene = open_scene(folder)
        self.renderer = Renderer(context, self.scene, memory=POOL)
        self.renderer.render(self.cameras[0], settings, views=("raw",), streaming=True).image("raw")
        self.opened_s = time.perf_counter() - start
        self.renderer.pages.load_all()
        self.waited_s = 0.0
        self._seen = Occlusion()

    def release(self) -> None:
        self.renderer.release()
        if self._own is not None:
            self._own.cleanup()

    def frame(self, number: int, view: str) -> dict:
        """The stats of one frame, rendered once all its points are resident."""
        camera = self.cameras[number % len(self.cameras)]
        self.waited_s = max(self.waited_s, _fill(self.renderer, camera, self.settings))
        seen = self._seen if view != "raw" else None
        return self.renderer.render(camera, self.settings, (view,), seen, streaming=True).stats

    def measure(self, repeats: int, beside: "TimedScan | None") -> dict:
        """Seconds to make (None if it existed), to open and to draw the first picture; frame times; memory; growth.

        growth: median ratio of its frame times to those of ``beside`` with the same cameras, timed alternately.
        """
        times: dict[str, dict] = {}
        growth: dict[str, float] = {}
        drawn: list[int] = []
        stats: dict = {}
        for view in VIEWS:
            spent, other = [], []
            for number in range(-1, len(self.cameras) * repeats):
                stats = self.frame(number, view)
                reference = beside.frame(number, view) if beside is not None else stats
                if number >= 0:
                    spent.append(stats["total_ms"])
                    other.append(reference["total_ms"])
                    drawn.append(stats["points_drawn"])
            times[view] = summary(spent)
            growth[view] = float(np.median(np.divide(spent, other)))
        return {
            "make_s": self.made_s, "open_to_first_picture_s": self.opened_s, "to_full_picture_s": self.waited_s,
            "milliseconds": times, "growth": growth if beside is not None else None, "points_drawn": float(np.mean(drawn)),
            "pool_bytes": self.renderer.pages.nbytes, "packed_bytes": self.scene.count * POINT_BYTES,
            "resident_bytes": resident_memory(), "resident_before_bytes": self.before, "cells": len(self.scene.cell_coords),
            "layers": self.scene.layers, "spacing": self.scene.spacing, "raster": stats["raster"],
        }


def _fill(renderer: "Renderer", camera: Camera, settings: Settings) -> float:
    """Seconds until all points of a picture are resident.  Raises InputError after _TIME_LIMIT_S."""
    start = time.perf_counter()
    while time.perf_counter() - start < _TIME_LIMIT_S:
        if not renderer.prefetch(camera, settings):
            return time.perf_counter() - start
        time.sleep(0.002)
    raise InputError(f"the points of one picture were not read within {_TIME_LIMIT_S:g} s; the disk of the cache is too slow")


def growth(found: list[dict]) -> dict[str, dict[str, float]]:
    """By series and view: frame time of the largest scan / frame time of the YARDSTICK scan, or of the smallest without larger
    ones.

    It is the median ratio of alternating frames if measured, else the ratio of the p50.
    """
    out: dict[str, dict[str, float]] = {}
    for series in SERIES:
        ran = sorted((row for row in found if row["series"] == series and row["fits"]), key=lambda row: row["points"])
        if len(ran) > 1:
            base = next((row for row in ran if row["points"] >= YARDSTICK), ran[-1])
            base = ran[0] if base is ran[-1] else base
            last = ran[-1]
            out[series] = {"from": base["points"], "to": last["points"]} | (last.get("growth") or {
                view: last["milliseconds"][view]["p50"] / base["milliseconds"][view]["p50"] for view in VIEWS})
    return out


def short(points: float) -> str:
    """10_000_000 -> 10M."""
    return f"{points / 1e9:g}G" if points >= 1e9 else f"{points / 1e6:g}M" if points >= 1e5 else f"{points:g}"


def added(row: dict) -> int:
    """Increase of resident memory, bytes, from before opening a scan to after rendering it in all views."""
    return row["resident_bytes"] - row.get("resident_before_bytes", 0)


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    out = []
    for row in result["rows"]:
        name = f"by {row['series']}: {short(row['points'])} points, {counted(row['rooms'], 'room')}"
        if not row["fits"]:
            out.append((name, row["why"]))
            continue
        times = "   ".join(f"{view} {v['p50']:6.1f} ms" for view, v in row["milliseconds"].items())
        out.append((name, f"{times}   opens in {row['open_to_first_picture_s']:5.2f} s   packed "
                          f"{row['packed_bytes'] / 1e6:7.0f} MB   adds {added(row) / 1e6:7.0f} MB of memory   "
                          f"drawn {row['points_drawn'] / 1e6:5.2f}M"))
    for series, found in result["growth"].items():
        times = ", ".join(f"{view} {found[view]:.2f}x" for view in VIEWS)
        out.append((f"by {series}: growth", f"{times} from {short(found['from'])} to {short(found['to'])} points"))
    return out


def plot(result: dict, path: Path) -> None:
    """Frame time, opening time and memory against size; grey lines mark sizes that do not fit."""
    made, (left, right) = figure(9.5, 4.4, columns=2)
    ran = [row for row in result["rows"] if row["fits"]]
    for number, series in enumerate(SERIES):
        mine = [row for row in ran if row["series"] == series]
        x = [row["points"] for row in mine]
        style = ("-", "--")[number]
        for colour, view in enumerate(VIEWS):
            left.plot(x, [row["milliseconds"][view]["p50"] for row in mine], style + MARKS[number], color=INK[colour],
                      label=f"{view}, by {series}", markersize=4)
        left.plot(x, [1e3 * row["open_to_first_picture_s"] for row in mine], style + MARKS[number], color=INK[3], markersize=4,
                  label=f"open to first picture, by {series}")
        right.plot(x, [row["packed_bytes"] / 1e6 for row in mine], style + MARKS[number], color=INK[4], markersize=4,
                   label=f"packed points, by {series}")
        right.plot(x, [max(added(row), 1) / 1e6 for row in mine], style + MARKS[number], color=INK[5], markersize=4,
                   label=f"memory added, by {series}")
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axes, label in ((left, "milliseconds, p50"), (right, "megabytes")):
        for points in sorted({row["points"] for row in result["rows"] if not row["fits"]}):
            axes.axvline(points, color="grey", linewidth=0.6, linestyle=":")
            axes.annotate("does not fit", (points, 0.03), xycoords=("data", "axes fraction"), rotation=90, fontsize=6,
                          color="grey", ha="right")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: short(value)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        low, high = axes.get_ylim()
        axes.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}") if high < 20 * low else NullFormatter())
        axes.tick_params(labelsize=7, which="both")
        axes.set_xlabel("points")
        axes.set_ylabel(label)
        axes.grid(alpha=0.2)
        axes.legend(fontsize="x-small")
    save(made, path, result)
