"""Compiles numba's loops ahead of the first use: the last step of ``make``'s set-up.

``python -m pointglass.viewer.compile_kernels``.

numba keeps compiled loops on disk, beside the modules or in its cache folder.  Each is compiled for the types it is called
with, so this calls them as the commands do: it opens the demo scan and a text file in a temporary cache, draws a plan of it,
points at it, looks for passers-by, compares two clouds, makes splats, lays a photograph over a view, renders the scan in every
view and with a photograph, and opens it once more from the cache.
Without it the first scan that is opened waits for the compiler instead.
"""

import contextlib
import os
import shutil
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from ..model.common.process.signals import cleaned
from .common.errors import DeviceError, PointglassError


def compile_kernels() -> str | None:
    """Compiles every loop of the window and of ``render``.  Returns None, or why no picture could be rendered.

    POINTGLASS_CACHE is replaced during the call: no grid is kept.
    """
    before = os.environ.get("POINTGLASS_CACHE")
    folder = tempfile.mkdtemp(prefix="pointglass-compile-")
    with cleaned(lambda: shutil.rmtree(folder, ignore_errors=True)):
        os.environ["POINTGLASS_CACHE"] = str(Path(folder) / "cache")
        try:
            _open_scans(Path(folder))
            _draw_and_point()
            _find_ghosts_and_show_photograph()
            _compare()
            _make_splats()
            _render_demo()
        except DeviceError as error:
            return str(error)
        finally:
            if before is None:
                del os.environ["POINTGLASS_CACHE"]
            else:
                os.environ["POINTGLASS_CACHE"] = before
    return None


def _open_scans(folder: Path) -> None:
    import numpy as np

    from .commands.demo import demo_scan
    from .grid.open_scene import open_scene
    from .work.places.small_picture import score
    from .work.places.standing_place import sample_scene, surroundings
    from .work.places.start_view import view_sample

    text = folder / "points.xyz"
    rng = np.random.default_rng(0)
    np.savetxt(text, np.c_[rng.uniform(0, 4, (5000, 3)), rng.integers(0, 256, (5000, 3))], fmt="%.4f %.4f %.4f %d %d %d")
    open_scene(text, cache=False)
    demo = open_scene(demo_scan())
    seen = sample_scene(demo)
    surroundings(seen, np.zeros(3))
    score(view_sample(demo, seen, np.eye(3)), np.zeros(3), np.array([1.0, 0.0, 0.0]), 1.0)


def _draw_and_point() -> None:
    """A plan as ``section`` draws it, the point under the pointer as the window finds it, and a selection."""
    import numpy as np

    from .commands.demo import demo_scan
    from .commands.section.cut import plan
    from .commands.section.orthographic import draw
    from .grid.open_scene import open_scene
    from .grid.scene import unpack
    from .picture.camera import from_fov
    from .picture.clip import box_around, vector
    from .picture.edits import NO_EDITS
    from .work.fits.fit import fit_at
    from .work.places.pick import pick, surface_around
    from .work.selecting.connected_region import connected_region
    from .work.selecting.select_points import by_outline, combined, in_box
    from .work.selection import Selection

    scene = open_scene(demo_scan())
    middle = scene.bounds.mean(axis=0)
    draw(Selection(scene), plan(float(middle[2]), 0.1), 0.02)
    pose = np.eye(4)
    pose[:3, 3] = middle
    pick(scene, from_fov(64, 48, 60.0, pose), np.ones((48, 64), bool), np.ones((48, 64), np.float32), (32.0, 24.0))
    surface_around(scene, middle)
    camera = from_fov(64, 48, 60.0, pose)
    hits = by_outline(scene, camera, np.array([(10.0, 10.0), (50.0, 10.0), (30.0, 40.0)]))
    in_box(scene, box_around(*scene.bounds))
    combined(scene, NO_EDITS, hits, "new")
    connected_region(Selection(scene), middle, smooth=True)
    for kind in ("plane", "pipe"):
        with contextlib.suppress(PointglassError):  # whatever lies there: its loops have run
            fit_at(scene, vector(unpack(scene, slice(0, 1))[0][0]), kind)


