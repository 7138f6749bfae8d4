"""How long opening takes: from files without a cache, and from the cache to the first picture and to full quality."""

import os
import tempfile
import time
from pathlib import Path

from viewer.bench.plots import INK, figure, save
from viewer.bench.subject import Subject
from viewer.bench.views import named_views
from viewer.settings import Settings

FIRST, FULL = "cache to first picture", "cache to full quality"


def run_open(subject: Subject, size: tuple[int, int], settings: Settings) -> dict:
    """Opens in a temporary cache folder: first from the files, then again from the cache, then pictures: raw, the first to
    be seen, and neural, in full quality.  The files of the cache have just been written and may still be in memory."""
    from viewer.bench.procedural_scan import procedural_scene
    from viewer.cloud import open_scene
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer

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
            renderer = timed("points to the GPU", lambda: Renderer(context, scene))
            camera = named_views(scene, size)[0]
            timed("first raw picture", lambda: renderer.render(camera, settings, views=("raw",)).image("raw"))
            timed("second raw picture", lambda: renderer.render(camera, settings, views=("raw",)).image("raw"))
            timed("first neural picture", lambda: renderer.render(camera, settings, views=("neural",)).image("neural"))
            device = renderer.device
            facts = subject.facts(scene, device)
            renderer.release()
            context.release()
        finally:
            if before is None:
                del os.environ["POINTGLASS_CACHE"]
            else:
                os.environ["POINTGLASS_CACHE"] = before
    names = ("from the cache", "OpenGL context", "points to the GPU", "first raw picture")
    times[FIRST] = sum(times[name] for name in names)
    times[FULL] = times[FIRST] + times["first neural picture"]
    return {**facts, "size": list(size), "milliseconds": times}


def rows(result: dict) -> list[tuple[str, str]]:
    """For the table on the terminal."""
    return [(name, f"{value:.0f} ms") for name, value in result["milliseconds"].items()]


def plot(result: dict, path: Path) -> None:
    """One bar a step."""
    made, axes = figure(7.0, 3.2)
    axes.barh(list(result["milliseconds"]), list(result["milliseconds"].values()), color=INK[0])
    axes.set_xscale("log")
    axes.invert_yaxis()
    axes.set_xlabel("milliseconds")
    save(made, path, result)
