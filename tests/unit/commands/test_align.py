"""``pointglass align``: what it prints and writes, and what it refuses."""

import re

import numpy as np
import pytest
from cloud_files import write_las, write_ply
from swept_room import PLACES, sweep

import pointglass
from pointglass.viewer import cli
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.rigid_transform import inverse, moved_points, rigid, rotation_about
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.work.project import moves_of, read_project, scans_of
from pointglass.viewer.work.registration.pair_file import read_pairs


@pytest.fixture
def stations(tmp_path, seed):
    """A fixed scan of a room, one from another place in a frame of its own, and the transformation from there."""
    random = np.random.default_rng(seed)
    first, second = (sweep(place, seed + number, noise=0.002) for number, place in enumerate(PLACES[:2]))
    truth = rigid(rotation_about(random.normal(size=3), random.uniform(-180, 180)), random.uniform(-500, 500, 3))
    grey = np.full((len(first), 3), 128, np.uint8)
    fixed = write_ply(tmp_path / "fixed.ply", first, grey)
    moving = write_ply(tmp_path / "moving.ply", moved_points(inverse(truth), second), grey)
    return moving, fixed, truth, second


def pairs_file(path, truth, random, noise: float):
    corners = np.array([[2.9, 2.4, 1.3], [-2.9, 2.4, -1.3], [2.9, -2.4, 0.0], [-2.9, -2.4, 1.3]])
    own = moved_points(inverse(truth), corners) + noise * random.normal(size=corners.shape)
    rows = "\n".join(",".join(map(repr, row)) for row in np.hstack([own, corners]).tolist())
    path.write_text(f"mx,my,mz,fx,fy,fz\n{rows}\n")
    return path


@pytest.mark.slow
def test_pairs_and_surfaces_bring_a_scan_to_its_place_and_the_project_shows_it_there(tmp_path, seed, stations, capsys):
    moving, fixed, truth, second = stations
    pairs = pairs_file(tmp_path / "pairs.csv", truth, np.random.default_rng(seed), 0.02)
    out = tmp_path / "p.pointglass"
    assert cli.main(["align", str(moving), str(fixed), "--pairs", str(pairs), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    written = re.search(r"4 pairs, rms (\S+), residuals (.*)", text)
    assert written is not None
    assert float(written[1]) == pytest.approx(np.sqrt(np.mean(np.square([*map(float, written[2].split(", "))]))), rel=1e-3)
    assert re.search(r"\d+ % of moving.ply overlap", text) and "(95 %" in text
    document = read_project(out)
    found = document.scans[0].transform
    assert found is not None and document.scans[1].transform is None
    own = moved_points(inverse(truth), second)
    assert np.linalg.norm(moved_points(found, own) - second, axis=1).max() < 0.003
    scene = open_scene(scans_of(out, document), moves=moves_of(document.scans), cache=False)
    assert np.ptp(scene.bounds, axis=0).max() < 6.2  # one room
    unsure = document.scans[0].unsure
    assert unsure is not None and f"unsure   {unsure:.2g}" in text and document.scans[1].unsure is None
    again = ["compare", str(fixed), str(moving), "--project", str(out), "--out", str(tmp_path / "compared"), "--depth", "0.2"]
    assert cli.main(again) == 0 and "registration unsure by" in capsys.readouterr().out
    table = (tmp_path / "compared" / "distances.csv").read_text("utf-8-sig")
    assert f",registration uncertainty (95 %),,,{unsure:.9g}," in table and ",search depth,,,0.2," in table
    with pointglass.open(fixed, cache=False) as before, pointglass.open(moving, cache=False) as after:
        there = pointglass.compare(before, after, project=out, depth=0.2)
        exact = pointglass.compare(before, after, project=out, depth=0.2, registration=0.0)
        with pytest.raises(InputError, match="do not overlap"):
            pointglass.compare(before, after)
        with pytest.raises(InputError, match="after: an array has no file that a project could have moved"):
            pointglass.compare(before, second, project=out)
    assert there.registration == unsure and abs(np.nanmedian(there.distance)) < 0.001
    np.testing.assert_allclose(there.uncertainty, exact.uncertainty + unsure)


def test_pairs_alone_move_a_scan(tmp_path, seed, stations, capsys):
    moving, fixed, truth, _ = stations
    pairs = pairs_file(tmp_path / "pairs.csv", truth, np.random.default_rng(seed), 0.0)
    assert cli.main(["align", str(moving), str(fixed), "--pairs", str(pairs), "--only-pairs"]) == 0
    text = capsys.readouterr().out
    assert "surfaces" not in text and "moved    moving.ply to its place beside fixed.ply: turned" in text


@pytest.mark.parametrize(("arguments", "words"), [
    (["--only-pairs"], "needs pairs of points; give --pairs"),
    (["--out", "x.laz"], "ending in .pointglass"),
    (["--pairs", "none.csv"], "none.csv: cannot be read"),
    ([], "too little in common"),
])  # fmt: skip
def test_what_cannot_be_done_is_refused_in_one_line(stations, arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["align", str(stations[0]), str(stations[1]), *arguments]) == 2
    said = capsys.readouterr().err.strip()
    assert words in said and "\n" not in said
    assert not list(tmp_path.glob("*.pointglass"))


def test_scans_in_other_units_are_refused(tmp_path, stations, capsys):
    feet = write_las(tmp_path / "feet.las", np.random.default_rng(0).random((1000, 3)), wkt='LOCAL_CS["a",UNIT["foot",0.3048]]')
    metres = write_las(tmp_path / "metres.las", np.random.default_rng(0).random((1000, 3)), wkt='LOCAL_CS["a",UNIT["metre",1]]')
    assert cli.main(["align", str(feet), str(metres)]) == 2
    assert "moved, not scaled" in capsys.readouterr().err


@pytest.mark.parametrize(("text", "words"), [
    ("1,2,3,4,5\n", "line 1"), ("1 2 3 4 5 6\n1 2 3 4 5 x\n", "line 2"), ("", "no pairs"), ("a,b,c,d,e,f\n\n", "no pairs"),
    ("1,2,3,4,5,nan\n", "line 1"), ("a,b\nc,d\n", "line 2"),
])  # fmt: skip
def test_damaged_files_of_pairs_are_refused_by_line(tmp_path, text, words):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_pairs(tmp_path / "p.csv")


def test_pairs_are_read_with_any_usual_separator(tmp_path):
    for text in ("1;2;3;4;5;6\n", "# pairs\n\n1 2\t3 4 5 6\n", "mx,my,mz,fx,fy,fz\r\n1,2,3,4,5,6\r\n"):
        (tmp_path / "p.csv").write_text(text)
        moving, fixed = read_pairs(tmp_path / "p.csv")
        assert moving.tolist() == [[1, 2, 3]] and fixed.tolist() == [[4, 5, 6]]
