"""Sheets on standard paper and drawings of traced lines, by the command, read back by other libraries."""

import re
import zlib

import ezdxf
import laspy
import numpy as np
import pytest
from PIL import Image
from untyped import polylines

from pointglass.viewer import cli
from pointglass.viewer.work.sheets.paper_layout import SIZES, Layout, fitted, needed_scale, standard_scale

SIDES = 8.0, 6.0
AT = 0.5, 0.25
"""Of the room's lower corner, metres."""


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """Four walls of 8 x 6 m, as a LAS file in metres with 1 mm of noise."""
    rng, count = np.random.default_rng(6), 200_000
    along, height = rng.random(count), rng.random(count) * 2.5
    wall = rng.integers(0, 4, count)
    x = np.choose(wall, [along, np.ones(count), along, np.zeros(count)]) * SIDES[0] + AT[0]
    y = np.choose(wall, [np.zeros(count), along, np.ones(count), along]) * SIDES[1] + AT[1]
    las = laspy.create(point_format=2)
    las.header.scales = np.full(3, 0.0001)
    las.xyz = np.stack([x, y, height], axis=1) + rng.normal(0, 0.001, (count, 3))
    las.red = las.green = las.blue = np.full(count, 20_000)
    path = tmp_path_factory.mktemp("room") / "room.las"
    las.write(path)
    return path


def pages_of(pdf: bytes) -> list[tuple[float, float]]:
    """Width and height of each page, millimetres."""
    boxes = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", pdf)
    return [(float(width) / 72 * 25.4, float(height) / 72 * 25.4) for width, height in boxes]


def test_a_dxf_has_the_walls_in_the_coordinates_of_the_file(room, tmp_path, capsys):
    out = tmp_path / "plan.dxf"
    assert cli.main(["section", str(room), "--plan", "1.2", "--out", str(out)]) == 0
    assert "traced" in capsys.readouterr().out
    drawing = ezdxf.readfile(out)  # type: ignore[reportPrivateImportUsage]
    assert not drawing.audit().has_errors
    low, high = np.array(drawing.header["$EXTMIN"])[:2], np.array(drawing.header["$EXTMAX"])[:2]
    (edge,) = polylines(drawing, "POINTGLASS FRAME")
    frame = np.array([point[:2] for point in edge.get_points()])
    assert (low <= frame.min(axis=0)).all() and (high >= frame.max(axis=0)).all()
    assert (high - low < 2 * np.ptp(frame, axis=0)).all()
    (line,) = polylines(drawing, "POINTGLASS CUT")
    corners = np.array([point[:2] for point in line.get_points()])
    wanted = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * SIDES + AT
    assert line.closed and len(corners) == 4
    assert np.linalg.norm(corners[:, None] - wanted, axis=2).min(axis=0).max() < 0.002
    texts = [text.dxf.text for text in drawing.modelspace().query("TEXT")]
    assert any("Plan at height 1.2" in text for text in texts)


@pytest.mark.slow
@pytest.mark.parametrize(("paper", "way"), [("A4", "landscape"), ("A3", "portrait"), ("A1", "landscape")])
def test_a_sheet_has_the_size_of_its_paper_and_vectors_and_the_scale_is_true(room, tmp_path, paper, way, capsys):
    out = tmp_path / "plan.pdf"
    assert cli.main(["section", str(room), "--plan", "1.2", "--paper", paper, f"--{way}", "--title", "A title $x$", "--out",
                     str(out)]) == 0
    sides = Layout(paper, way).sides
    assert pages_of(out.read_bytes()) == [pytest.approx(sides, abs=0.05)]
    picture = tmp_path / "plan.png"
    assert cli.main(["section", str(room), "--plan", "1.2", "--paper", paper, f"--{way}", "--out", str(picture), "--dpi",
                     "150"]) == 0
    scale = float(re.findall(r"at 1:(\d+)", capsys.readouterr().out)[-1])
    image = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    assert image.shape[:2] == (round(sides[1] / 25.4 * 150), round(sides[0] / 25.4 * 150))
    left, bottom, width, height = (length / 25.4 * 150 for length in Layout(paper, way).area)
    low = int(image.shape[0] - bottom)
    inside = image[low - int(height) + 20 : low - 20, int(left) + 20 : int(left + width) - 20]
    grey = np.abs(inside - 78).max(axis=2) < 12  # the colour of the points, not of the grid
    for axis, metres in ((0, SIDES[0]), (1, SIDES[1])):
        count = grey.sum(axis=axis)
        walls = np.flatnonzero(count > count.max() / 2)
        first, last = walls[walls < len(count) / 2].mean(), walls[walls > len(count) / 2].mean()
        assert abs((last - first) / 150 * 25.4 - metres / scale * 1000) < 0.3, "millimetres on paper"


