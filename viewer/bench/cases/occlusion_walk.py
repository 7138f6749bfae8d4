"""Error and savings of occlusion culling on a walk through many rooms with one jump, with and without the frame history.

A pixel is wrong if the keep-masks differ, or if a channel of the filled picture differs by more than LEVELS.  Frame: metres, as
in viewer.bench.procedural_scan.
"""

import itertools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.progress import progress
from ...picture.camera import Camera, from_fov, look_at
from ...picture.settings import Settings
from ..procedural_scan import DOOR, EYE, PITCH, ProceduralScan, procedural_scene

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...render.renderer import Renderer

ROOMS = 20
"""Default number of rooms.  This and the values below are what the bench is."""
LIMIT = 0.001
"""Upper limit of the share of wrong pixels in a frame."""
LEVELS = 2
"""Largest allowed difference of a channel, 0 to 255."""
VIEWS = ("filtered", "filled")
"""Views that are rendered: the keep-mask and the filled picture."""
FRAMES = 60
"""Default number of frames."""
_STEP = 0.3
"""Metres per frame: brisk walking at five frames per second."""
_SWAY = np.radians(40.0)
"""Amplitude of looking left and right, radians."""


def _stops(scan: ProceduralScan, first: int, step: int) -> np.ndarray:
    """(S, 3) metres: the path through the middles of rooms and doors, alternating in direction from row to row."""
    columns = scan.columns
    order = [row * columns + (across if row % 2 == 0 else columns - 1 - across)
             for row in range(-(-scan.rooms // columns)) for across in range(columns)]
    order = [room for room in order if room < scan.rooms]
    order = order[order.index(first) :: step]
    stops = [scan.room_middle(order[0]) + (0.0, 0.0, EYE)]
    for here, there in itertools.pairwise(order):
        low, axis = min(here, there), 0 if abs(here - there) == 1 else 1
        begin = scan.doors[low, 2 * axis + 1]
        if begin < 0:  # in a short last row, there may be no door at this end
            break
        door = scan.room_middle(low) - PITCH * (0.5, 0.5, 0) + (0, 0, EYE)
        door[axis] += PITCH[axis]
        door[1 - axis] += begin + DOOR[0] / 2
        stops += [door, scan.room_middle(there) + (0.0, 0.0, EYE)]
    if len(stops) == 1:  # a room without a door: towards its wall
        stops.append(stops[0] + (0.4 * PITCH[0], 0.0, 0.0))
    return np.array(stops)


def walk(scan: ProceduralScan, size: tuple[int, int], frames: int) -> tuple[list[Camera], int]:
    """Cameras of a walk through the rooms, looking left and right, and the index of the first frame after a jump.

    The jump is to the other end of the floor, from which the walk goes backwards.
    """
    jump = frames * 2 // 3
    cameras: list[Camera] = []
    for stops, count in ((_stops(scan, 0, 1), jump), (_stops(scan, scan.rooms - 1, -1), frames - jump)):
        legs = np.linalg.norm(np.diff(stops, axis=0), axis=1)
        at = np.minimum(np.arange(count + 1) * _STEP, legs.sum())
        path = np.stack([np.interp(at, np.concatenate([[0], np.cumsum(legs)]), stops[:, k]) for k in range(3)], axis=1)
        headings = np.diff(stops, axis=0) / legs[:, None]
        leg = np.minimum(np.searchsorted(np.cumsum(legs), at, side="right"), len(legs) - 1)
        angle = np.unwrap(np.arctan2(headings[leg, 1], headings[leg, 0]))
        angle = np.convolve(np.pad(angle, 4, mode="edge"), np.full(9, 1 / 9), mode="valid")  # smooth turns
        angle = angle + _SWAY * np.sin(at * (2 * np.pi / 5.0))
        for eye, a in zip(path[:count], angle[:count]):
            ahead = eye + (np.cos(a), np.sin(a), -0.1)
            cameras.append(from_fov(*size, 60.0, look_at(eye, ahead), f"walk{len(cameras)}"))
    return cameras, jump


def compare(renderer: "Renderer", cameras: list[Camera], settings: Settings, meter=lambda: None, keep: int | None = None
            ) -> tuple[list[dict], list[np.ndarray]]:
    """A row for each frame: share of wrong pixels, and drawn points and milliseconds with and without history.

    keep: index of a frame; its pictures without and with history, and its wrong pixels, are returned too.
    """
    from ...render.culling.occlusion import Occlusion

    history = Occlusion()
    rows, kept = [], []
    renderer.render(cameras[0], settings, VIEWS, Occlusion())  # compiles the shaders

    def made(camera: Camera, past: "Occlusion | None") -> tuple[dict, np.ndarray, np.ndarray]:
        frame = renderer.render(camera, settings, VIEWS, past)
        return frame.stats, frame.mask().copy(), frame.image("filled").copy()

    for number, camera in enumerate(cameras):
        if number % 2:  # alternating, as the second frame finds points in the caches
            stats, other, picture = made(camera, history)
            plain, mask, filled = made(camera, None)
        else:
            plain, mask, filled = made(camera, None)
            stats, other, picture = made(camera, history)
        wrong_mask = mask != other
        wrong = wrong_mask | (np.abs(filled.astype(np.int16) - picture) > LEVELS).any(axis=-1)
        if number == keep:
            kept = [filled, picture, wrong]
        hidden = stats.get("occlusion", {"cells_hidden": 0})
        rows.append({
            "wrong": float(wrong.mean()), "wrong_mask": float(wrong_mask.mean()), "cells": plain["cells_drawn"],
            "cells_hidden": hidden["cells_hidden"], "points": plain["points_drawn"], "points_with": stats["points_drawn"],
            "ms": plain["stages"]["raster"], "ms_with": stats["stages"]["raster"],
            "total_ms": plain["total_ms"], "total_ms_with": stats["total_ms"], "looked": "occlusion" in stats,
        })  # fmt: skip
        meter()
    return rows, kept


def summary(rows: list[dict], jump: int) -> dict:
    """Summary: errors of the worst frame and after the jump, and the savings in frames with a history."""
    steady = [row for number, row in enumerate(rows) if number not in (0, jump)]

    def share(a: str, b: str) -> float:
        return float(np.median([row[a] / max(row[b], 1e-9) for row in steady]))

    def middle(name: str) -> float:
        return float(np.median([row[name] for row in steady]))

    worst = max(row["wrong"] for row in rows)
    return {
        "frames": len(rows), "jump": jump, "limit": LIMIT,
        "wrong_worst": worst, "failed": worst >= LIMIT, "wrong_mean": float(np.mean([row["wrong"] for row in rows])),
        "wrong_after_jump": max(row["wrong"] for row in rows[jump : jump + 3]),
        "points_drawn_share": share("points_with", "points"), "raster_time_share": share("ms_with", "ms"),
        "frame_time_share": share("total_ms_with", "total_ms"),
        "all_time_share": sum(row["total_ms_with"] for row in rows) / sum(row["total_ms"] for row in rows),
        "raster_ms": middle("ms"), "raster_ms_with": middle("ms_with"),
        "frame_ms": middle("total_ms"), "frame_ms_with": middle("total_ms_with"),
        "frames_light": sum(not row["looked"] for row in rows),
    }  # fmt: skip


def run_occlusion(rooms: int = ROOMS, points: int = 100_000_000, size: tuple[int, int] = (960, 720), frames: int = FRAMES,
                  *, seed: int = 1, scene: "Scene | None" = None, lod: float | None = None) -> dict:
    """The walk: a summary, and ``rows``, one per frame.  ``failed``: whether a frame has too many wrong pixels.

    scene: of the same scan, if it exists already.  lod: as in Settings.
    """
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    scan = ProceduralScan(points, rooms, seed)
    scene = scene or procedural_scene(scan)
    context = create_context()
    renderer = Renderer(context, scene, raster="compute")
    renderer.pages.load_all()
    cameras, jump = walk(scan, size, frames)
    with progress(len(cameras), "occlusion", "frame") as meter:
        rows, _ = compare(renderer, cameras, Settings(view="filled", raster="compute", lod=lod), lambda: meter.update(1))
    result = {
        "scans": [scan.label], "points": scene.count, "rooms": rooms, "seed": seed, "size": list(size), "lod": lod,
        "opengl": renderer.device.renderer, "driver": renderer.device.version, **summary(rows, jump), "rows": rows,
    }
    renderer.release()
    context.release()
    return result


def rows(result: dict) -> list[tuple[str, str]]:
    """The table."""
    rows, jump = result["rows"], result["jump"]
    heaviest = max((row for number, row in enumerate(rows) if number not in (0, jump)), key=lambda row: row["points"])

    def times(row: dict, kind: str) -> str:
        return f"{row[kind + '_with']:,.0f} ms of {row[kind]:,.0f}"

    return [
        ("frames, first frame after the jump", f"{result['frames']}, {jump}"),
        ("wrong pixels, worst frame", f"{100 * result['wrong_worst']:.4f} % (limit {100 * result['limit']:g} %)"),
        ("wrong pixels, worst of three after the jump", f"{100 * result['wrong_after_jump']:.4f} %"),
        ("wrong pixels, mean of all frames", f"{100 * result['wrong_mean']:.4f} %"),
        ("points drawn, median", f"{100 * result['points_drawn_share']:.0f} % of those without history"),
        ("raster stage, median", f"{result['raster_ms_with']:,.0f} ms of {result['raster_ms']:,.0f}"),
        ("whole frame, median", f"{result['frame_ms_with']:,.0f} ms of {result['frame_ms']:,.0f}"),
        ("whole frame, median of the ratios", f"{100 * result['frame_time_share']:.0f} % of the time"),
        ("all frames together", f"{100 * result['all_time_share']:.0f} % of the time"),
        (f"the heaviest frame, {heaviest['points'] / 1e6:.1f}M points", times(heaviest, "total_ms")),
        ("the frame after the jump", times(rows[jump], "total_ms")),
        ("frames with too few points to test for hidden cells", str(result["frames_light"])),
    ]  # fmt: skip


def plot(result: dict, path: Path) -> None:
    """Wrong pixels, points and milliseconds of each frame."""
    from ..plots import INK, figure, save

    made, (upper, middle, lower) = figure(8, 7, rows=3)
    rows, along = result["rows"], np.arange(result["frames"])
    upper.plot(along, [100 * row["wrong"] for row in rows], color=INK[0])
    upper.axhline(100 * result["limit"], color="grey", linewidth=0.7, linestyle="--")
    upper.set_ylabel("wrong pixels, %")
    for axes, name, label, scale in ((middle, "points", "points drawn, M", 1e-6), (lower, "ms", "raster stage, ms", 1.0)):
        axes.plot(along, [scale * row[name] for row in rows], color=INK[5], label="without history")
        axes.plot(along, [scale * row[f"{name}_with"] for row in rows], color=INK[0], label="with history")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.legend(fontsize="small")
    for axes in (upper, middle, lower):
        axes.axvline(result["jump"], color="grey", linewidth=0.5)
    lower.set_xlabel("frame; vertical line: jump to the other end of the floor")
    save(made, path, result)
