"""How long opening takes: from files without a cache, and from the cache to the first picture."""

import os
import tempfile
import time
from pathlib import Path

from viewer.bench.frames import eight_views
from viewer.settings import Settings


def run_open(scans: list[Path], size: tuple[int, int], settings: Settings) -> dict:
    """Opens in a temporary cache folder: first from the files, then again from the cache, then one raw picture."""
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
            timed("from the files", lambda: open_scene(scans))
            scene = timed("from the cache", lambda: open_scene(scans))
            context = timed("OpenGL context", create_context)
            renderer = timed("points to the GPU", lambda: Renderer(context, scene))
            camera = eight_views(scene, size)[0]
            timed("first raw picture", lambda: renderer.render(camera, settings, views=("raw",)).image("raw"))
            timed("second raw picture", lambda: renderer.render(camera, settings, views=("raw",)).image("raw"))
            opengl = renderer.device.renderer
            renderer.release()
            context.release()
        finally:
            if before is None:
                del os.environ["POINTGLASS_CACHE"]
            else:
                os.environ["POINTGLASS_CACHE"] = before
    names = ("from the cache", "OpenGL context", "points to the GPU", "first raw picture")
    times["cache to first picture"] = sum(times[name] for name in names)
    return {
        "scans": [str(s) for s in scans], "points": scene.count, "size": list(size), "opengl": opengl, "milliseconds": times,
    }
