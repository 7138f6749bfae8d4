"""Sections: what is drawn is what lies in the slab, and a length on paper times the scale is the length in the scan."""

import numpy as np
import pytest
from PIL import Image

from pointglass.viewer import cli
from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.commands.section import splat_kernels
from pointglass.viewer.commands.section.command import parse_scale
from pointglass.viewer.commands.section.cut import along_line, elevation, plan
from pointglass.viewer.commands.section.orthographic import CLOSES, CellSpacings, draw
from pointglass.viewer.commands.section.sheet import INCH, borders, round_length, sheet, write_figures
from pointglass.viewer.commands.section.sheet_request import paper_of
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.selection import Selection

SIZE = np.array([8.0, 6.0, 3.0])


def room(seed=1, points=60_000, *, metre=1.0, offset=(0.0, 0.0, 0.0), known=True):
    """The walls, floor and ceiling of a room of 8 x 6 x 3 m; ``metre`` in file units."""
    rng = np.random.default_rng(seed)
    xyz = rng.random((points, 3)) * SIZE
    wall = rng.integers(0, 6, points)
    xyz[np.arange(points), wall % 3] = np.where(wall < 3, 0.0, SIZE[wall % 3])
    meta = ScanDescription(metres_per_unit=1.0 / metre if known else None)
    return scene_from_arrays(xyz * metre + np.array(offset), rng.integers(60, 255, (points, 3), np.uint8), meta=meta)


def write_sheet(out, drawing, paper, scene) -> tuple[float, float]:
    """Width and height in millimetres."""
    figure = sheet(drawing, paper, scene, "room")
    write_figures(out, [(figure, paper.dpi)])
    return tuple(figure.get_size_inches() * INCH * 1000)


CUTS = {
    "plan": lambda at, metre: plan(at[2] + 1.2 * metre, 0.3 * metre),
    "line": lambda at, metre: along_line(at[:2] + np.array([1.0, 5.0]) * metre, at[:2] + np.array([7.0, 1.0]) * metre, metre),
    "elevation": lambda at, metre: elevation(30.0, 2.5 * metre, np.array([at, at + SIZE * metre])),
}


@pytest.mark.parametrize("kind", list(CUTS))
@pytest.mark.parametrize(("metre", "offset"), [(1.0, (0, 0, 0)), (1000.0, (0, 0, 0)), (1.0, (636_000, 5_848_000, 40))])
def test_the_picture_holds_exactly_the_points_of_the_slab(kind, metre, offset):
    """Judged against the definition: signed distances from planes, and discs of the spacing around the points inside."""
    scene = room(points=20_000, metre=metre, offset=offset)
    cut = CUTS[kind](np.array(offset), metre)
    drawing = draw(Selection(scene), cut, 0.02 * metre)
    xyz, _, _, _ = unpack(scene)
    way = xyz - np.array(cut.origin)
    depth, along = way @ np.array(cut.forward), way @ np.array(cut.right)
    inside = (depth >= cut.near) & (depth <= cut.far) & (along >= cut.left) & (along <= cut.rightmost)
    assert drawing.count == inside.sum() > 300
    pixels = drawing.pixel_of(cut.paper(xyz[inside])[:, :2])
    height, width = drawing.image.shape[:2]
    covered = np.zeros((height, width), bool)
    radii = CLOSES * CellSpacings(scene).at(xyz[inside]) / drawing.pixel
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    for (x, y), radius in zip(pixels, radii, strict=True):
        reach = int(radius) + 2
        part = np.s_[max(int(y) - reach, 0) : int(y) + reach + 1, max(int(x) - reach, 0) : int(x) + reach + 1]
        covered[part] |= (columns[part] - x) ** 2 + (rows[part] - y) ** 2 <= radius**2
        covered[int(y), int(x)] = True
    differs = (drawing.image[..., 3] > 0) != covered
    assert differs.mean() < 1e-4  # a centre on the rim of a disc: two ways of rounding
    assert set(np.unique(drawing.image[..., 3])) <= {0, 255}


