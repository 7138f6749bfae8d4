"""Time and memory against size, from 1M to 1G points: once by more rooms, once by more points in the same rooms.

The camera turns inside one room, so that what it sees of a larger floor stays the same.  Each size is made on the spot into
a folder of its own, opened from there as any scan is, drawn, and removed again, unless it is to be kept.  Points are streamed
into a pool of fixed size and hidden cells left out, as the window does; frames are timed once all that they need has come.
What would not fit into the memory or on the disk at hand is computed beforehand, said, and not attempted.
"""

import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.bench.frames import summary
from viewer.bench.plots import INK, MARKS, figure, save
from viewer.bench.procedural_scan import POINTS_PER_ROOM, STATIONS, ProceduralScan, procedural_scene
from viewer.camera import Camera, from_fov, look_at
from viewer.errors import InputError
from viewer.paths import cache_dir
from viewer.progress import progress
from viewer.settings import Memory, Settings

if TYPE_CHECKING:
    import moderngl

    from viewer.cloud.scene import Scene
    from viewer.render.renderer import Renderer

LADDER = (1_000_000, 3_000_000, 10_000_000, 30_000_000, 100_000_000, 300_000_000, 1_000_000_000)
SERIES = ("rooms", "density")
DENSITY_ROOMS = 2
"""Rooms of the density series; the two meet at this many times POINTS_PER_ROOM."""
LOD = 1.0
VIEWS = ("raw", "filled")
TURNS, TURN = 24, 3.75
"""Frames, and degrees from one to the next: a brisk look around."""
POOL = Memory(gpu=2 << 30)
"""What points may take, so that a billion of them fly with gigabytes to spare."""
_POINT = 12
_OVERHEAD = 1.1  # cell tables
_BASE = 400 << 20  # bytes: the process, OpenGL, one chunk of each thread
_PATIENCE = 60.0  # seconds for the points of one picture to come
_SPARE = 1 << 30  # bytes left free on the disk
_SHARE = 0.5  # of the memory at hand


@dataclass(frozen=True)
class Room:
    """What there is: bytes of memory and, where the cache lies, of disk."""

    memory: int
    disk: int


