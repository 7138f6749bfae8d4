"""Time to open a scan: from files without a cache, and from the cache to the first picture and to full quality."""

import os
import tempfile
import time
from pathlib import Path

from ...picture.settings import Settings
from ...work.places.viewpoints import named_views
from ..bench_input import Subject
from ..plots import INK, figure, save

FIRST, EVERY, FULL = "cache to first picture", "cache to every point in view", "cache to full quality"
"""Names of the totals."""


def run_open(subject: Subject, size: tuple[int, int], settings: Settings) -> dict:
    """Opens a scan in a temporary cache folder, first from the files, then from the cache, and renders three pictures.

    They are the first raw picture of the coarse layers, as in the window; raw with all points; and neural.  ``first_picture``:
    share of the visible points in the first picture.  The cache has just been written and may still be in memory.
    """
    from ...grid.open_scene import open_scene
    from ...render.device.context import create_context
    from ...render.renderer import Renderer
    from ..procedural_scan import procedural_scene

    times: dict[str, float] = {}

    def timed(name: str, work):
        start = time.perf_counter()
        made = work()
        times[name] = (time.perf_counter() - start) * 1e3
        return made

    before = os.environ.get("POINTGLASS_CACHE")
    with tempfile.TemporaryDirectory(prefix="pointglass-bench-") as folder:
        os.environ["POINTGLASS_CACHE"] = folder
        try:
            if subject.procedural is not None:
                scan, made = subject.procedural, Path(folder) / "procedural"
                timed("made and built", lambda: procedural_scene(scan, made))
                scene = timed("from the cache", lambda: open_scene(made))
            else:
                timed("from the files", lambda: open_scene(list(subject.scans)))
                scene = timed("from the cache", lambda: open_scene(list(subject.scans)))
            context = timed("OpenGL context", create_context)
            camera = named_views(scene, size)[0]
            renderer = timed("coarse layers to the GPU", lambda: Renderer(context, scene))

            def shown(*, streaming: bool = False, view: str = "raw") -> dict:
                frame = renderer.render(camera, settings, views=(view,), streaming=streaming)
                frame.image(view)
                return frame.stats

            first = timed("first raw picture", lambda: shown(streaming=True))
            every = timed("raw picture of every point", shown)
            timed("the same again", shown)
            timed("first neural picture", lambda: shown(view="neural"))
            timed("all other points", renderer.pages.load_all)
            device = renderer.device
            facts = subject.facts(scene, device)
            renderer.release()
            context.release()
        finally:
            if before is None:
                del os.environ["POINTGLASS_CACHE"]
            else:
                os.environ["POINTGLASS_CACHE"] = before
    names = ("from the cache", "OpenGL context", "coarse layers to the GPU", "first raw picture")
    times[FIRST] = sum(times[name] for name in names)
    times[EVERY] = times[FIRST] + times["raw picture of every point"]
    times[FULL] = times[EVERY] + times["first neural picture"]
    share = first["points_drawn"] / max(every["points_drawn"], 1)
    return {**facts, "size": list(size), "milliseconds": times, "first_picture": share}


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    return [*((name, f"{value:.0f} ms") for name, value in result["milliseconds"].items()),
            ("points in the first picture", f"{result['first_picture']:.0%} of those in view")]


def plot(result: dict, path: Path) -> None:
    """A bar for each step."""
    made, axes = figure(7.0, 3.2)
    axes.barh(list(result["milliseconds"]), list(result["milliseconds"].values()), color=INK[0])
    axes.set_xscale("log")
    axes.invert_yaxis()
    axes.set_xlabel("milliseconds")
    save(made, path, result)
