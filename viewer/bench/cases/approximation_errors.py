"""Run time against error: time and error of each approximation relative to the exact frame.

Approximations of geometry are compared by the filled picture and the keep-mask, as the raw picture depends too much on single
pixels; those of the network by the neural picture.  Exact and approximate frames are timed alternately, camera by camera, so
that other load on the machine affects both.  One row compares the exact frame with the float64 reference implementation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.scanner_positions import stations_differ
from ....model.network.qualities import DEFAULT, QUALITIES
from ...common.errors import InputError
from ...common.progress import progress
from ...picture.camera import Camera
from ...picture.settings import Settings
from ...work.places.viewpoints import named_views
from ..approximations import EXACT, Approximation, BenchRenderer, Whole, approximations, coarser
from ..bench_input import Subject
from ..plots import INK, MARKS, figure, label_points, save

if TYPE_CHECKING:
    from ....model.network.reconstruct import Reconstructor
    from ...render.frame import Frame

NOISE = 0.05
"""Relative difference of times below which they count as equal.  Chosen by hand."""
UNBEATEN = ("no other row, the exact frame included, is more accurate without being slower, or as accurate and faster, by more "
            f"than noise ({NOISE:.0%} of the time)")
"""Meaning of the mark in the table: the Pareto front."""


@dataclass(frozen=True)
class Cost:
    """Time and error of an approximation over all cameras.

    milliseconds: p50.  time: median share of the exact frame's time in the same round.  psnr: dB, against the exact picture,
    infinite if equal.  largest: difference of a channel, 0 to 255.  mask: share of the keep-mask that differs.  by_view:
    ``time`` by view.
    """

    milliseconds: float
    time: float
    psnr: float
    largest: float
    mask: float
    by_view: dict[str, float]


def _enlarged(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    from PIL import Image

    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    return np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BILINEAR))


def measure(exact: BenchRenderer, other: BenchRenderer, approximation: Approximation, cameras: list[Camera], repeats: int,
            meter: Callable[[], object], network: "Reconstructor | Whole | None" = None) -> Cost:
    """Time and error of one approximation.

    exact, other: renderers of the exact and of the approximate scene; may be the same.  meter: called after each pair of
    frames.  network: of the approximate frame; None: that of its settings.
    """
    view, size = approximation.view, (cameras[0].width, cameras[0].height)
    shown = "filled" if approximation.settings.view == "filled" and view == "neural" else view
    truth = replace(EXACT, view=view, quality=approximation.against)
    times, squares, largest, masks = [], [], 0.0, []
    shares: dict[str, list[float]] = {camera.name: [] for camera in cameras}
    for round_ in range(repeats + 1):
        for camera in cameras:
            small = camera.resized(*(max(1, round(s * approximation.scale)) for s in size))
            a, picture, mask = _frame(exact, camera, truth, view)
            other.soft, other.network = approximation.soft, network
            b, made, other_mask = _frame(other, small, approximation.settings, shown)
            other.soft = other.network = None
            if round_ == 0:  # warm-up; the pictures are the same in every round
                gap = np.abs(_enlarged(made, size).astype(np.int16)[..., :3] - picture[..., :3])
                squares.append(float((gap.astype(np.float64) ** 2).mean()))
                largest = max(largest, float(gap.max()))
                masks.append(float((mask != other_mask).mean()) if mask.shape == other_mask.shape else float("nan"))
            else:
                times.append(b)
                shares[camera.name].append(b / a)
            meter()
    share = float(np.median([each for found in shares.values() for each in found]))
    by_view = {name: float(np.median(found)) for name, found in shares.items()}
    return Cost(float(np.median(times)), share, *_error_summary(squares, largest, masks), by_view)


def _error_summary(squares: Sequence[float], largest: float, masks: Sequence[float]) -> tuple[float, float, float]:
    error = float(np.mean(squares))
    return float("inf") if error == 0 else float(10 * np.log10(255**2 / error)), largest, float(np.mean(masks))


def against_reference(exact: BenchRenderer, cameras: list[Camera], meter: Callable[[], object]) -> Cost:
    """Error of the exact frame against the float64 reference implementation; the time is that of the exact frame."""
    from ..float64_reference import reference_frame

    times, squares, largest, masks = [], [], 0.0, []
    for camera in cameras:
        _frame(exact, camera, EXACT, "filled")
        spent, picture, mask = _frame(exact, camera, EXACT, "filled")
        truth, true_mask = reference_frame(exact.scene, camera, EXACT, exact.metre)
        shown = picture[..., 3] > 0  # the background does not depend on the precision of depth
        gap = np.where(shown[..., None], np.abs(picture[..., :3].astype(np.int16) - truth), 0)
        squares.append(float((gap.astype(np.float64) ** 2).mean()))
        largest = max(largest, float(gap.max()))
        masks.append(float((mask != true_mask).mean()))
        times.append(spent)
        meter()
    return Cost(float(np.median(times)), 1.0, *_error_summary(squares, largest, masks), {})


def _frame(renderer: BenchRenderer, camera: Camera, settings: Settings, view: str) -> tuple[float, np.ndarray, np.ndarray]:
    frame: Frame = renderer.render(camera, settings, views=(view,))
    return frame.stats["total_ms"], frame.image(view).copy(), frame.mask()


def _check_group(only: str, table: list[Approximation]) -> None:
    groups = list(dict.fromkeys(row.group for row in table))
    if only not in groups:
        raise InputError(f"expected one of {', '.join(groups)}", option="--only", value=only)


def run_errors(subject: Subject, size: tuple[int, int], repeats: int, only: str | None = None) -> dict:
    """All approximations over the eight named views of a scan.  only: one group.  Raises InputError for an unknown group."""
    from ....model.network.reconstruct import fast_precision
    from ....model.network.weights_folder import shipped_qualities
    from ...render.device.context import create_context
    from ...render.network.neural import load_network

    if only is not None:  # before anything is loaded
        _check_group(only, approximations(list(QUALITIES), ["bf16"], True))
    scene = subject.scene()
    context = create_context()
    exact = BenchRenderer(context, scene, device="cpu")
    cameras = named_views(scene, size)
    qualities = sorted(shipped_qualities(), key=lambda quality: quality != DEFAULT)  # the default first
    precisions = [p for p in ("bf16", "fp16") if p == fast_precision("cpu") or p == "fp16"]
    table = approximations(qualities, precisions, stations_differ(scene.station_places))
    if only is not None:
        _check_group(only, table)
        table = [row for row in table if row.group == only]
    whole = Whole(load_network(qualities[0], True, None, "fp32", "cpu"))
    found: list[dict] = []
    with progress((1 + len(table) * (repeats + 1)) * len(cameras), "run time against error", "frame") as meter:
        cost = against_reference(exact, cameras, lambda: meter.update(1))
        found.append({"group": "exact", "name": "against the float64 reference", "view": "filled", **vars(cost)})
        for row in table:
            other = exact if row.bits == 16 else BenchRenderer(context, coarser(scene, row.bits), device="cpu")
            network = whole if row.whole else None
            cost = measure(exact, other, row, cameras, repeats, lambda: meter.update(1), network)
            if other is not exact:
                other.release()
            found.append({"group": row.group, "name": row.name, "view": row.view, **vars(cost)})
    facts = subject.facts(scene, exact.device)
    exact.release()
    context.release()
    return {
        **facts, "size": list(size), "cameras": [camera.name for camera in cameras], "repeats": repeats,
        "network": f"{qualities[0]} in fp32", "front": front(found), "rows": found,
    }


def front(found: list[dict]) -> dict[str, list[str]]:
    """Pareto front by view: names of the approximations that no row, the exact frame included, dominates; fastest first.

    A row dominates another if it is more accurate and not slower by more than NOISE, or as accurate and faster by more than
    NOISE.  An approximation without error must be faster than the exact frame by more than NOISE.
    """
    out = {}
    for view in dict.fromkeys(row["view"] for row in found):
        mine = [row for row in found if row["view"] == view and row["group"] != "exact"]
        others = [*mine, {"time": 1.0, "psnr": np.inf}]

        def dominated(row: dict, others: list[dict] = others) -> bool:
            return (row["psnr"] == np.inf and row["time"] > 1 - NOISE) or any(
                (other["psnr"] > row["psnr"] and other["time"] * (1 - NOISE) < row["time"])
                or (other["psnr"] >= row["psnr"] and other["time"] < row["time"] * (1 - NOISE)) for other in others)

        out[view] = [f"{row['group']}: {row['name']}" for row in sorted(mine, key=lambda row: row["time"])
                     if not dominated(row)]
    return out


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    best = {name for names in result["front"].values() for name in names}
    out = [
        (f"{row['group']}: {row['name']}",
         f"{row['milliseconds']:7.1f} ms  {row['time']:5.2f} of the exact frame's time   {row['psnr']:6.2f} dB   largest "
         f"{row['largest']:3.0f}" + (f"   mask {row['mask']:.4%}" if row["mask"] == row["mask"] else "")
         + ("   *" if f"{row['group']}: {row['name']}" in best else ""))
        for row in result["rows"]
    ]
    return [*out, ("*", UNBEATEN)]


def plot(result: dict, path: Path) -> None:
    """A panel for each view: time against error, with the Pareto front as a line."""
    views = list(dict.fromkeys(row["view"] for row in result["rows"]))
    made, panels = figure(6.2 * len(views), 5.6, columns=len(views))
    groups = list(dict.fromkeys(row["group"] for row in result["rows"]))
    for view, axes in zip(views, np.atleast_1d(panels), strict=True):
        mine = [row for row in result["rows"] if row["view"] == view]
        top = max((row["psnr"] for row in mine if np.isfinite(row["psnr"])), default=60.0) + 4
        at = {id(row): (row["time"], min(row["psnr"], top)) for row in mine}
        for group in dict.fromkeys(row["group"] for row in mine):
            number = groups.index(group)
            x, y = zip(*(at[id(row)] for row in mine if row["group"] == group), strict=True)
            axes.plot(x, y, MARKS[number % len(MARKS)], color=INK[number % len(INK)], label=group, markersize=5)
        best = set(result["front"][view])
        line = sorted(at[id(row)] for row in mine if f"{row['group']}: {row['name']}" in best)
        if line:
            axes.step(*zip(*line, strict=True), where="post", color="grey", linewidth=0.8, label="Pareto front")
        axes.axvline(1.0, color="grey", linewidth=0.5, linestyle=":")
        axes.set_xscale("log")
        x = [point[0] for point in at.values()]
        low, high = min([*x, 1.0]) / 1.25, max([*x, 1.0]) * 1.35
        axes.set_xlim(low, high)
        ticks = [t for t in (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0) if low <= t <= high]
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
        axes.set_title(f"{view} picture", fontsize=9)
        axes.set_xlabel("time, as a share of the exact frame's")
        axes.set_ylabel("PSNR against the exact frame, dB (top: equal)")
        axes.legend(fontsize="x-small")
        label_points(axes, [at[id(row)] for row in mine], [row["name"] for row in mine])
    save(made, path, result)