def test_a_nearer_point_hides_a_farther_one_and_equal_ones_are_averaged():
    nearest, sums = np.full((9, 9), np.inf), np.zeros((9, 9, 4), np.int64)
    columns = rows = np.array([4.5, 4.5, 4.5])
    depths, radii, tolerances = np.array([1.0, 1.01, 3.0]), np.full(3, 2.0), np.full(3, 0.05)
    colours = np.array([[100, 0, 0], [200, 0, 0], [0, 255, 0]], np.uint8)
    splat_kernels.nearest_depths(nearest, columns, rows, depths, radii)
    splat_kernels.add_colours(sums, nearest, columns, rows, depths, radii, tolerances, colours)
    assert nearest[4, 4] == 1.0 and sums[4, 4, 1] == 0
    assert sums[4, 4, 0] / sums[4, 4, 3] == pytest.approx(150.0)


@pytest.mark.parametrize("seed", [5, 6])
def test_the_walls_of_a_room_lie_to_scale_on_the_png(tmp_path, seed):
    """Between the outer edges of its drawn walls the plan measures 8 x 6 m, within a pixel and the width of a disc."""
    rng = np.random.default_rng(seed)
    scale, dpi = float(rng.choice([20, 50, 100])), int(rng.choice([150, 300]))
    scene = room(seed, points=200_000)
    paper = paper_of(scene, scale, dpi)
    drawing = draw(Selection(scene), plan(1.5, 0.5), paper.pixel)
    out = tmp_path / "plan.png"
    width, height = write_sheet(out, drawing, paper, scene)
    image = np.asarray(Image.open(out).convert("RGB"))
    assert Image.open(out).info["dpi"] == pytest.approx((dpi, dpi), abs=0.02)
    assert np.array(image.shape[1::-1]) / dpi * INCH * 1000 == pytest.approx((width, height))
    left, top, *_ = borders(drawing, paper)
    rows, columns = drawing.image.shape[:2]
    shown = image[top : top + rows, left : left + columns]
    there = drawing.image[..., 3] > 0
    assert np.array_equal(shown[there], drawing.image[there][:, :3])  # not a pixel moved or blended
    wall = (shown < 250).any(axis=2)
    found = [np.ptp(np.nonzero(np.any(wall, axis=axis))[0]) + 1 for axis in (0, 1)]
    disc = 2 * CLOSES * scene.spacing * 2 / paper.pixel
    for pixels, metres in zip(found, SIZE[:2], strict=True):
        assert abs(pixels / dpi * INCH * scale - metres) <= (disc + 1) * paper.pixel


@pytest.mark.parametrize(("scale", "metre"), [(50.0, 1.0), (200.0, 0.001), (20.0, 1000.0)])
def test_a_pdf_page_is_as_large_as_the_scale_says_and_repeats_to_the_byte(tmp_path, scale, metre):
    scene = room(metre=metre)
    paper = paper_of(scene, scale, 150)
    drawing = draw(Selection(scene), along_line((0, 3 * metre), (8 * metre, 3 * metre), 0.5 * metre), paper.pixel)
    files = [tmp_path / "a.pdf", tmp_path / "b.pdf"]
    (width, height), _ = [write_sheet(file, drawing, paper, scene) for file in files]
    data = files[0].read_bytes()
    assert data == files[1].read_bytes()
    box = [float(value) for value in data.split(b"/MediaBox [")[1].split(b"]")[0].split()]
    assert np.array(box[2:]) / 72 * INCH * 1000 == pytest.approx((width, height), abs=0.01)
    axes = sheet(drawing, paper, scene, "room").axes[0]
    across = axes.get_position().width * width / 1000  # metres of paper that the drawing takes
    low, high = axes.get_xlim()
    assert across * scale == pytest.approx((high - low) / metre, rel=1e-9)
    assert (high - low) / metre >= 8.0