def test_several_cuts_are_pages_of_one_pdf_and_of_nothing_else(room, tmp_path, capsys):
    out = tmp_path / "all.pdf"
    cuts = ["--plan", "1.0", "--plan", "2.0", "--elevation", "0"]
    assert cli.main(["section", str(room), *cuts, "--paper", "A4", "--out", str(out)]) == 0
    assert len(pages_of(out.read_bytes())) == 3
    assert cli.main(["section", str(room), *cuts, "--out", str(tmp_path / "all.png")]) == 2
    assert "3 sheets in one PNG file" in capsys.readouterr().err and not (tmp_path / "all.png").exists()


@pytest.mark.parametrize(("options", "told"), [
    (["--plan", "1", "--paper", "A4", "--scale", "1:5"], "choose --scale 1:50"),
    (["--plan", "1", "--author", "N.N."], "add --paper A4"),
    (["--plan", "1", "--from", "1"], "--elevation"),
    (["--plan", "1", "--no-picture"], "add --trace"),
    (["--trace"], "what is drawn is missing"),
    (["--elevation", "0", "--from", "here"], "expected a distance"),
])  # fmt: skip
def test_what_cannot_be_made_is_refused_in_one_line(room, tmp_path, capsys, options, told):
    out = tmp_path / "x.pdf"
    assert cli.main(["section", str(room), *options, "--out", str(out)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert told in lines[-1] and not out.exists()


def test_the_cut_plane_of_an_elevation_leaves_out_what_lies_in_front(room, tmp_path, capsys):
    counts = []
    for more in ([], ["--from", "1"], ["--from", "3,5.5"]):
        assert cli.main(["section", str(room), "--elevation", "0", *more, "--out", str(tmp_path / "e.png")]) == 0
        counts.append(int(re.findall(r"([\d,]+) points at", capsys.readouterr().out)[-1].replace(",", "")))
    assert counts[0] > counts[1] > counts[2] > 50_000, "without the near wall, then without most of the side walls"


def test_the_largest_standard_scale_that_fits_is_chosen(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        size, extent = str(rng.choice(list(SIZES))), tuple(10 ** rng.uniform(-1, 3, 2))
        layout, scale = fitted(size, None, extent, None)
        assert needed_scale(layout, extent) <= scale * (1 + 1e-9) and standard_scale(scale) == scale
        steps = [step * 10.0**power for power in range(8) for step in (1, 2, 5)]
        smaller = max((step for step in steps if step < scale), default=0)
        assert scale == 5 or needed_scale(layout, extent) > smaller


def test_texts_of_a_pdf_are_texts(room, tmp_path):
    out = tmp_path / "plan.pdf"
    assert cli.main(["section", str(room), "--plan", "1.2", "--paper", "A4", "--out", str(out)]) == 0
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", out.read_bytes(), re.DOTALL)
    shown = b""
    for stream in streams:
        try:
            shown += zlib.decompress(stream)
        except zlib.error:
            continue
    assert shown.count(b" Tj") + shown.count(b"] TJ") > 10
