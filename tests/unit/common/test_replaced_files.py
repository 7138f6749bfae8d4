"""Every command says in one line on standard error which files it replaces; standard output stays as it is."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cloud_files import write_ply

from pointglass.model.synth import demo
from pointglass.viewer import cli
from pointglass.viewer.commands.render_pictures import picture_files
from pointglass.viewer.common.replaced_files import replaced_told
from pointglass.viewer.picture.camera import from_fov


@pytest.fixture
def scan(tmp_path):
    rng = np.random.default_rng(0)
    return write_ply(tmp_path / "room.ply", rng.random((3000, 3)) * 4, rng.integers(0, 256, (3000, 3), np.uint8))


COMMANDS = {
    "export": ["export", "SCAN", "--out", "OUT/new.laz"],
    "section": ["section", "SCAN", "--plan", "1.5", "--out", "OUT/plan.png"],
    "convert": ["convert", "SCAN", "--out", "OUT/grid"],
    "simulate": ["simulate", "--points", "20000", "--out", "OUT/made.laz"],
}
"""Command lines that write; SCAN and OUT stand for paths."""


@pytest.mark.parametrize("name", COMMANDS)
def test_what_a_command_replaces_is_said_the_second_time_only(name, scan, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(demo, "Place", partial(demo.Place, probe_rays=0))  # indirect light takes seconds
    words = [word.replace("SCAN", str(scan)).replace("OUT", str(tmp_path)) for word in COMMANDS[name]]
    assert cli.main(words) == 0
    first = capsys.readouterr()
    assert ": replaces " not in first.err and "replaced" not in first.out
    assert cli.main(words) == 0
    second = capsys.readouterr()
    assert second.out == first.out
    more = " and 1 other file" if name == "simulate" else ""
    assert [line for line in second.err.splitlines() if ": replaces " in line] == [f"pointglass: replaces {words[-1]}{more}"]


@pytest.mark.parametrize(("words", "files"), [
    (["evaluate", "ROOM", "--json", "OUT/f.json", "--plot", "OUT/p.png", "--worst", "OUT/w.png"], ("f.json", "p.png", "w.png")),
    (["bench", "frame", "--json", "OUT/f.json", "--plot", "OUT/p.png"], ("f.json", "p.png")),
])  # fmt: skip
def test_files_of_figures_and_plots_are_named(words, files, tmp_path, capsys, monkeypatch):
    """The long work is left out: the command only writes its files."""
    def work(options):
        for file in files:
            (tmp_path / "beside").write_text("figures")
            (tmp_path / "beside").replace(tmp_path / file)
        return 0

    monkeypatch.setitem(cli._RUN, words[0], work)
    words = [word.replace("OUT", str(tmp_path)).replace("ROOM", str(tmp_path)) for word in words]
    assert cli.main(words) == 0 and capsys.readouterr().err == ""
    assert cli.main(words) == 0
    others = {2: "1 other file", 3: "2 other files"}[len(files)]
    assert capsys.readouterr().err == f"pointglass: replaces {tmp_path / files[0]} and {others}\n"


def test_a_file_that_a_failure_leaves_alone_is_not_named(scan, tmp_path, capsys):
    (tmp_path / "new.laz").write_bytes(b"mine")
    assert cli.main(["export", str(tmp_path / "gone.ply"), "--out", str(tmp_path / "new.laz")]) == 2
    assert "replaces" not in capsys.readouterr().err and (tmp_path / "new.laz").read_bytes() == b"mine"
    before = scan.read_bytes()
    assert cli.main(["export", str(scan), "--out", str(scan)]) == 2
    assert "replaces" not in capsys.readouterr().err and scan.read_bytes() == before


def test_what_was_replaced_before_a_failure_is_named(tmp_path, capsys):
    paths = [tmp_path / name for name in ("a", "b")]
    for path in paths:
        path.write_text("old")
    with pytest.raises(KeyError), replaced_told(paths):
        (tmp_path / "new").write_text("new")
        (tmp_path / "new").replace(paths[1])
        raise KeyError
    assert capsys.readouterr().err == f"pointglass: replaces {paths[1]}\n"


def test_devices_and_new_files_are_not_named(tmp_path, capsys):
    with replaced_told([Path("/dev/null"), tmp_path / "new"]):
        (tmp_path / "new").write_text("new")
        Path("/dev/null").write_text("new")
    assert capsys.readouterr().err == ""


def test_files_of_pictures_with_everything_beside():
    camera = from_fov(8, 8, 60.0, np.eye(4), "a")
    assert [path.name for path in picture_files(Path("out"), [camera], aux=True)] == [
        "a.png", "a.depth.npy", "a.mask.npy", "a.provenance.png", "a.stats.json"]
