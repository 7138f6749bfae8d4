"""What must agree stands in one table each: in a copy of the product, a quality, a colour mode, a tool, a reader and an effect
are added by one row (the tool and the reader by a file, too), and used."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import laspy
import numpy as np
import pytest
from untyped import any_typed

pytestmark = pytest.mark.gl
ROOT = Path(__file__).resolve().parents[3]
ROWS = {
    "model/network/qualities.py": ('    "fast": Quality(', '    "tiny": Quality("tried by a test", 0.5, Size((8, 16), 1)),\n'
                                   '    "tinier": Quality("mirrored", 2.0, mirrors="tiny", smaller="tiny"),\n'),
    "viewer/picture/colour_modes.py": (
        '    "height": ColourMode(', '    "easting": ColourMode("along x", PointValue.ALONG, axis=(1.0, 0.0, 0.0)),\n'),
    "viewer/picture/look.py": (
        "    tint: float = tone(",
        "    contrast: float = tone(1.0, curve=lambda levels, value: 0.5 + (levels - 0.5) * 2.0**value)\n"),
    "viewer/readers/formats.py": ('    Format(("PCD",)', '    Format(("PEX",), ("pex", "Pex"), (".pex",), (b"PEX1",)),\n'),
    "viewer/window/interaction/table.py": ("    Fly, InspectPoint", "    Fly, Bearing, InspectPoint"),
}
"""File -> the line before which a row is put, and the row.  A row without an end of line takes its place."""
FILES = {
    "viewer/readers/pex.py": '''
import numpy as np
from .source import Chunk, ScanInfo, Source


class Pex(Source):
    def __init__(self, path):
        super().__init__(path, "PEX", precision=2.0**-24, scans=[ScanInfo(path.stem)])
        self.count = (path.stat().st_size - 4) // 15

    def chunks(self):
        rows = np.fromfile(self.path, np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)]), offset=4)
        yield Chunk(rows["xyz"].astype(np.float64), np.ascontiguousarray(rows["rgb"]))
''',
    "viewer/window/interaction/bearing.py": '''
from .tool import Tool


class Bearing(Tool):
    name, label, icon, key = "bearing", "Bearing", "B", "KP_5"
    help = "tried by a test"
''',
}


@pytest.fixture(scope="module")
def house(tmp_path_factory) -> Path:
    """A copy of the product with the rows.  Times and caches of files are kept, so that loops need not be compiled again."""
    house = tmp_path_factory.mktemp("house")
    for folder in ("viewer", "model", "shaders"):
        shutil.copytree(ROOT / folder, house / folder)
    shutil.copy(ROOT / "pointglass.py", house)
    (house / "assets" / "weights").mkdir(parents=True)
    for file in (ROOT / "assets" / "demo_cameras.json", *(ROOT / "assets" / "weights").glob("*.safetensors")):
        (house / file.relative_to(ROOT)).symlink_to(file)
    demo = laspy.read(ROOT / "assets" / "demo.laz")
    # Dense enough for small pictures: the grid of all takes some seconds.
    any_typed(demo).points = demo.points[np.arange(0, len(demo.points), 6)]
    demo.write(house / "assets" / "demo.laz")
    for name, (line, row) in ROWS.items():
        text = (house / name).read_text("utf-8")
        assert text.count(line) == 1, (name, line)
        (house / name).write_text(text.replace(line, row if "\n" not in row else row + line), "utf-8")
    table = house / "viewer/window/interaction/table.py"
    table.write_text("from .bearing import Bearing\n" + table.read_text("utf-8"), "utf-8")
    for name, text in FILES.items():
        (house / name).write_text(text, "utf-8")
    return house


def run(house: Path, *args: str) -> str:
    """Runs the copy's Python.  Returns what it printed."""
    environment = {**os.environ, "PYTHONPATH": str(house)}
    done = subprocess.run([sys.executable, *args], cwd=house, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_reader_opens_a_file_of_its_suffix(house, tmp_path):
    rows = np.zeros(2000, np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)]))
    rows["xyz"], rows["rgb"] = np.random.default_rng(1).uniform(0, 3, (2000, 3)), 90
    (tmp_path / "a.pex").write_bytes(b"PEX1" + rows.tobytes())
    told = run(house, "-m", "pointglass.viewer", "info", str(tmp_path / "a.pex"))
    assert "PEX" in told and "2,000" in told
    assert "PEX" in run(house, "-m", "pointglass.viewer", "info", "--help")