def test_left_is_left_in_every_view():
    """A red post at the first end of a line, a green one at the second; from above, x goes right and y up."""
    posts = np.array([[1.0, 1.0], [5.0, 1.0], [1.0, 4.0]])
    xyz = np.concatenate([np.c_[np.tile(post, (500, 1)), np.linspace(0, 2, 500)] for post in posts])
    rgb = np.repeat(np.array([[220, 60, 60], [60, 220, 60], [60, 60, 220]], np.uint8), 500, axis=0)
    selection = Selection(scene_from_arrays(xyz, rgb))
    columns = {}
    for name, cut in (("there", along_line((0, 1), (6, 1), 1.0)), ("back", along_line((6, 1), (0, 1), 1.0)),
                      ("north", elevation(0.0, None, np.array([[0, 0, 0], [6, 5, 2]]))),
                      ("south", elevation(180.0, None, np.array([[0, 0, 0], [6, 5, 2]])))):
        image = draw(selection, cut, 0.02).image
        near = 2 if name == "south" else 0  # the blue post hides the red one there
        columns[name] = [np.nonzero((image[..., 3] > 0) & (image[..., c] > 150))[1].mean() for c in (near, 1)]
    assert columns["there"][0] < columns["there"][1] and columns["back"][0] > columns["back"][1]
    assert columns["north"][0] < columns["north"][1] and columns["south"][0] > columns["south"][1]
    image = draw(selection, plan(1.0, 2.5), 0.02).image
    places = [np.argwhere((image[..., 3] > 0) & (image[..., c] > 150)).mean(axis=0) for c in range(3)]
    assert places[1][1] > places[0][1] + 150 and places[2][0] < places[0][0] - 100


def test_a_plan_of_a_scan_that_lies_on_its_side_follows_the_up_axis():
    scene = room()
    xyz, rgb, _, _ = unpack(scene)
    turned = np.column_stack([xyz[:, 0], xyz[:, 2], -xyz[:, 1]])  # up is y now
    lying = scene_from_arrays(turned, rgb)
    a = draw(Selection(scene), plan(1.0, 0.4), 0.05)
    b = draw(Selection(lying), plan(1.0, 0.4, (0.0, 1.0, 0.0)), 0.05)
    assert abs(a.count - b.count) <= 5
    assert np.ptp(np.nonzero(b.image[..., 3])[1]) == pytest.approx(np.ptp(np.nonzero(a.image[..., 3])[1]), abs=3)


def test_the_command_honours_a_project(tmp_path, capsys):
    scan, project = tmp_path / "room.laz", tmp_path / "room.pointglass"
    export(Selection(room()), scan)
    box = Box((2.0, 3.0, 1.5), (2.0, 4.0, 2.0))
    write_project(project, Document((ScanFile(str(scan), metres_per_unit=0.3048),), clips=(box,)))
    counts = []
    for source in (scan, project):
        out = tmp_path / "plan.pdf"
        assert cli.main(["section", str(source), "--plan", "1.5", "--thickness", "1", "--out", str(out), "--no-cache"]) == 0
        assert out.read_bytes().startswith(b"%PDF")
        counts.append(int(capsys.readouterr().out.split()[0].replace(",", "")))
    assert 0 < counts[1] < counts[0]


@pytest.mark.parametrize(("options", "said"), [
    (["--plan", "90", "--out", "a.png"], "holds no point"),
    (["--plan", "1", "--out", "a.jpg"], "not written"),
    (["--plan", "1", "--out", "no/a.png"], "does not exist"),
    (["--plan", "1", "--out", "a.png", "--scale", "1:0"], "such as 1:50"),
    (["--plan", "1", "--out", "a.png", "--scale", "1:0.01"], "choose a smaller scale"),
    (["--plan", "1", "--out", "a.png", "--thickness", "-1"], "above 0"),
    (["--plan", "1", "--out", "a.png", "--dpi", "1"], "10 to 2400"),
    (["--line", "1,2,3", "--out", "a.png"], "X1,Y1,X2,Y2"),
    (["--line", "1,2,1,2", "--out", "a.png"], "same place"),
])  # fmt: skip
def test_a_section_that_cannot_be_drawn_is_one_line_and_no_file(tmp_path, monkeypatch, capsys, options, said):
    monkeypatch.chdir(tmp_path)
    export(Selection(room(points=3000)), tmp_path / "room.laz")
    assert cli.main(["section", "room.laz", "--no-cache", *options]) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["room.laz"]


def test_scales_and_round_lengths():
    assert parse_scale("1:50") == parse_scale("50") == 50.0 and parse_scale("1:12.5") == 12.5
    assert [round_length(value) for value in (0.7, 1.0, 1.1, 3.0, 23.0)] == [1.0, 1.0, 2.0, 5.0, 50.0]
    with pytest.raises(InputError):
        parse_scale("1:x")
