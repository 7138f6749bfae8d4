"""The README: short, with the controls, pictures and links that exist; its picture is what is rendered today."""

import importlib.util
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pointglass.viewer.window.interaction.controls import table_markdown

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / "README.md").read_text("utf-8")


@pytest.fixture(scope="module")
def pictures():
    """The module .ci/readme_pictures.py."""
    spec = importlib.util.spec_from_file_location("readme_pictures", ROOT / ".ci" / "readme_pictures.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_is_short_and_has_the_controls_that_there_are():
    assert len(TEXT.encode()) <= 12_000
    assert table_markdown() in TEXT


def test_it_names_every_format_that_is_read_and_written():
    from pointglass.viewer.command_table import _COMMANDS
    from pointglass.viewer.commands.exporting.targets import TARGETS
    from pointglass.viewer.readers.formats import FORMATS
    from pointglass.viewer.work.cameras.camera_files import CAMERA_FORMATS

    rows = dict(re.findall(r"^\| (scans|folders|cameras|output) \| (.*) \|$", TEXT, re.MULTILINE))
    read = [name.split()[0] for row in FORMATS for name in row.names]
    assert [name for name in read if name not in rows["scans"] + rows["folders"]] == []
    cameras = [name.removeprefix("a ").split()[0] for row in CAMERA_FORMATS for name in row.names]
    assert [name for name in cameras if name not in rows["cameras"]] == []
    for text in (rows["output"], _COMMANDS["export"][0]):
        assert [row.name for row in TARGETS.values() if row.name not in text] == []


def test_its_links_lead_somewhere():
    links = [link for link in re.findall(r"\]\(([^)]*)\)", TEXT) if "://" not in link]
    assert links and [link for link in links if not (ROOT / link).exists()] == []


def test_its_commands_and_options_exist():
    from pointglass.viewer.command_table import COMMANDS, make_parser

    shell = "\n".join(re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL))
    for line in re.findall(r"^pointglass (.*?)(?:\s+#.*)?$", shell, re.MULTILINE):
        words = line.split()
        make_parser().parse_args(words if words[0] in COMMANDS else ["view", *words])
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z]+)\b", TEXT)) <= targets


def test_its_python_example_uses_names_that_exist():
    import pointglass

    example = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert example is not None
    compile(example[1], "README.md", "exec")
    for name in re.findall(r"pointglass\.([a-z_]+)\(", example[1]):
        assert hasattr(pointglass, name)
    for name in re.findall(r"scan\.([a-z_]+)", example[1]):
        assert hasattr(pointglass.Scan, name), name
    fields = set(pointglass.Frame.__dataclass_fields__)
    assert set(re.findall(r"frame\.([a-z_]+)|\s\.([a-z]+)", example[1])) and {
        name for pair in re.findall(r"frame\.([a-z_]+)|\s\.([a-z]+)", example[1]) for name in pair if name} <= fields


def test_the_python_versions_are_those_of_the_package():
    least, below = re.search(r">=3\.(\d+),<3\.(\d+)", tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "requires-python"]).groups()  # type: ignore[union-attr]
    assert f"Python 3.{least} to 3.{int(below) - 1}" in TEXT


@pytest.mark.gl
def test_the_picture_shows_four_views_as_they_are_rendered_today(pictures, tmp_path):
    assert f"](assets/{pictures.PICTURE.as_posix()})" in TEXT
    with Image.open(pictures.write_picture(tmp_path / "four.jpg", quality="fast")) as picture:
        shown = np.asarray(picture, int)
    width, height = pictures.SIZE
    corners = [(4 + (height + 4) * row, 4 + (width + 4) * column) for row in (0, 1) for column in (0, 1)]
    views = [shown[y : y + height, x : x + width] for y, x in corners]
    dark = [float((view.max(axis=-1) < 40).mean()) for view in views]
    assert dark[1] > dark[0] > 0.2 and max(dark[2:]) < 0.05, "points on black, hidden ones gone, filled, repainted"
    with Image.open(ROOT / "assets" / pictures.PICTURE) as kept:
        assert np.abs(np.asarray(kept, int)[:height] - shown[:height]).mean() < 4, "the committed picture is out of date"


def test_the_animation_goes_from_raw_to_neural(pictures):
    path = ROOT / "assets" / pictures.ANIMATION
    assert f"](assets/{pictures.ANIMATION.as_posix()})" in TEXT and path.stat().st_size <= 3_000_000
    with Image.open(path) as animation:
        assert animation.width == 640 and animation.info["loop"] == 0  # type: ignore[attr-defined]
        dark = []
        for number in (0, pictures.FRAMES - 1):
            animation.seek(number)
            dark.append(float((np.asarray(animation.convert("RGB")).max(axis=-1) < 40).mean()))
    assert dark[0] > 0.2 and dark[1] < 0.1, "almost all raw first, almost all neural at the turn"
