"""``pointglass evaluate SCAN``: a table, JSON and a sheet; bad input is one line before the work."""

import json
import shutil

import numpy as np
import pytest
from cloud_files import write_ply
from e57_photo_files import room_points
from format_files import Points, write_ept, write_potree1, write_potree2
from PIL import Image

from pointglass.model.data.dataset import MergedScan
from pointglass.model.evaluation.labelled import GAP
from pointglass.model.network.weights_folder import weights_dir
from pointglass.viewer.cli import main
from pointglass.viewer.commands.heldout import evaluate_scan as command
from pointglass.viewer.commands.heldout.judged_viewpoints import LEAST_SHARE, station_viewpoints
from pointglass.viewer.picture.background import PLAIN

FAST = str(weights_dir() / "fast-filtered.safetensors")

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture
def scan(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "SIZE", (160, 120))
    xyz, rgb = room_points(60_000)
    return write_ply(tmp_path / "room.ply", xyz, rgb)


def test_a_scan_is_judged_by_its_own_points(scan, tmp_path, capsys):
    told = ["evaluate", str(scan), "--views", "3", "--densities", "1", "0.3", "--weights", FAST]
    assert main([*told, "--json", str(tmp_path / "r.json"), "--plot", str(tmp_path / "r.png")]) == 0
    out = capsys.readouterr()
    assert "room.ply, 60,000 points, 10 % of them withheld; 3 views" in out.out and "compare pictures, not scans" in out.out
    assert not out.err
    stored = json.loads((tmp_path / "r.json").read_text())
    rows = {(row["method"], row["density"]): row for row in stored["rows"]}
    assert set(rows) == {(m, d) for m in ("raw", "filled", "network fast-filtered") for d in (1.0, 0.3)}
    for density in (1.0, 0.3):
        assert rows["filled", density]["psnr"] > rows["raw", density]["psnr"] + 1
        assert rows["filled", density]["points"] == rows["raw", density]["points"] > 500
    assert rows["filled", 1.0]["psnr"] > rows["filled", 0.3]["psnr"]
    with Image.open(tmp_path / "r.png") as sheet:
        assert sheet.width > 3 * 80 and sheet.height > 3 * 60


def test_the_sheet_shows_the_background_where_the_window_does(tmp_path, monkeypatch, capsys):
    """A ball on nothing is seen before the window's background, and not before colours that were filled in around it; a room is
    filled, to the last pixel."""
    monkeypatch.setattr(command, "SIZE", (160, 120))
    rng = np.random.default_rng(2)
    around = rng.normal(size=(60_000, 3))
    ball = around / np.linalg.norm(around, axis=1, keepdims=True)
    given = {"ball": (ball, np.tile(np.array([220, 90, 40], np.uint8), (len(ball), 1))), "room": room_points(60_000)}
    share = {}
    for name, (xyz, rgb) in given.items():
        scan, sheet = write_ply(tmp_path / f"{name}.ply", xyz, rgb), tmp_path / f"{name}.png"
        assert main(["evaluate", str(scan), "--views", "2", "--densities", "1", "--weights", FAST, "--plot", str(sheet)]) == 0
        picture = np.asarray(Image.open(sheet).convert("RGB"))[:60, GAP:GAP + 80].astype(int)  # the first filled picture
        share[name] = (np.abs(picture - PLAIN).max(axis=2) <= 1).mean()
        if name == "ball":
            orange = np.abs(picture - (220, 90, 40)).max(axis=2) < 60
            assert orange.mean() > 0.05 and share[name] + orange.mean() > 0.85  # but for a soft outline
    assert share["ball"] > 0.3 and share["room"] == 0.0


@pytest.mark.parametrize("form", ["potree1", "potree2", "ept"])
def test_a_folder_of_an_octree_is_a_scan(form, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "SIZE", (160, 120))
    xyz, rgb = room_points(20_000)
    write = {"potree1": write_potree1, "potree2": write_potree2, "ept": write_ept}[form]
    none = np.zeros(len(xyz))
    write(tmp_path / "tree", Points(np.rint(xyz * 4096) / 4096, rgb, none.astype(np.uint16), none.astype(np.uint8)))
    assert main(["evaluate", str(tmp_path / "tree"), "--views", "1", "--densities", "1", "--weights", FAST]) == 0
    assert "10 % of them withheld" in capsys.readouterr().out


@pytest.mark.parametrize("options, said", [
    (("{scan}", "--densities", "0"), "--densities 0"), (("{scan}", "--views", "0"), "--views 0"),
    (("{scan}", "{scan}", "--plot", "a.png"), "--plot a.png: for one scan, but 2"), (("{scan}", "{folder}"), "is a scan"),
    (("{folder}",), "no scene.json in this folder or in those in it"), (("{scan}", "missing.laz"), "missing.laz: no such file"),
    (("{scan}", "--plot", "a.svg"), "must end in .png"), (("{grey}",), "no colours"), (("{few}",), "too few"),
    (("{scan}", "--weights", "missing.safetensors"), "no such weights"), (("{folder}/missing.laz",), "no such file"),
])
def test_bad_input_is_refused_in_one_line(scan, tmp_path, capsys, options, said):
    xyz, rgb = room_points(1500)
    given = {"scan": scan, "folder": tmp_path, "grey": tmp_path / "grey.ply", "few": tmp_path / "few.ply"}
    write_ply(given["grey"], xyz, None)
    write_ply(given["few"], xyz[:500], rgb[:500])
    assert main(["evaluate", *(option.format(**given) for option in options)]) == 2
    out = capsys.readouterr()
    assert said in out.err and out.err.count("\n") == 1 and not out.out


@pytest.mark.slow
def test_several_scans_are_judged_one_after_the_other_and_options_of_rooms_ignored(scan, tmp_path, capsys):
    other = shutil.copy(scan, tmp_path / "again.ply")
    told = ["evaluate", str(scan), str(other), "--views", "1", "--densities", "1", "--weights", FAST, "--no-flicker", "--fast"]
    found = []
    for number, workers in enumerate([[], ["--workers", "2"]]):
        assert main([*told, "--json", str(tmp_path / f"{number}.json"), *workers]) == 0
        out = capsys.readouterr()
        assert out.err.count("ignores --flicker, --fast") == 1
        found.append((out.out, (tmp_path / f"{number}.json").read_bytes()))
    assert found[0] == found[1], "by two processes: the same to the byte"
    judged = json.loads(found[0][1])["scans"]
    assert [one["scan"] for one in judged] == ["room.ply", "again.ply"] and judged[0]["rows"] == judged[1]["rows"]
    assert found[0][0].count("60,000 points, 10 % of them withheld") == 2


def test_each_station_that_is_known_is_left_out_from_where_it_stood():
    rng = np.random.default_rng(1)
    station = rng.choice(4, 1000, p=[0.5, 0.3, 0.19, 0.01]).astype(np.uint8)
    places = np.array([(0, 0, 1), (3, 0, 1), (np.nan,) * 3, (5, 5, 1)], float)
    scan = MergedScan(rng.random((1000, 3)), np.zeros((1000, 3), np.uint8), station, places)
    assert (station == 3).mean() < LEAST_SHARE
    found = station_viewpoints(scan, (64, 48))
    assert [view.station for view in found] == [0] * 4 + [1] * 4
    assert np.allclose(found[4].picture.camera_to_world[:3, 3], (3, 0, 1)) and len({view.name for view in found}) == 8
    assert station_viewpoints(MergedScan(scan.xyz, scan.rgb, station, None), (64, 48)) == []