QUALITY = """
import sys
from pathlib import Path
from pointglass.model.network.unet import make_network
from pointglass.model.network.weights import save_weights
from pointglass.model.network.weights_folder import weights_file
file = weights_file("tiny", filtered=True)
save_weights(file, make_network("tiny"), "tiny", filtered=True)
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.planning.networks import missing_qualities, smaller_networks
print(smaller_networks(Settings(quality="tinier")), sorted(missing_qualities(Settings())))
from pointglass.viewer.window.planning.adaptive_lod import AdaptiveLod
learned = AdaptiveLod()
learned.ran_network("tinier", 40.0)
print(learned.network(("tinier", "tiny"), moving=True))
from pointglass.viewer.command_table import make_parser
print(make_parser("train").parse_args(["train", "room", "--quality", "tiny"]).quality)
from pointglass.viewer.cli import main
for quality in ("tiny", "tinier"):
    assert main(["render", "assets/demo.laz", "--cameras", "assets/demo_cameras.json", "--shard", "0/100", "--size", "64x48",
                 "--out", sys.argv[1] + quality, "--aux", "--device", "cpu", "--quality", quality]) == 0
"""


@pytest.mark.slow
def test_a_quality_draws_and_stands_in_for_others(house, tmp_path):
    told = run(house, "-c", QUALITY, f"{tmp_path}/").splitlines()
    assert told[:3] == ["('tiny',) ['paper']", "tiny", "tiny"]
    for quality, network in (("tiny", "tiny-filtered"), ("tinier", "mirrored")):
        (stats,) = (tmp_path / quality).glob("*.stats.json")
        assert network in stats.read_text("utf-8")
        assert len(list((tmp_path / quality).glob("*.png"))) == 2  # the picture and its provenance


LOOK = """
import numpy as np
from unittest.mock import MagicMock
from pointglass.viewer.commands.demo import demo_camera, demo_scan
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.colour_modes import levels, ramp_colours
from pointglass.viewer.picture.look import Look, tone_curves, toned
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.context import create_context
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.passes.develop import Developer, read_picture
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.render.raster.edit_block import ends_of
from pointglass.viewer.render.renderer import Renderer
from dataclasses import replace

scene, camera, context = open_scene([demo_scan()]), demo_camera().resized(96, 72), create_context()
edits = Edits(look=Look("easting", "turbo"))
points = np.array(scene.points)
red, green, blue = ramp_colours("turbo")[levels(unpack(scene)[0][:, 0], *ends_of(edits, scene, camera))].astype(np.uint32).T
points[:, 2] = (points[:, 2] & 0xFF000000) | red | green << 8 | blue << 16
renderer = Renderer(context, scene)

def drawn(renderer, raster, edits):
    return renderer.render(camera, Settings(view="raw", raster=raster), edits=edits).image("raw").astype(int)

wanted = drawn(Renderer(context, replace(scene, points=points, checksums=None)), "cpu", None)
for raster in ("compute", "points", "cpu"):
    found = drawn(renderer, raster, edits)
    apart = np.abs(found - wanted).max(axis=-1)
    assert (apart > 0).mean() < 0.01 and apart.max() <= 16, (raster, (apart > 0).mean())
assert (drawn(renderer, "cpu", None) != wanted).any(axis=-1).mean() > 0.5
print("coloured")

frame = renderer.render(camera, Settings(view="filled"))
plain = frame.image("filled").copy()
look = Look(contrast=0.7)
made = read_picture(Developer(Programs(context), (96, 72)).run(frame, "filled", look))
assert np.array_equal(made, toned(plain, tone_curves(look))) and (made != plain).mean() > 0.3
print("developed")

from pointglass.viewer.window.interaction import colours
ui, context = MagicMock(), MagicMock()
colours.slider_float = colours.slider_int = sliders = MagicMock(return_value=(False, 0.0))
context.scene, context.document.look = scene, look
ui.begin_combo.return_value, ui.selectable.return_value = True, (False, False)
colours.number_inputs = MagicMock(return_value=(False, (0.0, 1.0)))
colours.tooltip_beside = MagicMock()
colours.Colours().panel(ui, context)
assert "easting" in [call.args[0] for call in ui.selectable.call_args_list]
assert "##contrast" in [call.args[0] for call in sliders.call_args_list]
print("offered")
"""


@pytest.mark.slow
def test_a_colour_mode_and_an_effect_are_drawn_and_offered(house):
    assert run(house, "-c", LOOK).split() == ["coloured", "developed", "offered"]


TOOL = """
from unittest.mock import MagicMock
from pointglass.viewer.window.interaction.controls import by_key, table_markdown
from pointglass.viewer.window.interaction.table import toolbox
from pointglass.viewer.window.shell.actions import WindowActions
app = MagicMock()
app.toolbox = toolbox()
WindowActions(app).do(by_key()["KP_5"].action)
print(app.toolbox.active.name, "tried by a test" in table_markdown())
"""


def test_a_tool_is_reached_by_its_key(house):
    assert run(house, "-c", TOOL).split() == ["bearing", "True"]
