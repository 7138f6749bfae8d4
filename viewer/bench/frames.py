"""Frame times by stage along eight views around a scan, for each of the four views: p50, p95, p99, cold and warm."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov, look_at
from viewer.progress import progress
from viewer.settings import VIEWS, Settings

if TYPE_CHECKING:
    from viewer.cloud.scene import Scene


def eight_views(scene: "Scene", size: tuple[int, int]) -> list[Camera]:
    """Eight cameras at the middle of a scene, turning once around its up axis (+z)."""
    low, high = scene.bounds
    centre = (low + high) / 2
    reach = float(np.linalg.norm(high - low))
    cameras = []
    for number, angle in enumerate(np.linspace(0, 2 * np.pi, 8, endpoint=False)):
        ahead = centre + reach * np.array([np.cos(angle), np.sin(angle), -0.1])
        cameras.append(from_fov(*size, 60.0, look_at(centre, ahead), f"turn{number}"))
    return cameras


def run_frames(scans: list[Path], size: tuple[int, int], settings: Settings, repeats: int, plot: Path | None) -> dict:
    """Times ``repeats`` rounds of eight cameras in every view.  The first frame of a view is ``cold_ms`` and left out."""
    from viewer.cloud import open_scene
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer

    scene = open_scene(scans)
    context = create_context()
    renderer = Renderer(context, scene)
    cameras = eight_views(scene, size)
    views: dict[str, dict] = {}
    facts: dict = {}
    with progress(len(VIEWS) * repeats * len(cameras), "timing", "frame") as meter:
        for view in VIEWS:
            times: dict[str, list[float]] = {}
            cold = renderer.render(cameras[0], settings, views=(view,)).stats["total_ms"]
            for camera in cameras * repeats:
                stats = renderer.render(camera, settings, views=(view,)).stats
                for name, value in {**stats["stages"], "total": stats["total_ms"]}.items():
                    times.setdefault(name, []).append(value)
                facts = stats
                meter.update(1)
            views[view] = {
                name: {f"p{q}": float(np.percentile(values, q)) for q in (50, 95, 99)} for name, values in times.items()
            }
            views[view]["total"]["cold_ms"] = cold
    renderer.release()
    context.release()
    if plot is not None:
        _plot(views, plot)
    return {
        "scans": [str(s) for s in scans], "points": scene.count, "size": list(size), "opengl": facts["opengl"],
        "raster": facts["raster"], "network": facts["network"], "approximations": facts["approximations"],
        "repeats": repeats, "views": views,
    }


def _plot(views: dict[str, dict], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    from viewer.tools.files import write_whole

    figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
    left = np.zeros(len(views))
    for stage in dict.fromkeys(name for stages in views.values() for name in stages if name != "total"):
        values = np.array([stages.get(stage, {"p50": 0.0})["p50"] for stages in views.values()])
        axes.barh(list(views), values, left=left, label=stage)
        left += values
    axes.invert_yaxis()
    axes.set_xlabel("milliseconds a frame, p50")
    axes.legend(ncols=3, fontsize="small")
    write_whole(path, lambda p: figure.savefig(p, format=path.suffix.lstrip(".") or "png", dpi=150))
    plt.close(figure)
