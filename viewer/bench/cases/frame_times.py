"""Frame times by stage along a camera path or over eight named views, for each of the four views and at several sizes.

Reported are p50, p95, p99, the frame rate of the slowest 1 %, and the first (cold) frame; on a GPU also the rate of pipelined
frames.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.progress import progress
from ...picture.settings import Settings
from ...picture.views import VIEWS
from ...work.places.viewpoints import camera_path, named_views
from ..bench_input import Subject
from ..plots import INK, figure, save

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...render.renderer import Renderer


def one_percent_low(milliseconds: Sequence[float]) -> float:
    """Frame rate of the slowest 1 % of the frames, at least one: 1000 / mean milliseconds."""
    slowest = sorted(milliseconds, reverse=True)[: max(1, len(milliseconds) // 100)]
    return 1000.0 / float(np.mean(slowest))


def summary(milliseconds: Sequence[float]) -> dict[str, float]:
    """p50, p95 and p99, milliseconds."""
    return {f"p{q}": float(np.percentile(milliseconds, q)) for q in (50, 95, 99)}


def in_a_row(renderer: "Renderer", cameras: "Sequence[Camera]", settings: Settings, view: str) -> float:
    """Frames per second without waiting for each frame, as in the window: on a GPU, the host prepares the next one
    meanwhile."""
    renderer.context.finish()
    begun = time.perf_counter()
    for camera in cameras:
        renderer.render(camera, settings, views=(view,))
    renderer.context.finish()
    return len(cameras) / (time.perf_counter() - begun)


def cameras_along(scene: "Scene", along: str, size: tuple[int, int]) -> "list[Camera]":
    """Cameras of the fixed path (``path``) or of the named views (``views``)."""
    return camera_path(scene, size) if along == "path" else named_views(scene, size)


def run_frames(subject: Subject, sizes: Sequence[tuple[int, int]], settings: Settings, repeats: int,
               along: str = "path") -> dict:
    """Times ``repeats`` rounds at each size in each view.

    ``cold_ms``: time of the first frame of a view at a size, with compilation, allocation and loading; not part of the others.
    """
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    scene = subject.scene()
    context = create_context()
    runs: list[dict] = []
    facts: dict = {}
    given: dict = {}
    made = cameras_along(scene, along, sizes[0])
    with progress(len(sizes) * len(VIEWS) * repeats * len(made), "timing", "frame") as meter:
        for size in sizes:
            renderer = Renderer(context, scene)
            renderer.pages.load_all()
            cameras = [camera.resized(*size) for camera in made]
            run: dict = {"size": list(size), "views": {}}
            for view in VIEWS:
                cold = renderer.render(cameras[0], settings, views=(view,)).stats
                times: dict[str, list[float]] = {}
                points: list[int] = []
                for camera in cameras * repeats:
                    stats = renderer.render(camera, settings, views=(view,)).stats
                    for name, value in {**stats["stages"], "total": stats["total_ms"]}.items():
                        times.setdefault(name, []).append(value)
                    points.append(stats["points_drawn"])
                    facts = stats
                    meter.update(1)
                run["views"][view] = {
                    name: {**summary(values), "cold_ms": cold["total_ms"] if name == "total" else cold["stages"][name]}
                    for name, values in times.items()
                }
                run["views"][view]["total"]["low1_fps"] = one_percent_low(times["total"])
                if not renderer.device.software:
                    run["views"][view]["total"]["in_a_row_fps"] = in_a_row(renderer, cameras * repeats, settings, view)
                run |= {"frames": len(cameras) * repeats, "points_drawn": float(np.mean(points))}
            runs.append(run)
            given = subject.facts(scene, renderer.device)
            renderer.release()
    context.release()
    return {
        **given, "sizes": [list(size) for size in sizes], "along": along,
        "cameras": [camera.name for camera in made], "repeats": repeats, "raster": facts["raster"],
        "network": facts["network"], "quality": settings.quality, "device": facts["device"],
        "approximations": facts["approximations"], "runs": runs,
    }


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    out = [("rasteriser, network", f"{result['raster']}, {result['network']}"),
           ("approximations", ", ".join(result["approximations"]) or "none")]
    for run in result["runs"]:
        size = "{}x{}".format(*run["size"])
        for view, stages in run["views"].items():
            for stage, v in stages.items():
                low = f"   1 % low {v['low1_fps']:5.1f} frames/s" if "low1_fps" in v else ""
                low += f", in a row {v['in_a_row_fps']:.1f}" if "in_a_row_fps" in v else ""
                out.append((f"{size} {view}: {stage}", f"p50 {v['p50']:8.1f}   p95 {v['p95']:8.1f}   p99 {v['p99']:8.1f}"
                            f"   cold {v['cold_ms']:8.1f} ms{low}"))
    return out


def plot(result: dict, path: Path) -> None:
    """Stacked stages, a bar for each view and size, and a mark at p99."""
    bars = [(f"{view}\n{run['size'][0]}x{run['size'][1]}", stages) for run in result["runs"]
            for view, stages in run["views"].items()]
    made, axes = figure(7.5, 1.6 + 0.42 * len(bars))
    left = np.zeros(len(bars))
    names = [name for name, _ in bars]
    stages = dict.fromkeys(name for _, held in bars for name in held if name != "total")
    for number, stage in enumerate(stages):
        values = np.array([held.get(stage, {"p50": 0.0})["p50"] for _, held in bars])
        axes.barh(names, values, left=left, label=stage, color=INK[number % len(INK)])
        left += values
    axes.plot([held["total"]["p99"] for _, held in bars], names, "|", color="black", markersize=12, label="whole frame, p99")
    axes.invert_yaxis()
    axes.tick_params(labelsize=7)
    axes.set_xlabel(f"milliseconds per frame, p50 by stage, along the {result['along']}")
    axes.legend(ncols=4, fontsize="x-small")
    save(made, path, result)
