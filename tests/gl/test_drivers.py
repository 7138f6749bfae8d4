"""What another driver may do otherwise than software OpenGL does, as far as that can be told without one.

A GPU runs other programs (more lanes, a pass that clears), finds anything in memory that nobody wrote where software
OpenGL finds zeros, and compiles more strictly.
"""

import shutil
import subprocess
from dataclasses import replace
from itertools import product

import moderngl
import numpy as np
import pytest
from clouds import camera_in, room
from test_stations import scanned

from viewer.camera import from_fov, look_at
from viewer.doctor_probes import compute_works
from viewer.paths import shaders_dir
from viewer.render import renderer as module
from viewer.render import shader
from viewer.render.bridge import ReadBackBridge, works
from viewer.render.develop import Developer, read_picture
from viewer.render.edits import Edits
from viewer.render.occlusion import Occlusion
from viewer.render.renderer import RASTERISERS, Renderer
from viewer.render.shader import Programs
from viewer.settings import FILTERS, Settings
from viewer.tools.clip import box_around
from viewer.tools.look import Look
from viewer.window.present import Canvas

pytestmark = pytest.mark.gl

SEED = 7
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


def pictures(context) -> list[bytes]:
    """By each pass there is: both rasterisers, with and without stations, every filter, fill, network, hidden cells."""
    out = []
    for make, kind in product((room, scanned), RASTERISERS):
        scene = make(SEED)
        camera, small, least = (camera_in(scene, SEED, size) for size in ((320, 240), (97, 61), (7, 3)))
        renderer = Renderer(context, scene, raster=kind, device="cpu")
        for preset in FILTERS:
            views = (*VIEWS, "neural") if preset == "auto" else VIEWS
            frame = renderer.render(camera, Settings(filter=preset, quality="fast"), views)
            out += [frame.image(view).tobytes() for view in views]
            out += [frame.depth().tobytes(), frame.mask().tobytes()]
        history = Occlusion()
        for _ in range(2):
            frame = renderer.render(small, Settings(), ("filled",), history)
            assert ("occlusion" in frame.facts) == (kind == "compute")
            out.append(frame.image("filled").tobytes())
        away = from_fov(97, 61, 60.0, look_at(scene.bounds[1] + 9.0, scene.bounds.mean(axis=0)))
        out += [renderer.render(other, Settings(), VIEWS).image("filled").tobytes() for other in (least, away)]
        out += edited_pictures(renderer, small)
        renderer.release()
    return out


@pytest.fixture
def expected(context):
    return pictures(context)


def look_like_a_gpu(monkeypatch) -> None:
    known = module.describe_device
    monkeypatch.setattr(module, "describe_device", lambda context: replace(known(context), software=False))


def demand_barriers(monkeypatch) -> list:
    """A GPU begins a pass before the last one has ended, and reads caches that it has not written back, unless a barrier stands
    between them.  Only runs of one program may follow each other without.  Returns the programs that ran, in order."""
    ran, since = [], []

    def following(owner: type, name: str) -> None:
        given = getattr(owner, name)

        def called(self, *arguments, **named):
            program = getattr(self, "program", self)
            assert all(other is program for other in since), f"no barrier before {owner.__name__}.{name}"
            if "read" not in name:
                since.append(program)
                ran.append(program)
            return given(self, *arguments, **named)

        monkeypatch.setattr(owner, name, called)

    def barrier(self, *arguments, given=moderngl.Context.memory_barrier):
        since.clear()
        given(self, *arguments)

    for owner, names in {moderngl.ComputeShader: ("run", "run_indirect"), moderngl.VertexArray: ("render", "render_indirect"),
                         moderngl.Buffer: ("read", "read_into"), moderngl.Texture: ("read",)}.items():
        for name in names:
            following(owner, name)
    monkeypatch.setattr(moderngl.Context, "memory_barrier", barrier)
    return ran


def test_a_gpus_programs_change_no_byte_and_wait_for_each_other(context, expected, monkeypatch):
    look_like_a_gpu(monkeypatch)
    ran = demand_barriers(monkeypatch)
    assert pictures(context) == expected and len(set(ran)) > 30


@pytest.mark.parametrize("word", [0xFFFFFFFF, 0x7F800000, 0x01020304])
def test_what_nobody_wrote_changes_no_byte(context, expected, monkeypatch, word):
    """Buffers and textures begin full of NaN, of infinity, or of small numbers."""
    look_like_a_gpu(monkeypatch)
    given = {name: getattr(moderngl.Context, name) for name in ("buffer", "texture")}
    written = []

    def fill(made, size: int) -> None:
        made.write(np.full(size // 4 + 1, word, "<u4").tobytes()[:size])
        written.append(size)

    def buffer(self, data=None, **named):
        made = given["buffer"](self, data, **named)
        if data is None:
            fill(made, made.size)
        return made

    def texture(self, size, components, data=None, **named):
        made = given["texture"](self, size, components, data, **named)
        if data is None:
            fill(made, size[0] * size[1] * components * int(named.get("dtype", "f1")[1]))
        return made

    def orphan(self, size=-1, given=moderngl.Buffer.orphan):
        given(self, size)
        fill(self, self.size)

    monkeypatch.setattr(moderngl.Context, "buffer", buffer)
    monkeypatch.setattr(moderngl.Context, "texture", texture)
    monkeypatch.setattr(moderngl.Buffer, "orphan", orphan)
    assert pictures(context) == expected and len(written) > 100


def test_every_program_is_right_to_the_reference_compiler(context, monkeypatch, tmp_path):
    """Mesa's takes more than the language allows."""
    compiler = shutil.which("glslangValidator")
    if compiler is None:
        pytest.skip("glslangValidator is not installed (apt install glslang-tools)")
    texts: dict[str, str] = {}
    source = shader.source

    def noted(name, defines=None):
        text, files = source(name, defines)
        texts[text] = name
        return text, files

    monkeypatch.setattr(shader, "source", noted)
    pictures(context)
    look_like_a_gpu(monkeypatch)
    pictures(context)
    programs, bridge = Programs(context), ReadBackBridge(context, (8, 8))
    assert works(programs, bridge) and compute_works(context)
    canvas = Canvas(context, programs, (8, 8))
    for owned in (canvas, bridge, programs):
        owned.release()
    there = {path.name for path in shaders_dir().iterdir() if path.suffix in (".comp", ".vert", ".frag")}
    assert set(texts.values()) == there, "a shader that no test compiles"
    paths = []
    for number, (text, name) in enumerate(texts.items()):
        paths.append(tmp_path / f"{number}-{name}")
        paths[-1].write_text(text)
    done = subprocess.run([compiler, *map(str, paths)], capture_output=True, text=True, timeout=120)
    said = [line for line in done.stdout.splitlines() if "ERROR" in line or "WARNING" in line]
    assert done.returncode == 0 and not said, done.stdout
