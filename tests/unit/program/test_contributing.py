"""CONTRIBUTING.md: the rooms are those of the code, the files it names exist, and its recipes work as they stand."""

import re
import subprocess
import sys
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_architecture import ORDER

import pointglass
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.readers import formats
from pointglass.viewer.window.interaction import table
from pointglass.viewer.window.interaction.tool import PointerEvent, ToolContext

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / ".github" / "CONTRIBUTING.md").read_text("utf-8")


def recipe(title: str) -> str:
    return TEXT.partition(f"\n### {title}\n")[2].partition("\n### ")[0]


def block(text: str, language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("top", ORDER)
def test_its_rooms_are_those_of_the_code_in_their_order(top):
    table = TEXT.partition(f"| `{top}/` | |\n|---|---|\n")[2].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)` \| .{10,} \|$", table, re.MULTILINE) == ORDER[top]


def test_the_files_that_it_names_exist():
    named = re.findall(r"`((?:viewer|model|tests|assets|shaders|\.ci)/[\w./-]*)`", TEXT)
    missing = [name for name in named if not (ROOT / name).exists() and "NAME" not in name]
    assert len(named) > 20 and missing == []
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    asked = set(re.findall(r"(?:^|`)make ([a-z-]+)", TEXT, re.MULTILINE))
    assert len(asked) >= 4 and asked <= targets


def module_of(title: str, name: str, monkeypatch) -> ModuleType:
    """The module that a recipe writes, under the dotted name that it would have below pointglass.viewer."""
    module = module_from_spec(ModuleSpec(f"pointglass.viewer.{name}", None))
    exec(compile(block(recipe(title), "python"), name, "exec"), module.__dict__)
    monkeypatch.setitem(sys.modules, f"pointglass.viewer.{name}", module)
    return module


def test_its_reader_reads(tmp_path, monkeypatch):
    module = module_of("A reader", "readers.pex", monkeypatch)
    row = re.search(r"^\+\s+(Format\(.*\)),$", block(recipe("A reader"), "diff"), re.MULTILINE)
    assert row is not None
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS, eval(row[1], dict(vars(formats)))))

    rng = np.random.default_rng(1)
    points: Any = np.zeros(2000, module._RECORD)
    points["xyz"], points["rgb"] = rng.uniform(0, 3, (2000, 3)), rng.integers(0, 256, (2000, 3))
    path = tmp_path / "a.pex"
    path.write_bytes(b"PEX1" + (2000).to_bytes(8, "little") + points.tobytes())
    with pointglass.open(path, cache=False, exposures="as-scanned") as scan:
        order = np.lexsort(scan.points.xyz.T)
        assert np.array_equal(scan.points.xyz[order], points["xyz"][(by := np.lexsort(points["xyz"].T))].astype(np.float64))
        assert np.array_equal(scan.points["rgb"][order], points["rgb"][by]) and scan.info["format"] == "PEX"

    whole = path.read_bytes()
    path.write_bytes(whole + b"x")
    assert len(module.PexSource(path).warnings) == 1
    path.write_bytes(b"PEX1" + bytes(8) + whole)
    with pytest.raises(pointglass.InputError, match="holds no points") as refused:
        pointglass.open(path, cache=False)
    assert refused.value.is_of(path)
    path.write_bytes(whole[:-1])
    with pytest.raises(pointglass.InputError, match="states 2,000 points, the file has 1,999"):
        pointglass.open(path, cache=False)


def test_its_tool_answers_a_click_and_leaves_the_rest_to_flying(monkeypatch):
    tool = module_of("A tool", "window.interaction.bearing", monkeypatch).Bearing
    before, after = (line.strip(" -+,").split(", ") for line in block(recipe("A tool"), "diff").splitlines())
    assert [made.__name__ for made in table.TOOLS] == before and [name for name in after if name != "Bearing"] == before
    monkeypatch.setattr(table, "TOOLS", (*table.TOOLS[:3], tool, *table.TOOLS[3:]))
    assert tool.name not in {made.name for made in table.TOOLS if made is not tool}

    said = []
    camera = from_fov(400, 300, 60.0, look_at((0, 0, 0), (1, 1, 0)))  # to the north-east, level
    context = SimpleNamespace(camera=camera, toast=said.append)
    context.ray = lambda position: ToolContext.ray(context, position)  # type: ignore[arg-type]
    box = table.toolbox()
    box.active = next(each for each in box.tools if each.name == "bearing")
    assert not box.active.pointer(PointerEvent("press", (200.0, 150.0), button="left"), context)  # type: ignore[arg-type]
    click = PointerEvent("release", (200.0, 150.0), button="left", clicks=1)
    assert box.active.pointer(click, context) and said == ["azimuth 45.0°, elevation 0.0°"]  # type: ignore[arg-type]


def test_its_quality_is_one_row():
    """In a process of its own: other tables are made of this one when they are imported."""
    row = re.search(r'^\+\s+"(\w+)": (Quality\(.*\)),$', block(recipe("A quality"), "diff"), re.MULTILINE)
    assert row is not None
    code = ("from pointglass.model.network import qualities as q\n"
            f"q.QUALITIES[{row[1]!r}] = eval({row[2]!r}, vars(q))\n"
            "from pointglass.viewer.picture.settings import Settings\n"
            "from pointglass.viewer.command_table import make_parser\n"
            "given = 'render a.laz --cameras c.json --out o --quality tiny'.split()\n"
            "print(Settings(quality='tiny').quality, make_parser('render').parse_args(given).quality, *q.trainable())")
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.stdout.split()[:2] == ["tiny", "tiny"] and "tiny" in done.stdout.split()[2:], done.stderr


@pytest.mark.gl
def test_its_effect_is_a_shader_that_compiles_and_does_what_it_says(context):
    text = block(recipe("An effect"), "glsl").replace("TILE_X", "8").replace("TILE_Y", "8")
    program = context.compute_shader(f"#version 430\n{text}")
    image = np.random.default_rng(1).integers(0, 256, (5, 9, 4), dtype=np.uint8)
    picture, result = context.texture((9, 5), 4, image.tobytes()), context.texture((9, 5), 4)
    picture.use(0)
    result.bind_to_image(0, read=False, write=True)
    program["picture"], program["share"] = 0, 128
    program.run(2, 1)
    context.memory_barrier()
    grey = (image[..., :3].astype(int) @ (54, 183, 19) // 256)[..., None] - image[..., :3]
    expected = image[..., :3] + np.trunc(grey * 128 / 256).astype(int)  # GLSL divides towards zero
    found = np.frombuffer(result.read(), np.uint8).reshape(5, 9, 4)
    assert np.array_equal(found[..., :3], expected) and np.array_equal(found[..., 3], image[..., 3])
    for owned in (program, picture, result):
        owned.release()
