"""Parts of a publication: depth as codes, places that see every surface, text that stays text, a page built from its
sources."""

import contextlib
import hashlib
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pointglass.viewer.cli import main
from pointglass.viewer.commands.publishing.coming_files import ComingFiles
from pointglass.viewer.commands.publishing.cube_faces import face_cameras
from pointglass.viewer.commands.publishing.data_scripts import comment_of, script
from pointglass.viewer.commands.publishing.depth_codes import STEP, DepthScale, packed_depth, unpacked_depth
from pointglass.viewer.commands.publishing.face_margins import BAND, blended, with_margin, without_margin
from pointglass.viewer.commands.publishing.measured_data import measurements_data
from pointglass.viewer.commands.publishing.plan_picture import plan_of, storeys
from pointglass.viewer.work.measuring.measure_shapes import shapes_of
from pointglass.viewer.work.measuring.measure_text import value_text
from pointglass.viewer.work.measuring.measurement import KINDS
from pointglass.viewer.work.places.planned.covering_places import covering_places
from pointglass.viewer.work.places.planned.human_scale import FEET, metre_of
from pointglass.viewer.work.places.planned.outside_places import outside_places
from pointglass.viewer.work.places.planned.standing_candidates import standing_candidates
from pointglass.viewer.work.places.standing_place import SceneSample
from pointglass.viewer.work.places.walk_map import map_of

ROOT = Path(__file__).resolve().parents[3]
WEB = ROOT / "viewer" / "commands" / "publishing" / "web"
PAGE = WEB.parent / "page"


@pytest.mark.parametrize("reach", [3.0, 200.0, 1e6])
def test_coded_depth_comes_back_within_the_stated_error(seed, reach):
    rng = np.random.default_rng(seed)
    depth = 10 ** rng.uniform(-1, np.log10(reach), (6, 32, 32))
    depth[rng.random(depth.shape) < 0.2] = 0
    measured = (rng.random(depth.shape) < 0.6) & (depth > 0)
    scale = DepthScale.of(depth)
    assert scale.step >= STEP
    codes, bits = unpacked_depth(packed_depth(scale.codes(depth), measured), 6, 32)
    back = scale.depths(codes)
    assert (bits == measured).all() and ((back == 0) == (depth == 0)).all()
    there = depth > 0
    assert np.abs(back[there] / depth[there] - 1).max() <= scale.error * (1 + 1e-9)
    if reach < 10:
        assert scale.error < 1e-4  # half a millimetre at 5 m


def test_planes_cost_little():
    """The prediction leaves next to nothing of a wall: less than a tenth of its codes' bytes."""
    column, row = np.meshgrid(np.arange(64), np.arange(64))
    depth = np.stack([1 / (0.2 + 0.001 * column * k + 0.0005 * row) for k in range(6)])
    scale = DepthScale.of(depth)
    assert len(packed_depth(scale.codes(depth), depth > 0)) < 0.1 * 2 * depth.size


def rooms(seed):
    """Walls, floors and ceilings of two rooms of 5 x 4 x 2.6 m with a door between them, and the way from points to rooms."""
    rng = np.random.default_rng(seed)
    parts = []
    for first in (0.0, 5.2):
        xyz = rng.random((60_000, 3)) * (5.0, 4.0, 2.6) + (first, 0, 0)
        axis, side = rng.integers(0, 3, len(xyz)), rng.random(len(xyz)) < 0.5
        low, high = np.array([first, 0, 0]), np.array([first + 5.0, 4.0, 2.6])
        xyz[np.arange(len(xyz)), axis] = np.where(side, high[axis], low[axis])
        door = (xyz[:, 1] > 1.5) & (xyz[:, 1] < 2.5) & (xyz[:, 2] < 2.1) & (xyz[:, 0] > 4.9) & (xyz[:, 0] < 5.3)
        parts.append(xyz[~door])
    sill = rng.random((2000, 3)) * (0.3, 1.0, 0.0) + (4.95, 1.5, 0.0)
    return np.concatenate([*parts, sill])


