"""Pictures per second of a moving camera in a real window, and the error of the pictures shown.

The camera moves along the fixed path (viewer.work.places.viewpoints.camera_path), with the adaptive level of detail, panels and
status bar of normal use.  A frame lasts one iteration of the window's loop.  At some frames the displayed picture is kept, and
compared afterwards with the full-quality picture of the same camera.
Frame: file coordinates.  Times: milliseconds.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...common.progress import progress
from ...picture.settings import Settings
from ...work.places.viewpoints import camera_path
from ..bench_input import Subject
from ..plots import INK, figure, save
from .frame_times import summary

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...window.shell.app import App

VIEWS = ("raw", "filled", "neural")
"""Views that are measured."""
FRAMES = 240
"""Cameras along the path: 16 seconds of flight at 15 pictures per second."""
_SAMPLES = 12
"""Number of frames whose error is measured: one in twenty of the path."""
_FRAMES_BEFORE = FRAMES // 10
"""Frames before the measurement, spread over the path, in which shaders are compiled, buffers allocated and run times
estimated."""
_ITERATIONS = 4000
"""Iterations of the window's loop within which a picture at rest must become final: over a minute, at 60 a second."""


def run_flight(subject: Subject, size: tuple[int, int], settings: Settings, frames: int = FRAMES) -> dict:
    """Measures the path in each of VIEWS.

    size: of the picture without the panels, pixels.  Raises DeviceError without a display, InputError if the window cannot show
    a picture of this size.
    """
    from ...window.flight.start_viewpoint import survey
    from ...window.session.loading import Loaded
    from ...window.shell.app import App

    scene = subject.scene()
    app = App(settings, size=size, scale=1.0)
    try:
        app.viewport.upload(Loaded(scene, survey(scene)))
        assert app.viewport.renderer is not None
        _give_picture(app, size)
        cameras = camera_path(scene, size, frames)
        facts = subject.facts(scene, app.viewport.renderer.device)
        with progress(len(VIEWS) * frames, "flying", "frame") as meter:
            views = {view: _fly(app, view, cameras, lambda: meter.update(1)) for view in VIEWS}
        target = app.session.picture.adaptive_lod.target_ms
        network = app.session.picture.cost and app.session.picture.cost.facts.network
    finally:
        app.close()
    return {**facts, "size": list(size), "frames": frames, "target_ms": target, "quality": settings.quality, "network": network,
            "views": views}


def _give_picture(app: "App", size: tuple[int, int]) -> None:
    """Resizes the window so that its picture, without the panels, has ``size``.  Raises InputError if it cannot."""
    area = app.session.area
    for _ in range(6):
        app.step(wait=False)
        if area.size == size:
            return
        width, height = (max(1, w + want - have) for w, want, have in zip(area.window_size, size, area.size, strict=True))
        app.glfw.set_window_size(app.window, width, height)
        end = perf_counter() + 1.0
        while area.window_size != (width, height) and perf_counter() < end:
            app.step(wait=False)
    raise InputError(f"--size {size[0]}x{size[1]}: the window shows {area.size[0]}x{area.size[1]} instead")


def _rest(app: "App") -> None:
    """Waits until the displayed picture is final."""
    for _ in range(_ITERATIONS):
        app.step()
        if app.session.view_settings.network_load is None and not app.session.screen.refining:
            return
    raise AssertionError("the picture at rest does not become final")


def _go(app: "App", camera: "Camera", *, moving: bool) -> None:
    from ...window.flight.navigation import view_along

    flight = app.session.flight
    state = view_along(camera.position, camera.forward, flight.state.speed, flight.state.upright)
    if moving:
        flight.carry(state)
        app.session.picture.dirty = True
    else:
        flight.go(state)
        app.session.picture.renew()


