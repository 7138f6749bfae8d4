"""``render --resume``: what is complete and the same stays, everything else is rendered again, to the byte."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from clouds import room

import pointglass
from pointglass.viewer.cli import main
from pointglass.viewer.grid.scene import unpack

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from cloud_files import write_ply

pytestmark = pytest.mark.gl
NAMES = ("same", "torn", "flipped", "missing", "other", "mask")


@pytest.fixture
def scan(tmp_path):
    """A scan and six cameras; returns the arguments of a command that renders them into ``out``."""
    write_ply(tmp_path / "room.ply", *unpack(room(3, 20_000))[:2])
    os.utime(tmp_path / "room.ply", (1e9, 1e9))
    cameras = [pointglass.look_at((4, 3, 1.5), (1, 2 + 0.1 * n, 1), size=(64, 48), name=name) for n, name in enumerate(NAMES)]
    pointglass.write_cameras(tmp_path / "cameras.json", cameras)
    return ["render", str(tmp_path / "room.ply"), "--cameras", str(tmp_path / "cameras.json"), "--out", str(tmp_path / "out"),
            "--view", "filled", "--aux"]


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".json"}  # times differ


def test_only_what_is_whole_and_the_same_is_left_out(scan, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(scan) == 0
    first = files(out)
    assert len(first) == 4 * len(NAMES)

    torn, flipped = out / "torn.png", out / "flipped.png"
    torn.write_bytes(first["torn.png"][:-20])
    damaged = bytearray(first["flipped.png"])
    damaged[-60] ^= 1  # in the pixels
    flipped.write_bytes(damaged)
    (out / "missing.png").unlink()
    np.save(out / "mask.mask.npy", np.zeros((3, 3), bool))
    cameras = json.loads((tmp_path / "cameras.json").read_text())
    cameras["frames"] = [frame for frame in cameras["frames"] if "other" in frame["file_path"]]
    (tmp_path / "one.json").write_text(json.dumps(cameras))
    other = [str(tmp_path / "one.json") if part.endswith("cameras.json") else part for part in scan]
    assert main([*other, "--filter-strength", "0.5"]) == 0
    assert files(out)["other.png"] != first["other.png"]

    before = {path.name: path.stat().st_mtime_ns for path in out.iterdir()}
    capsys.readouterr()
    assert main([*scan, "--resume"]) == 0
    said = capsys.readouterr()
    assert said.out == f"6 pictures in {out} (1 picture already there)\n"
    assert said.err == f"pointglass: replaces {torn} and 23 other files\n", "all of four cameras, and the rest of missing.png's"
    assert files(out) == first
    kept = {path.name for path in out.iterdir() if path.stat().st_mtime_ns == before.get(path.name)}
    assert kept == {f"same.{ending}" for ending in ("png", "depth.npy", "mask.npy", "provenance.png", "stats.json")}

    assert main([*scan, "--resume"]) == 0
    said = capsys.readouterr()
    assert "(6 pictures already there)" in said.out and said.err == ""


def test_frames_of_a_film_and_pictures_of_the_demo_can_be_drawn_again(scan, tmp_path, capsys):
    """And what cannot be says in one line what it shows."""
    room, cameras = scan[1], scan[3]
    film = ["video", room, "--path", cameras, "--view", "filled", "--background", "gradient"]
    assert main([*film, "--out", str(tmp_path / "film")]) == 0
    frames = sorted((tmp_path / "film").glob("*.png"))
    assert main(["render", room, "--like", str(frames[2]), "--out", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again" / frames[2].name).read_bytes() == frames[2].read_bytes()
    whole = {frame.name: frame.read_bytes() for frame in frames}
    frames[1].write_bytes(whole[frames[1].name][:-30])
    capsys.readouterr()
    assert main([*film, "--out", str(tmp_path / "film"), "--resume"]) == 0
    assert capsys.readouterr().err == f"pointglass: replaces {frames[1]}\n"
    assert {frame.name: frame.read_bytes() for frame in frames} == whole

    for said_before in ("", f"pointglass: replaces {tmp_path / 'film.mp4'}\n"):
        assert main([*film, "--out", str(tmp_path / "film.mp4")]) == 0
        assert capsys.readouterr().err == said_before

    assert main([*film, "--out", str(tmp_path / "round"), "--panorama", "--size", "64x32"]) == 0
    assert main([*film, "--out", str(tmp_path / "fine"), "--supersample", "2"]) == 0
    assert main(scan) == 0
    shown = {tmp_path / "round" / frames[0].name: "a panorama", tmp_path / "fine" / frames[0].name: "averaged",
             tmp_path / "out" / "same.provenance.png": "provenance"}  # fmt: skip
    for file, words in shown.items():
        capsys.readouterr()
        assert main(["render", room, "--like", str(file), "--out", str(tmp_path / "no")]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"pointglass: {file}: shows ") and words in said and said.count("\n") == 1


def test_a_scan_that_has_changed_is_rendered_again(scan, tmp_path, capsys):
    assert main(scan) == 0
    os.utime(tmp_path / "room.ply", (4e9, 4e9))  # the same file name and number of points
    capsys.readouterr()
    assert main([*scan, "--resume"]) == 0
    assert "already" not in capsys.readouterr().out
