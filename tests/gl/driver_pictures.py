"""Pictures by every program there is, for tests of other drivers; as a script, one driver's pictures for comparison.

``python tests/gl/driver_pictures.py FILE [--gpu]`` renders on whatever driver the environment selects (see
test_other_drivers.py), with --gpu by the programs chosen for a GPU, and writes FILE (.npz): the renderer's name, and of each
scene and rasteriser whether 64-bit atomics were used, the keep-mask, the depth and the three pictures.
"""

import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
import pytest
from clouds import camera_in, room, scanned

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import box_around
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.settings import FILTERS, Settings
from pointglass.viewer.render.culling.occlusion import LAG, Occlusion
from pointglass.viewer.render.device import shader
from pointglass.viewer.render.passes.develop import Developer, read_picture
from pointglass.viewer.render.renderer import RASTERISERS, Renderer

SEED = 7
SIZE, POINTS = (64, 48), 6_000
"""Of the pictures that other drivers make: softpipe interprets every instruction."""
FEW = (10_000, ((160, 120), (33, 21), (7, 3)))
"""Points and sizes for ``pictures`` where every program has to run, no more: the first is for the directions of holes."""
VIEWS = ("raw", "filtered", "filled")


def edited_pictures(renderer, camera) -> list[bytes]:
    """Clipped, coloured by an attribute, and developed in every way."""
    low, high = renderer.scene.bounds
    edits = Edits(clips=(box_around(low, (low + 3 * high) / 4),), look=Look(colour_by="height"))
    frame = renderer.render(camera, Settings(), ("raw", "filtered", "filled"), edits=edits)
    frame.textures["neural"] = frame.textures["filled"]
    look = Look(exposure=0.5, point_size=2, edl=0.7)
    developer = Developer(renderer._programs, (camera.width, camera.height))
    made = [read_picture(developer.run(frame, view, look, tint=tint, lock=view == "neural")).tobytes()
            for view in ("raw", "neural") for tint in (False, True)]
    developer.release()
    return made


def pictures(context, points: int = 60_000, sizes=((160, 120), (97, 61), (7, 3))) -> list[bytes]:
    """By each pass there is: both rasterisers, with and without stations, every filter, fill, network, hidden cells.

    points: of each scene, enough for hidden cells (viewer.render.culling.occlusion.WORTH) in the second of the sizes."""
    out = []
    for make, kind in product((room, scanned), RASTERISERS):
        scene = make(SEED, points=points, noise=True)
        camera, small, least = (camera_in(scene, SEED, size) for size in sizes)
        renderer = Renderer(context, scene, raster=kind, device="cpu")
        for preset in FILTERS:
            views = (*VIEWS, "neural") if preset == "auto" else VIEWS
            frame = renderer.render(camera, Settings(filter=preset, quality="fast"), views)
            out += [frame.image(view).tobytes() for view in views]
            out += [frame.depth().tobytes(), frame.mask().tobytes()]
        parallel = renderer.render(replace(camera, orthographic=2.0), Settings(), VIEWS)
        out += [parallel.image(view).tobytes() for view in VIEWS]
        history = Occlusion()
        for _ in range(2):
            frame = renderer.render(small, Settings(), ("filled",), history)
            assert (frame.facts.occlusion is not None) == (kind == "compute")
            out.append(frame.image("filled").tobytes())
        away = from_fov(*sizes[1], 60.0, look_at(scene.bounds[1] + 9.0, scene.bounds.mean(axis=0)))
        frame = renderer.render(small, Settings(), ("filled",), filled_depth=True)
        out += [frame.image("filled").tobytes(), frame.filled_depth.read()]
        out += [renderer.render(other, Settings(), VIEWS).image("filled").tobytes() for other in (least, away)]
        out += edited_pictures(renderer, small)
        renderer.release()
    return out