def _fly(app: "App", view: str, cameras: Sequence["Camera"], done) -> dict:
    """Measures one view.  Returns times, facts of each frame, and errors.  done: called after each frame."""
    session = app.session
    session.view_settings.show(view)
    _go(app, cameras[0], moving=False)
    _rest(app)
    for number in np.linspace(0, len(cameras) - 1, _FRAMES_BEFORE).round().astype(int):
        _go(app, cameras[number], moving=True)
        app.step(wait=False)
    sampled = set(np.linspace(0, len(cameras) - 1, _SAMPLES).round().astype(int).tolist())
    times: list[float] = []
    drawn: list[dict] = []
    kept: dict[int, np.ndarray] = {}
    for number, camera in enumerate(cameras):
        begun = perf_counter()
        _go(app, camera, moving=True)
        app.step(wait=False)
        times.append((perf_counter() - begun) * 1e3)
        drawn.append(_frame_facts(app))
        if number in sampled:
            kept[number] = _on_screen(app)
        done()
    errors = []
    for number, shown in kept.items():
        _go(app, cameras[number], moving=False)
        full = app.viewport.full_picture()
        assert full is not None
        errors.append({"frame": number, **_error(shown, full)})
    return {"fps": 1e3 * len(times) / sum(times), **summary(times), "ms": times, "drawn": drawn, "errors": errors,
            "psnr": float(np.median([error["psnr"] for error in errors])),
            "ssim": float(np.median([error["ssim"] for error in errors]))}


def _frame_facts(app: "App") -> dict:
    """Facts of the displayed picture: internal resolution, points per pixel (None: all), view, network, share of its pixels
    moved from an earlier neural picture (None: none was made for it), and the renderer's time."""
    made, cost = app.session.picture.made, app.session.picture.cost
    assert made is not None
    view = made.views[-1]
    return {"resolution": made.scale, "points_per_pixel": made.level, "points": cost and cost.points_drawn, "view": view,
            "network": cost.facts.network if cost and view == "neural" else None, "moved": app.session.picture.moved,
            "render_ms": cost and cost.total_ms}


def _on_screen(app: "App") -> np.ndarray:
    """(H, W, 3) uint8: the displayed picture at the window's resolution, without the interface."""
    left, top = app.session.area.origin
    width, height = app.session.area.size
    return app.viewport.show().read()[top : top + height, left : left + width]


def _error(shown: np.ndarray, full: np.ndarray) -> dict[str, float]:
    """PSNR (dB) and SSIM of the displayed picture against the full-quality picture; both (H, W, 3) uint8."""
    import torch

    from ....model.evaluation.metrics.image_metrics import psnr, ssim

    a, b = (torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1).double() / 255 for image in (shown, full))
    return {"psnr": psnr(a, b), "ssim": ssim(a, b)}


def _shares(values: Sequence) -> str:
    """Shares of the values, such as ``1.00 62 %, 0.75 38 %``, the most frequent first."""
    return ", ".join(f"{value} {100 * count / len(values):.0f} %" for value, count in Counter(values).most_common())


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    out = [("target", f"{1e3 / result['target_ms']:.0f} pictures/s; {result['frames']} frames along the path")]
    for view, run in result["views"].items():
        drawn = run["drawn"]
        out += [
            (f"{view}: pictures per second", f"{run['fps']:5.1f}   frame p50 {run['p50']:6.1f}   p95 {run['p95']:6.1f} ms"),
            (f"{view}: error of what is shown", f"PSNR {run['psnr']:.1f} dB   SSIM {run['ssim']:.3f}"),
            (f"{view}: internal resolution", _shares([f"{100 * frame['resolution']:.0f}%" for frame in drawn])),
            (f"{view}: points per pixel",
             _shares(["all" if (level := frame["points_per_pixel"]) is None else f"{level:g}" for frame in drawn])),
            (f"{view}: drawn", _shares([frame["network"] or frame["view"] for frame in drawn])),
        ]
        if moved := [frame["moved"] for frame in drawn if frame["moved"] is not None]:
            share, frames = np.median(moved), len(moved) / len(drawn)
            out.append((f"{view}: moved from an earlier picture", f"{share:.0%} of the pixels, in {frames:.0%} of the frames"))
    return out


def plot(result: dict, path: Path) -> None:
    """Frame times along the path, and the errors below."""
    made, (upper, lower) = figure(8, 6, rows=2)
    for colour, (view, run) in zip(INK, result["views"].items(), strict=False):
        upper.plot(run["ms"], color=colour, label=view, linewidth=0.9)
        lower.plot([error["frame"] for error in run["errors"]], [error["psnr"] for error in run["errors"]], "o-", color=colour,
                   label=view, markersize=3)
    upper.axhline(result["target_ms"], color="grey", linewidth=0.7, linestyle="--")
    upper.set_ylabel("frame, ms")
    upper.set_ylim(bottom=0)
    upper.legend(fontsize="small")
    lower.set_ylabel("PSNR to full quality, dB")
    lower.set_xlabel("frame of the path")
    save(made, path, result)
