"""Comparison of frame times in one run: ours, the paper's pipeline as published, and Open3D.

Stages that only connect the parts of this implementation of the paper's pipeline (draw list, copies between OpenGL and torch)
are not in its total.  The comparison counts as fair if the paper's network reaches at least the share FAIR of the device's
measured matrix rate.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.evaluation.open3d_points import POINT_SIZES
from ....model.network.qualities import DEFAULT
from ....model.network.weights_folder import shipped_qualities
from ...common.progress import progress
from ...picture.settings import Settings
from ...work.places.viewpoints import camera_path
from ..bench_input import Subject
from ..matrix_rate import conv_rate, matmul_rate
from ..opponents import COUNTED, LEFT_OUT, Open3DContender, PaperNetwork, Published, fastest_precision
from ..plots import INK, figure, save
from .frame_times import summary

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...render.renderer import Renderer

FAIR = 0.4
"""Least share of the matrix rate that the paper's network must reach.  Chosen by hand."""
PAPER = "paper, as published"
"""Name of the paper's pipeline in tables."""
FRAMES = {"cuda": 48, "cpu": 4}
"""Default number of cameras by device: on a CPU, a frame of the paper's network takes seconds."""


def run_versus(subject: Subject, sizes: Sequence[tuple[int, int]], settings: Settings, repeats: int,
               frames: int | None = None) -> dict:
    """Times all pipelines on the same cameras, alternating camera by camera, so that other load on the machine affects all.

    frames: number of cameras along the path; default: FRAMES.  On a CPU, the paper's network and Open3D render each once.
    """
    from ....model.network.reconstruct import cuda_problem
    from ...common.errors import DeviceError, Option
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    problem = "not requested" if settings.device == "cpu" else cuda_problem()
    if settings.device == "cuda" and problem:
        raise DeviceError(problem, option=Option("--device", "cuda"), remedy="see `pointglass doctor`, or use --device cpu")
    device = "cpu" if problem else "cuda"
    scene = subject.scene()
    context = create_context()
    renderer = Renderer(context, scene, device=device)
    renderer.pages.load_all()
    open3d = Open3DContender(scene)
    count = frames or FRAMES[device]
    try:
        with progress(len(sizes) * count, "against others", "frame") as meter:
            runs = [_run(context, scene, renderer, open3d, camera_path(scene, size, count), settings, device, repeats,
                         lambda: meter.update(1)) for size in sizes]
        facts = subject.facts(scene, renderer.device)
    finally:
        open3d.close()
        renderer.release()
        context.release()
    few = "" if device == "cuda" else ("; the paper's pipeline and Open3D render each once, as the paper's network takes "
                                       "seconds per frame on a CPU")
    back = "" if open3d.reason else "; Open3D's time includes the read-back of its picture, the others' do not"
    return {
        **facts, "sizes": [list(size) for size in sizes], "device": device, "frames": count, "repeats": repeats,
        "open3d": open3d.reason or "drew", "runs": runs,
        "note": "random weights in the paper's network, which do not change its run time; "
                f"{count} cameras of the path{few}{back}",
    }


def _run(context: "moderngl.Context", scene: "Scene", renderer: "Renderer", open3d: Open3DContender, cameras: "list[Camera]",
         settings: Settings, device: str, repeats: int, done: Callable[[], object]) -> dict:
    """The comparison at one picture size."""
    from ....model.network.reconstruct import PRECISIONS

    size = cameras[0].width, cameras[0].height
    precision, tried = fastest_precision(device, size)
    network = PaperNetwork(size, device, PRECISIONS[precision])
    paper = Published(context, scene, network)
    compared = sorted(shipped_qualities(trainable=True), key=lambda quality: quality != DEFAULT)  # the default first
    ours = {f"ours, {quality}": replace(settings, view="neural", quality=quality) for quality in compared}
    spent: dict[str, list[dict[str, float]]] = {name: [] for name in (*ours, PAPER)}
    names = {}
    before = _rates(network, size)
    paper.frame(cameras[0])
    for name, mine in ours.items():
        for number in (0, 1):  # warm-up of both networks
            names[name] = renderer.render(cameras[number % len(cameras)], mine).stats["network"]
    for camera in cameras:
        for name, mine in ours.items():
            renderer.render(camera, mine)
            for _ in range(repeats):
                stats = renderer.render(camera, mine).stats
                spent[name].append({**stats["stages"], "total": stats["total_ms"]})
        for _ in range(repeats if device == "cuda" else 1):
            times = paper.frame(camera)
            spent[PAPER].append({**times, "total": sum(times[stage] for stage in COUNTED)})
        if (times := open3d.frame(camera)) is not None:
            spent.setdefault(open3d.name, []).append(times)
        done()
    paper.release()
    rates = {name: max(rate, before[name]) for name, rate in _rates(network, size).items()}
    names |= {PAPER: f"{network.parameters:,} parameters, {precision}, random weights", open3d.name: None}
    contenders = {
        name: {
            "network": names[name], "frames": len(frames),
            "milliseconds": {stage: summary([f[stage] for f in frames]) for stage in frames[0]},
        }
        for name, frames in spent.items()
    }
    return {
        "size": list(size), "contenders": contenders, "precision": precision, "precisions_tried_ms": tried,
        "ratios": ratios(contenders), "fairness": fairness(min(frame["network"] for frame in spent[PAPER]), size, rates),
    }