def test_places_are_planned_in_every_room_and_nowhere_else(seed):
    points = rooms(seed)
    spacing = 0.04
    walk = map_of(points, points.min(axis=0) - 0.2, 0.12, 1.0, spacing)
    eyes, areas, footing, _ = standing_candidates(walk)
    indoors = (eyes[:, 2] > 1.4) & (eyes[:, 2] < 1.9)
    home = areas == areas[indoors][0]
    assert len(eyes) > 30 and not indoors.all()  # one can stand on the roof, too
    assert home[indoors].mean() > 0.9  # the door joins the rooms
    places = covering_places(points, eyes, home, 1.0, 12, footing)
    assert 2 <= len(places) <= 12
    assert (np.abs(places[:, 2] - 1.6) < 0.2).all()
    x, y = places[:, 0], places[:, 1]
    assert (x < 4.7).any() and (x > 5.5).any()
    assert (np.minimum(y, 4 - y) > 0.3).all() and (np.minimum(x, 10.2 - x) > 0.3).all()


def test_nobody_is_put_on_a_table_or_beside_a_column(seed):
    """The middle of the first room, from where most is seen, has a table in it; the second one has a column."""
    rng = np.random.default_rng(seed)
    table = rng.random((6000, 3)) * (1.6, 1.2, 0.0) + (1.7, 1.4, 0.7)
    turn = rng.random(4000) * 2 * np.pi
    column = np.column_stack([7.7 + 0.25 * np.cos(turn), 2.0 + 0.25 * np.sin(turn), rng.random(4000) * 2.6])
    points = np.concatenate([rooms(seed), table, column])
    walk = map_of(points, points.min(axis=0) - 0.2, 0.12, 1.0, 0.04)
    eyes, areas, footing, _ = standing_candidates(walk)
    on_table = np.abs(eyes[:, 2] - 2.3) < 0.1
    assert on_table.any() and (footing[on_table] < 0.7).all()
    places = covering_places(points, eyes, areas == areas[np.abs(eyes[:, 2] - 1.6).argmin()], 1.0, 12, footing)
    assert (np.abs(places[:, 2] - 1.6) < 0.2).all()
    assert (np.linalg.norm(places[:, :2] - (7.7, 2.0), axis=1) > 0.95).all()


def sample_of(points, spacing):
    """What sample_scene tells of points in metres."""
    low, high = np.percentile(points, [1, 99], axis=0)
    level, diagonal = np.full(len(points), 0.5, np.float32), float(np.linalg.norm(high - low))
    return SceneSample(points, level, low, high, spacing, 1.0, diagonal, 0.5)


def test_over_a_landscape_places_stand_clear_above_trees_and_see_all_ground(seed):
    rng = np.random.default_rng(seed)
    ground = rng.uniform((0, 0), (500, 260), (60_000, 2))
    trees = rng.uniform((20, 20), (480, 240), (40, 2)).repeat(300, axis=0) + rng.normal(0, 2, (12_000, 2))
    flat = np.concatenate([ground, trees])
    points = np.column_stack([flat, 10 * np.sin(flat[:, 0] / 80)])
    points[len(ground):, 2] += rng.uniform(0, 25, len(trees))
    level = sample_of(points, 0.7)
    places = outside_places(level, 12, coarse=True)
    assert 2 <= len(places) <= 12 and not any(place.around for place in places)
    reached = np.zeros(len(ground), bool)
    for place in places:
        away = np.linalg.norm(points[:, :2] - place.position[:2], axis=1)
        assert place.position[2] > points[away < 25, 2].max() + 10
        assert -0.6 < place.direction[2] < -0.5 and np.isclose(np.linalg.norm(place.direction), 1)
        assert abs(place.position[2] - place.below - 10 * np.sin(place.position[0] / 80)) < 8
        reached |= away[: len(ground)] < 3.2 * 56
    assert reached.mean() > 0.9
    assert len(outside_places(level, 1, coarse=True)) == 1


def test_around_a_thing_places_have_all_of_it_in_view(seed):
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.2, 6.0, 3)
    ball = rng.normal(size=(40_000, 3))
    points = ball / np.linalg.norm(ball, axis=1)[:, None] * size + rng.uniform(-50, 50, 3)
    places = outside_places(sample_of(points, 0.01 * size.max()), 12, coarse=False)
    assert 4 <= len(places) <= 7 and all(place.around for place in places)
    for place in places:
        away = points - place.position
        assert np.degrees(np.arccos(away @ place.direction / np.linalg.norm(away, axis=1))).max() < 37.5  # of the page's 75
    yaws = np.sort([np.arctan2(place.direction[1], place.direction[0]) for place in places[:-1]])
    assert np.diff(np.append(yaws, yaws[0] + 2 * np.pi)).max() < np.radians(185)