def available(folder: Path) -> Room:
    """Memory that can be had without swapping (a container's limit counts), and disk in the nearest folder that exists."""
    try:
        lines = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        memory = int(lines["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):
        memory = 4 << 30  # a system that does not say is taken for a small one
    try:
        limit = int(Path("/sys/fs/cgroup/memory.max").read_text())
        memory = min(memory, limit - int(Path("/sys/fs/cgroup/memory.current").read_text()))
    except (OSError, ValueError):
        pass
    while not folder.exists():
        folder = folder.parent
    return Room(memory, shutil.disk_usage(folder).free)


def needed(points: int) -> Room:
    """What a scan of that many points takes: on the disk its grid, in memory the renderer's pool and what is read ahead."""
    grid = int(points * _POINT * _OVERHEAD)
    return Room(min(grid, (POOL.gpu or 0) + POOL.read_ahead) + _BASE, grid + _SPARE)


def problem(points: int, there: Room) -> str | None:
    """Why that many points do not fit, in one line; None where they do."""
    need = needed(points)
    for what, wanted, given, share in (("memory", need.memory, there.memory, _SHARE), ("disk", need.disk, there.disk, 1.0)):
        if wanted > share * given:
            part = f"half of the {given / 1e9:.1f} GB" if share < 1 else f"the {given / 1e9:.1f} GB"
            return f"does not fit: needs {wanted / 1e9:.1f} GB of {what}, {part} at hand {'is' if share < 1 else 'are'} less"
    return None


def resident() -> int:
    """Bytes of memory this process holds, mapped files included."""
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def scan_of(series: str, points: int, seed: int) -> ProceduralScan:
    """A scan of one series."""
    if series == "rooms":
        return ProceduralScan(points, seed=seed)
    return ProceduralScan(points, max(1, min(DENSITY_ROOMS, points // len(STATIONS))), seed)


def inside(scan: ProceduralScan, size: tuple[int, int]) -> list[Camera]:
    """Cameras that look around from a station of the middle room."""
    eye = scan.station(len(STATIONS) * scan.middle_room)
    angles = np.radians(TURN) * np.arange(TURNS)
    return [from_fov(*size, 60.0, look_at(eye, eye + (np.cos(a), np.sin(a), -0.1)), f"turn{n}") for n, a in enumerate(angles)]


def run_scale(sizes: Sequence[int], size: tuple[int, int], settings: Settings, repeats: int, seed: int = 1,
              keep: Path | None = None) -> dict:
    """Both series over ``sizes``.  Level of detail: the settings', else LOD.  keep: a folder where grids stay, and where those
    of an earlier run are found again."""
    from viewer.render.context import create_context

    settings = replace(settings, lod=settings.lod or LOD)
    context = create_context()
    found: list[dict] = []
    device = None
    with progress(len(SERIES) * len(sizes), "scale", "size") as meter:
        for series in SERIES:
            for points in sizes:
                scan = scan_of(series, points, seed)
                row = {"series": series, "points": points, "rooms": scan.rooms, "fits": True}
                parent = cache_dir()
                kept = keep / f"{series}-{points}-{seed}" if keep is not None else None
                if kept is None or not kept.is_dir():
                    why = problem(points, available(keep or parent))
                else:
                    why = None
                if why:
                    found.append(row | {"fits": False, "why": why})
                elif kept is not None:
                    kept.parent.mkdir(parents=True, exist_ok=True)
                    measured, device = _measure(context, scan, kept, size, settings, repeats)
                    found.append(row | measured)
                else:
                    parent.mkdir(parents=True, exist_ok=True)
                    with tempfile.TemporaryDirectory(prefix="pointglass-scale-", dir=parent) as folder:
                        measured, device = _measure(context, scan, Path(folder) / "grid", size, settings, repeats)
                        found.append(row | measured)
                meter.update(1)
    context.release()
    facts = {} if device is None else {"opengl": device.renderer, "driver": device.version}
    return {
        "scans": [f"procedural scans, seed {seed}, {POINTS_PER_ROOM:,} points a room or {DENSITY_ROOMS} rooms"], **facts,
        "size": list(size), "lod": settings.lod, "repeats": repeats, "rows": found, "growth": growth(found),
    }


def _measure(context: "moderngl.Context", scan: ProceduralScan, folder: Path, size: tuple[int, int], settings: Settings,
             repeats: int):
    """One size: seconds to make (None where ``folder`` is there), to open and to draw first; frame times; memory."""
    from viewer.cloud import open_scene
    from viewer.render.occlusion import Occlusion
    from viewer.render.renderer import Renderer

    seconds = None
    if not folder.is_dir():
        start = time.perf_counter()
        procedural_scene(scan, folder)
        seconds = time.perf_counter() - start
    cameras = inside(scan, size)
    before = resident()
    start = time.perf_counter()
    scene: Scene = open_scene(folder)
    renderer = Renderer(context, scene, memory=POOL)
    renderer.render(cameras[0], settings, views=("raw",), streaming=True).image("raw")
    opened = time.perf_counter() - start
    times: dict[str, dict] = {}
    drawn: list[int] = []
    stats: dict = {}
    filling: list[float] = []
    for view in VIEWS:
        seen = Occlusion() if view != "raw" else None
        renderer.render(cameras[-1], settings, (view,), seen, streaming=True)
        spent = []
        for camera in cameras * repeats:
            filling.append(_fill(renderer, camera, settings))
            stats = renderer.render(camera, settings, (view,), seen, streaming=True).stats
            spent.append(stats["total_ms"])
            drawn.append(stats["points_drawn"])
        times[view] = summary(spent)
    held = resident()
    device = renderer.device
    row = {
        "make_s": seconds, "open_to_first_picture_s": opened, "to_full_picture_s": max(filling), "milliseconds": times,
        "points_drawn": float(np.mean(drawn)), "pool_bytes": renderer.pages.nbytes,
        "packed_bytes": scene.count * _POINT, "resident_bytes": held, "resident_before_bytes": before,
        "cells": len(scene.cell_coords), "layers": scene.layers, "spacing": scene.spacing, "raster": stats["raster"],
    }
    renderer.release()
    return row, device


def _fill(renderer: "Renderer", camera: Camera, settings: Settings) -> float:
    """Seconds until all points of a picture have come."""
    start = time.perf_counter()
    while time.perf_counter() - start < _PATIENCE:
        if not renderer.prefetch(camera, settings):
            return time.perf_counter() - start
        time.sleep(0.002)
    raise InputError(f"the points of one picture did not come within {_PATIENCE:g} s; is the disk of the cache that slow?")


def growth(found: list[dict]) -> dict[str, dict[str, float]]:
    """By series and view: p50 at the largest size that ran over that at 10M (or, smaller ladders, at the smallest)."""
    out: dict[str, dict[str, float]] = {}
    for series in SERIES:
        ran = sorted((row for row in found if row["series"] == series and row["fits"]), key=lambda row: row["points"])
        if len(ran) > 1:
            base = next((row for row in ran if row["points"] >= 10_000_000), ran[-1])
            base = ran[0] if base is ran[-1] else base
            out[series] = {"from": base["points"], "to": ran[-1]["points"]} | {
                view: ran[-1]["milliseconds"][view]["p50"] / base["milliseconds"][view]["p50"] for view in VIEWS
            }
    return out


def short(points: float) -> str:
    """10_000_000 -> 10M."""
    return f"{points / 1e9:g}G" if points >= 1e9 else f"{points / 1e6:g}M" if points >= 1e5 else f"{points:g}"


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    out = []
    for row in result["rows"]:
        name = f"by {row['series']}: {short(row['points'])} points, {row['rooms']} rooms"
        if not row["fits"]:
            out.append((name, row["why"]))
            continue
        times = "   ".join(f"{view} {v['p50']:6.1f} ms" for view, v in row["milliseconds"].items())
        out.append((name, f"{times}   opens in {row['open_to_first_picture_s']:5.2f} s   packed "
                          f"{row['packed_bytes'] / 1e6:7.0f} MB   resident {row['resident_bytes'] / 1e6:7.0f} MB   "
                          f"drawn {row['points_drawn'] / 1e6:5.2f}M"))
    for series, found in result["growth"].items():
        times = ", ".join(f"{view} {found[view]:.2f}x" for view in VIEWS)
        out.append((f"by {series}: growth", f"{times} from {short(found['from'])} to {short(found['to'])} points"))
    return out


def plot(result: dict, path: Path) -> None:
    """Frame time, opening time and memory against size; sizes that did not fit as grey lines."""
    made, (left, right) = figure(9.5, 4.4, columns=2)
    ran = [row for row in result["rows"] if row["fits"]]
    for number, series in enumerate(SERIES):
        mine = [row for row in ran if row["series"] == series]
        x = [row["points"] for row in mine]
        style = ("-", "--")[number]
        for colour, view in enumerate(VIEWS):
            left.plot(x, [row["milliseconds"][view]["p50"] for row in mine], style + MARKS[number], color=INK[colour],
                      label=f"{view}, by {series}", markersize=4)
        left.plot(x, [1e3 * row["open_to_first_picture_s"] for row in mine], style + MARKS[number], color=INK[2], markersize=4,
                  label=f"open to first picture, by {series}")
        right.plot(x, [row["packed_bytes"] / 1e6 for row in mine], style + MARKS[number], color=INK[3], markersize=4,
                   label=f"packed points, by {series}")
        right.plot(x, [row["resident_bytes"] / 1e6 for row in mine], style + MARKS[number], color=INK[4], markersize=4,
                   label=f"resident, by {series}")
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axes, label in ((left, "milliseconds, p50"), (right, "megabytes")):
        for points in sorted({row["points"] for row in result["rows"] if not row["fits"]}):
            axes.axvline(points, color="grey", linewidth=0.6, linestyle=":")
            axes.annotate("does not fit here", (points, 0.03), xycoords=("data", "axes fraction"), rotation=90, fontsize=6,
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