def _find_ghosts_and_show_photograph() -> None:
    """Passers-by in a small scan of two stations, and a photograph over a view: as a person asks for them in the window."""
    import numpy as np

    from .grid.open_scene import scene_from_arrays
    from .picture.camera import from_fov
    from .preprocess.scan_description import ScanDescription, ScanSummary
    from .render.photographs.lone_photograph import photograph_alone
    from .render.photographs.photo_pool import PhotoPool, prepared_photo
    from .work.ghosts import find_ghosts

    rng = np.random.default_rng(0)
    stations = ScanDescription(scans=tuple(ScanSummary(name, 1000, position) for name, position in
                                           (("a", (1.0, 1.0, 1.0)), ("b", (3.0, 3.0, 1.0)))))
    find_ghosts(scene_from_arrays(rng.uniform(0, 4, (2000, 3)), np.zeros((2000, 3), np.uint8),
                                  scan=np.repeat([0, 1], 1000).astype(np.uint8), meta=stations, noise=False))
    lens, nearest = (8 / np.pi, 8 / np.pi, 8.0, 4.0), np.ones((4, 8), np.float32)
    photo = prepared_photo(np.zeros((8, 16, 3), np.uint8), None, 1, lens, True, np.eye(4), nearest, np.ones(3))
    pool = PhotoPool(1, len(photo.words))
    pool.put(0, photo)
    photograph_alone(np.ones((8, 16), np.float32), from_fov(16, 8, 60.0, np.eye(4)), pool, 0, hides=True)


def _compare() -> None:
    """Two small clouds by each method, as ``compare`` does."""
    import numpy as np

    from .work.comparing.compare import METHODS, compare
    from .work.comparing.facing import facing_of

    rng = np.random.default_rng(0)
    clouds = [np.c_[rng.uniform(0, 1, (4000, 2)), rng.normal(0, 0.001, 4000)] for _ in range(2)]
    facing = facing_of(clouds[0], np.zeros((0, 3)), np.zeros((0, 3)))
    for method in METHODS:
        compare(clouds[0], clouds[1], facing, method=method)


def _make_splats() -> None:
    """Splats of a few points, as ``export`` makes them."""
    import numpy as np

    from .work.splats.make_splats import splats_of_points

    rng = np.random.default_rng(0)
    wall = np.c_[rng.uniform(0, 1, (4000, 2)), rng.normal(0, 0.001, 4000)]
    splats_of_points(wall, np.full((4000, 4), 99, np.uint8), 1000, np.zeros((0, 3)))


def _render_demo() -> None:
    """From the cache: every view of the first camera, then with level of detail and occlusion culling as a window has them."""
    from .commands.demo import demo_scan
    from .common.paths import assets_dir
    from .grid.open_scene import open_scene
    from .picture.settings import Settings
    from .picture.views import VIEWS
    from .readers.photographs.posed_photograph import PosedPhotograph
    from .render.culling.occlusion import Occlusion
    from .render.device.context import create_context
    from .render.renderer import Renderer
    from .work.cameras.camera_files import read_cameras

    camera = read_cameras(assets_dir() / "demo_cameras.json", size=(320, 240))[0]
    context = create_context()
    try:
        renderer = Renderer(context, open_scene(demo_scan()))
        try:
            renderer.render(camera, Settings(), views=tuple(VIEWS))
            own = renderer.render(camera, Settings(view="filled"), views=("filled",)).image("filled")[..., :3].copy()
            lens = camera.fx, camera.fy, camera.cx, camera.cy
            renderer.photographs.give("own", [PosedPhotograph("own", "pinhole", camera.width, camera.height, lens, False,
                                                              camera.camera_to_world, lambda _: (own, None))])
            renderer.render(camera, Settings(view="filled", photos="own"))
            history = Occlusion()
            for _ in range(2):
                renderer.render(camera, Settings(view="filled", lod=1.0), history=history, streaming=True)
        finally:
            renderer.release()
    finally:
        context.release()


def main() -> int:
    """Compiles, says how long it took and, on a machine without OpenGL, what is left to compile.  Returns 0."""
    start = perf_counter()
    problem = compile_kernels()
    print(f"compiled loops are ready ({perf_counter() - start:.0f} s)"
          + (f", but those of rendering: {problem}" if problem else ""), file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