def test_feet_are_told_from_metres_by_the_height_of_rooms(seed):
    points = rooms(seed)
    for unit in (1.0, FEET):
        walk = map_of(unit * points, unit * points.min(axis=0) - 1.0, 0.12 * unit, 1.0, 0.04 * unit)
        assert metre_of(walk) == unit


def test_a_plan_ends_beside_the_walls_not_where_something_was_seen_through_a_window(seed):
    rng = np.random.default_rng(seed)
    walls, wall = rng.random((40_000, 3)) * (8, 6, 2.6), rng.integers(0, 4, 40_000)
    walls[np.arange(len(walls)), wall % 2] = np.where(wall < 2, 0, np.where(wall % 2, 6, 8))
    outside = rng.random((1_500, 3)) * (8, 4, 2.6) + (0, 6.1, 0)
    points, places = np.concatenate([walls, outside]), np.array([[3.0, 2.0, 1.6], [5.0, 4.0, 1.6]])
    for metre in (1.0, FEET):
        plan = plan_of(points * metre, places * metre, 0.0, metre)
        assert np.allclose(plan.low / metre, (-1, -1), atol=0.02) and np.allclose(plan.high / metre, (9, 7), atol=0.3)


def test_storeys_are_told_by_their_floors():
    assert storeys(np.array([0.1, 3.2, 0.0, 3.1, 6.0, 0.4]), 1.0).tolist() == [0, 1, 0, 1, 2, 0]


HOSTILE = ["</script><script>alert(1)</script>", "<!--", "a\u2028b", 'x"\\', "*/ POINTGLASS(1)", "Zürich \U0001f600"]


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_leaves_its_script(text):
    made = script("scene", {"title": text}, json.dumps({"made_of": "0"}))
    assert b"<" not in made and made.isascii() and made.count(b"\n") == 1
    assert made.index(b"*/") == made.index(b"*/POINTGLASS")
    assert comment_of(made) == '{"made_of": "0"}'
    body = made[made.index(b"(") + 1 : made.rindex(b")")]
    assert json.loads(b"[" + body + b"]") == ["scene", {"title": text}]


def sources():
    return [WEB / "package-lock.json", WEB / "package.json", WEB / "tsconfig.json", *sorted((WEB / "src").glob("*.ts"))]


def test_the_page_was_built_from_its_sources():
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in sources())).hexdigest()
    first = (PAGE / "page.js").read_text("ascii").splitlines()[0]
    assert digest in first, "web/ has changed: run `make web`"


