"""Run time against error: every approximation with what it saves and what it costs, against the exact frame.

Exact: every point, 16-bit positions, the filter's own levels, full resolution, the network in fp32.  Geometry is judged on
the filled picture and the keep-mask (a point moved by one pixel on black says nothing), the network on its own picture.
Exact and approximate frames are timed in turn, camera by camera, so that a noisy machine is noisy for both.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from viewer.bench.frames import eight_views
from viewer.camera import Camera
from viewer.progress import progress
from viewer.settings import Settings

if TYPE_CHECKING:
    from viewer.cloud.scene import Scene
    from viewer.render.frame import Frame
    from viewer.render.renderer import Renderer

EXACT = Settings(view="filled", precision="fp32")


@dataclass(frozen=True)
class Approximation:
    """One row.  view: what it is judged on.  settings: changed from EXACT.  scale: of the picture's sides, enlarged again to
    be compared.  bits: of a packed coordinate.  against: quality of the exact frame's network."""

    group: str
    name: str
    view: str = "filled"
    settings: Settings = EXACT
    scale: float = 1.0
    bits: int = 16
    against: str = EXACT.quality


def approximations(qualities: list[str], precisions: list[str]) -> list[Approximation]:
    """The table.  qualities: with weights; the first is the exact frame's.  precisions: that run here."""
    first = qualities[0]
    network = replace(EXACT, view="neural", quality=first)
    table = [
        *(Approximation("level of detail", f"{p:g} points a pixel", settings=replace(EXACT, lod=p)) for p in (0.5, 1, 2, 4, 8)),
        *(Approximation("packing", f"{bits} bits a coordinate", bits=bits) for bits in (10, 12, 13, 14)),
        *(Approximation("filter", f"{n} levels", settings=replace(EXACT, filter_levels=n)) for n in (1, 2, 3, 4)),
        *(Approximation("filter", name, settings=replace(EXACT, filter=name)) for name in ("paper-code", "npbg++", "off")),
        *(Approximation("soft depth", name, settings=replace(EXACT, soft_z=name)) for name in ("paper-code", "paper-text")),
        *(Approximation("internal resolution", f"{s:.0%} of each side", view="neural", settings=network, scale=s)
          for s in (0.75, 0.5)),
        *(Approximation("precision", p, view="neural", settings=replace(network, precision=p)) for p in precisions),
        *(Approximation("network", q, view="neural", settings=replace(network, quality=q)) for q in qualities[1:]),
        Approximation("network", "none: the filled picture", view="neural", settings=replace(EXACT, view="filled")),
    ]
    return [replace(row, against=first) for row in table]


@dataclass(frozen=True)
class Cost:
    """Of an approximation over all cameras: milliseconds p50, time as a share of the exact frame's in the same round, PSNR of
    the picture against the exact one (infinite: equal), largest difference in 255ths, share of the keep-mask that differs."""

    milliseconds: float
    time: float
    psnr: float
    largest: float
    mask: float


def coarser(scene: "Scene", bits: int) -> "Scene":
    """The scene with each coordinate rounded to ``bits`` bits: the middle of a larger step."""
    if bits == 16:
        return scene
    drop = 16 - bits
    low, middle = (1 << drop) - 1, 1 << (drop - 1)
    points = np.array(scene.points)
    both = ~np.uint32(low | low << 16)
    points[:, 0] = points[:, 0] & both | np.uint32(middle | middle << 16)
    points[:, 1] = points[:, 1] & ~np.uint32(low) | np.uint32(middle)
    return replace(scene, points=points)


def _enlarged(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    from PIL import Image

    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BILINEAR))