def sources(context, monkeypatch) -> dict[str, str]:
    """{complete text of a shader, includes and constants resolved: its file} of all that the program compiles, for software
    OpenGL and for a GPU."""
    from pointglass.viewer.doctor_probes import compute_works
    from pointglass.viewer.render.meshes.mesh_pass import MeshPass
    from pointglass.viewer.render.network.bridge import ReadBackBridge, works
    from pointglass.viewer.render.network.neural_picture import unpacking
    from pointglass.viewer.render.passes.reprojection import Reprojection
    from pointglass.viewer.render.photographs.kept_photographs import OverNetwork
    from pointglass.viewer.render.photographs.photo_shader import PhotoShader
    from pointglass.viewer.window.viewport.present import Canvas

    texts: dict[str, str] = {}
    source = shader.source

    def noted(name, defines=None):
        text, files = source(name, defines)
        texts[text] = name
        return text, files

    monkeypatch.setattr(shader, "source", noted)
    pictures(context, *FEW)
    look_like_a_gpu(monkeypatch)
    pictures(context, *FEW)
    programs, bridge = shader.Programs(context), ReadBackBridge(context, (8, 8))
    assert works(programs, bridge) and compute_works(context)
    canvas, moved = Canvas(context, programs, (8, 8)), Reprojection(programs, (8, 8))
    unpacking(programs, copied=True, bounded=False)
    for copied in (True, False):
        unpacking(programs, copied=copied, photographs=True)
        OverNetwork(programs, (1, 1), copied=copied).release()
    photographs = PhotoShader(programs, (8, 8))
    meshes = MeshPass(programs, (8, 8), lambda path: None)
    for owned in (canvas, bridge, moved, photographs, meshes, programs):
        owned.release()
    # 64-bit atomics, which no software OpenGL but zink's has: the text is complete without a driver
    from pointglass.model.reference.soft_z import MAX_AVERAGED
    from pointglass.model.reference.station_constants import HEAVIEST, UNPLACED

    weights = {"WEIGHTED": 1, "HEAVIEST": HEAVIEST, "UNPLACED": UNPLACED, "WIDE_SUMS": 1}
    noted("raster_colour.comp", {"LANES": 128, "ROWS": 8, "APPENDED": 1, **weights})
    noted("raster_points_colour.frag", weights)
    for carried in (None, 1):
        noted("resolve.comp", {"FROM_KEYS": 1, "MAX_AVERAGED": MAX_AVERAGED, "CARRIED": carried, "WIDE_SUMS": 1})
    return texts


def look_like_a_gpu(monkeypatch) -> None:
    """Renderers made from now on choose what they would on a GPU, but for the age of the visibility that frames with a history
    use, which sways pictures a little."""
    from dataclasses import replace

    from pointglass.viewer.render import renderer

    known = renderer.describe_device
    monkeypatch.setattr(renderer, "describe_device", lambda context: replace(known(context), software=False))
    monkeypatch.setitem(LAG, False, LAG[True])


def named_pictures(context) -> dict[str, np.ndarray]:
    """What the file that the module's docstring describes holds, by name."""
    from pointglass.viewer.render.device.context import describe_device

    device = describe_device(context)
    made: dict[str, np.ndarray] = {"renderer": np.array(f"{device.renderer}, OpenGL {device.version}")}
    for make, kind in product((room, scanned), RASTERISERS):
        scene = make(SEED, points=POINTS)
        renderer = Renderer(context, scene, raster=kind, device="cpu")
        for preset in FILTERS if make is room else ("auto",):
            frame = renderer.render(camera_in(scene, SEED, SIZE), Settings(filter=preset), VIEWS)
            name = f"{make.__name__}, {kind}, filter {preset}"
            made |= {f"{name}, mask": frame.mask(), f"{name}, depth": frame.depth()}
            made |= {f"{name}, {view}": frame.image(view) for view in VIEWS}
        if kind != "cpu":  # whose sums are not OpenGL's
            made |= {f"{make.__name__}, {kind}, wide sums": np.array(renderer._passes.rasterisers[kind].wide_sums)}
        renderer.release()
    return made


if __name__ == "__main__":
    from pointglass.viewer.render.device.context import create_context

    if "--gpu" in sys.argv:
        look_like_a_gpu(pytest.MonkeyPatch())
    np.savez(sys.argv[1], **named_pictures(create_context()))