def test_building_the_page_again_changes_nothing():
    if shutil.which("node") is None or not (ROOT / "out" / "web" / "node_modules" / ".lock").is_file():
        pytest.skip("node, or what `make web` installs, is not here")
    done = subprocess.run([ROOT / ".ci" / "web.sh", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_page_asks_for_nothing_and_runs_nothing_inline():
    page = (PAGE / "index.html").read_text("utf-8")
    assert "default-src 'none'" in page and "connect-src" not in page and "unsafe" not in page
    assert "<style" not in page and "style=" not in page and "onclick" not in page and "onload" not in page
    assert page.count("<script") == page.count("<script src=") == 1 and "http:" not in page.replace("http://www.w3.org", "")


def test_every_kind_of_measurement_reaches_the_page_with_its_value_and_shape(seed):
    """Values as the measurement table has them; lines and rings of the window's drawing, at most 256 points each."""
    from documents import random_document

    made = random_document(np.random.default_rng(seed), ["a.ply"]).measurements
    shift = np.array([10.0, -3.0, 2.0])
    data = measurements_data(made, "m", lambda points: points - shift)
    assert json.dumps(data, allow_nan=False)
    for value, measurement in zip(data, made, strict=True):
        shapes = shapes_of(measurement)
        assert value["text"] == value_text(measurement, "m") and value["kind"] == KINDS[measurement.kind].name
        assert len(value["lines"]) == len(shapes.lines) + len(shapes.rings)
        first = value["points"][0]
        assert np.allclose(np.add(first, shift), measurement.points[0].position, atol=1e-5)
        for line, drawn in zip(value["lines"], shapes.lines):
            assert 2 <= len(line["points"]) <= 256
            assert np.allclose(np.add(line["points"][-1], shift), drawn.points[-1], atol=1e-5)


def test_all_four_views_are_offered(capsys):
    with pytest.raises(SystemExit):
        main(["publish", "--help"])
    assert "--view {raw,filtered,filled,neural}" in " ".join(capsys.readouterr().out.split())


def test_a_replacement_killed_between_any_two_renames_is_finished_by_the_next_run(tmp_path, monkeypatch):
    """The old publication has notes, the new one an overview instead.  Killed before the first rename, that of the list of what
    is new, nothing is replaced."""
    left, replace = [0], Path.replace
    for killed in range(12):
        coming = ComingFiles(tmp_path / str(killed), ("places", "notes", "scene.js", "overview.html", "index.html"))
        out = coming.out
        for folder in (coming.places, out / "places", out / "notes"):
            folder.mkdir(parents=True)
        for file in (coming.places / "000.first.js", coming.folder / "scene.js", coming.folder / "overview.html",
                     coming.folder / "index.html"):
            file.write_text("new")
        for file in (out / "places" / "000.first.js", out / "places" / "001.first.js", out / "notes" / "0", out / "index.html"):
            file.write_text("old")
        (coming.places / "007.first.js").write_text("of an earlier run")
        left[0] = killed

        def counted(path, target):
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
            return replace(path, target)

        monkeypatch.setattr(Path, "replace", counted)
        with contextlib.suppress(KeyboardInterrupt):
            coming.replace(["000.first.js"], ["scene.js", "overview.html", "index.html"])
        monkeypatch.undo()
        with coming.opened(lambda: 0, 1):
            pass
        found = {str(file.relative_to(out)): file.read_text() for file in out.rglob("*") if file.is_file()}
        names = ["index.html", "overview.html", "places/000.first.js", "scene.js"]
        old = dict.fromkeys(["index.html", "notes/0", "places/000.first.js", "places/001.first.js"], "old")
        assert found == (dict.fromkeys(names, "new") if killed else old | {"coming/places/000.first.js": "new"})
    assert left[0] > 0  # the last one was not killed


def test_faces_that_differ_are_blended_at_their_edges_only(seed):
    """Pictures of a function of the direction alone, each face with another brightness: pixels beside edges differ by as little
    as pixels inside do, and beyond the band each is that of its own picture."""
    rng, side = np.random.default_rng(seed), 128
    cameras, waves = face_cameras(np.zeros(3), side), rng.normal(size=(3, 3))
    offsets = rng.uniform(-20, 20, 6)

    def colours(rays):
        return 120 + 60 * np.sin(2 * rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ waves)

    def rays_of(camera, x, y):
        return np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], -1) @ camera.view_rotation

    wide = []
    for camera, offset in zip(map(with_margin, cameras), offsets, strict=True):
        x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        wide.append(np.rint(colours(rays_of(camera, x, y)) + offset).clip(0, 255).astype(np.uint8))
    made, band = blended(wide, cameras), int(np.ceil(BAND * side))
    inner = slice(band, side - band)
    assert all((face[inner, inner] == without_margin(own)[inner, inner]).all() for face, own in zip(made, wide, strict=True))
    middle, place = np.arange(side) + 0.5, np.arange(side)
    for number, camera in enumerate(cameras):
        for x, y, rows, columns in ((middle, np.full(side, -0.5), 0, place), (middle, np.full(side, side + 0.5), -1, place),
                                    (np.full(side, -0.5), middle, place, 0), (np.full(side, side + 0.5), middle, place, -1)):
            rays = rays_of(camera, x, y)
            beside = max(set(range(6)) - {number}, key=lambda other: float(rays[side // 2] @ cameras[other].forward))
            seen = rays @ cameras[beside].view_rotation.T
            u, v = (np.clip(((seen[:, axis] / seen[:, 2] + 1) * side / 2).astype(int), 0, side - 1) for axis in (0, 1))
            step = np.abs(made[number][rows, columns].astype(float) - made[beside][v, u])
            assert step.max() <= 40 / (2 * band) + 12 * np.abs(waves).max() * 60 / side
            assert step.mean() < 4 + 40 / (2 * band)