def measure(exact: "Renderer", other: "Renderer", approximation: Approximation, cameras: list[Camera], repeats: int,
            meter: Callable[[], object]) -> Cost:
    """Times and judges one approximation.  exact, other: of the exact scene and of the one to draw; may be the same."""
    view, size = approximation.view, (cameras[0].width, cameras[0].height)
    shown = "filled" if approximation.settings.view == "filled" and view == "neural" else view
    truth = replace(EXACT, view=view, quality=approximation.against)
    times, shares, squares, largest, masks = [], [], [], 0.0, []
    for round_ in range(repeats + 1):
        for camera in cameras:
            small = camera.resized(*(max(1, round(s * approximation.scale)) for s in size))
            a, picture, mask = _frame(exact, camera, truth, view)
            b, made, other_mask = _frame(other, small, approximation.settings, shown)
            if round_ == 0:  # warms both up, and the pictures are the same in every round
                gap = np.abs(_enlarged(made, size).astype(np.int16)[..., :3] - picture[..., :3])
                squares.append(float((gap.astype(np.float64) ** 2).mean()))
                largest = max(largest, float(gap.max()))
                masks.append(float((mask != other_mask).mean()) if mask.shape == other_mask.shape else float("nan"))
            else:
                times.append(b)
                shares.append(b / a)
            meter()
    error = float(np.mean(squares))
    return Cost(
        float(np.median(times)), float(np.median(shares)), float("inf") if error == 0 else float(10 * np.log10(255**2 / error)),
        largest, float(np.mean(masks)),
    )


def _frame(renderer: "Renderer", camera: Camera, settings: Settings, view: str) -> tuple[float, np.ndarray, np.ndarray]:
    frame: Frame = renderer.render(camera, settings, views=(view,))
    return frame.stats["total_ms"], frame.image(view).copy(), frame.mask()


def run_errors(scans: list[Path], size: tuple[int, int], repeats: int, plot: Path | None) -> dict:
    """The table over eight named views of a scan."""
    from model.reconstruct import fast_precision
    from model.weights import shipped
    from viewer.cloud import open_scene
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer

    scene = open_scene(scans)
    context = create_context()
    exact = Renderer(context, scene, device="cpu")
    qualities = [q for q in ("balanced", "fast", "best", "paper") if f"{q}-filtered" in shipped()]
    rows = approximations(qualities, [p for p in ("bf16", "fp16") if p == fast_precision("cpu") or p == "fp16"])
    cameras = eight_views(scene, size)
    found: list[dict] = []
    with progress(len(rows) * (repeats + 1) * len(cameras), "run time against error", "frame") as meter:
        for row in rows:
            other = exact if row.bits == 16 else Renderer(context, coarser(scene, row.bits), device="cpu")
            cost = measure(exact, other, row, cameras, repeats, lambda: meter.update(1))
            if other is not exact:
                other.release()
            found.append({"group": row.group, "name": row.name, "view": row.view, **vars(cost)})
    opengl = exact.device.renderer
    exact.release()
    context.release()
    if plot is not None:
        _plot(found, plot)
    return {"scans": [str(s) for s in scans], "points": scene.count, "size": list(size), "opengl": opengl, "repeats": repeats,
            "rows": found}


def _plot(rows: list[dict], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    from viewer.tools.files import write_whole

    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    top = max((row["psnr"] for row in rows if np.isfinite(row["psnr"])), default=60.0) + 5
    for group in dict.fromkeys(row["group"] for row in rows):
        mine = [row for row in rows if row["group"] == group]
        x, y = [row["time"] for row in mine], [min(row["psnr"], top) for row in mine]
        axes.plot(x, y, "o", label=group)
        for row, at in zip(mine, zip(x, y, strict=True), strict=True):
            axes.annotate(row["name"], at, fontsize=6, xytext=(3, 3), textcoords="offset points")
    axes.axvline(1.0, color="grey", linewidth=0.5)
    axes.set_xlabel("time, as a share of the exact frame's")
    axes.set_ylabel("PSNR against the exact frame, dB (top: equal)")
    axes.legend(fontsize="small")
    write_whole(path, lambda p: figure.savefig(p, format=path.suffix.lstrip(".") or "png", dpi=150))
    plt.close(figure)