def _rates(network: PaperNetwork, size: tuple[int, int]) -> dict[str, float]:
    """Operations per second of the device in the precision of ``network``."""
    return {"matmul": matmul_rate(network.device, network.dtype), "convolution": conv_rate(network.device, network.dtype, size)}


def ratios(contenders: dict[str, dict]) -> dict[str, dict[str, float]]:
    """For each of our networks: time of each other pipeline / our time, p50 of whole frames."""
    middle = {name: held["milliseconds"]["total"]["p50"] for name, held in contenders.items()}
    return {
        mine: {other: middle[other] / middle[mine] for other in middle if not other.startswith("ours")}
        for mine in middle if mine.startswith("ours")
    }


def fairness(milliseconds: float, size: tuple[int, int], rates: dict[str, float]) -> dict:
    """Operations per second of the paper's network in its best frame, their share of the device's rates, and whether it is
    fair."""
    from ....model.network.unet import PaperUNet, mac_per_pixel

    mac = mac_per_pixel(PaperUNet(), 32)
    reached = 2.0 * mac * size[0] * size[1] / (milliseconds / 1e3)
    share = reached / rates["matmul"]
    return {"mac_per_pixel": mac, "operations_per_s": reached, "matmul_rate": rates["matmul"],
            "convolution_rate": rates["convolution"], "share_of_matmul": share,
            "share_of_convolution": reached / rates["convolution"], "needed": FAIR, "fair": share >= FAIR,
            "busy": share > 1.0}


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    out = [("note", result["note"])]
    if result["open3d"] != "drew":
        out.append(("Open3D", f"left out: {result['open3d']}"))
    for run in result["runs"]:
        size = "{}x{}".format(*run["size"])
        for name, held in run["contenders"].items():
            stages = ", ".join(f"{stage} {v['p50']:.1f}" for stage, v in held["milliseconds"].items() if stage != "total")
            total = held["milliseconds"]["total"]
            out.append((f"{size} {name}", f"p50 {total['p50']:8.1f}   p95 {total['p95']:8.1f} ms   ({stages})"))
        for mine, others in run["ratios"].items():
            out.append((f"{size} {mine}", ", ".join(f"{ratio:.2f}x the speed of {other}" for other, ratio in others.items())))
        fair = run["fairness"]
        out.append((f"{size} the paper's network", f"{fair['operations_per_s'] / 1e12:.2f} TFLOP/s in {run['precision']}, "
                    f"{fair['share_of_matmul']:.0%} of the matrix rate {fair['matmul_rate'] / 1e12:.2f}, "
                    f"{fair['share_of_convolution']:.0%} of one large convolution's; at least {fair['needed']:.0%} needed: "
                    f"{'fair' if fair['fair'] else 'NOT fair'}"
                    + (" (above 100 %: the device was busy when its rate was measured; run again)" if fair["busy"] else "")))
    return out


def plot(result: dict, path: Path) -> None:
    """Stacked stages of each pipeline."""
    bars = [(f"{name}\n{run['size'][0]}x{run['size'][1]}", held["milliseconds"]) for run in result["runs"]
            for name, held in run["contenders"].items()]
    made, axes = figure(8.0, 1.4 + 0.5 * len(bars))
    left = np.zeros(len(bars))
    names = [name for name, _ in bars]
    skip = ("total", *LEFT_OUT, *(f"{size:g} px points" for size in POINT_SIZES[1:]))
    for number, stage in enumerate(dict.fromkeys(s for _, held in bars for s in held if s not in skip)):
        values = np.array([held.get(stage, {"p50": 0.0})["p50"] for _, held in bars])
        axes.barh(names, values, left=left, label=stage, color=INK[number % len(INK)])
        left += values
    for name, value in zip(names, left, strict=True):
        axes.annotate(f" {value:,.0f} ms", (value, name), fontsize=7, va="center")
    axes.set_xlim(0, 1.15 * left.max())
    axes.invert_yaxis()
    axes.tick_params(labelsize=7)
    axes.set_xlabel("milliseconds per frame, p50 by stage")
    axes.legend(ncols=4, fontsize="x-small")
    save(made, path, result)
