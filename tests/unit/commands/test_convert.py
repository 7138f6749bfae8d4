"""The folder of ``convert``: links are followed, and only a grid is ever replaced."""

import json
import os
from pathlib import Path

import pytest
from cloud_files import surface, write_ply

from pointglass.viewer.cli import main
from pointglass.viewer.commands import convert as convert_module
from pointglass.viewer.commands.convert import convert, convert_each, scans_in
from pointglass.viewer.grid import cache
from pointglass.viewer.grid.open_scene import open_scene


@pytest.fixture
def scan(tmp_path):
    return write_ply(tmp_path / "floor.ply", *surface(3000))


@pytest.fixture
def no_work(monkeypatch):
    """Fails the test if building a grid begins."""
    def begun(*_, **__):
        raise AssertionError("a grid was begun")

    monkeypatch.setattr(cache, "build_into", begun)


def refused(capsys, scan: Path, out: str, said: str) -> None:
    """``--out`` is refused in one line that names it."""
    assert main(["convert", str(scan), "--out", out]) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"pointglass: {out}: ") and said in line and line.count("\n") == 1, line


def named(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("there", ["empty", "a grid", "nothing"])
def test_a_link_is_followed_and_kept(scan, tmp_path, there):
    disk, link = tmp_path / "disk" / "grid", tmp_path / "link"
    disk.parent.mkdir()
    if there == "empty":
        disk.mkdir()
    elif there == "a grid":
        convert([write_ply(tmp_path / "other.ply", *surface(500))], disk)
    link.symlink_to(os.path.relpath(disk, tmp_path), target_is_directory=True)
    assert main(["convert", str(scan), "--out", str(link)]) == 0
    assert link.is_symlink() and not disk.is_symlink()
    assert open_scene(disk).count == open_scene(link).count == 3000
    assert named(disk.parent) == ["grid"] and not list(tmp_path.glob(".*")), "something stays behind"


def test_a_link_in_a_circle_is_refused(scan, tmp_path, capsys, no_work):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    refused(capsys, scan, str(tmp_path / "a"), "leads back to itself")
    assert named(tmp_path) == ["a", "b", "floor.ply"]


@pytest.mark.parametrize("out", [".", "..", "{here}", "{above}", "{link}"])
@pytest.mark.parametrize("grid", [False, True])
def test_the_current_folder_is_never_replaced(scan, tmp_path, capsys, monkeypatch, request, out, grid):
    above, link = tmp_path / "above", tmp_path / "link"
    here = above / "here"
    if grid:
        convert([scan], above if out in ("..", "{above}") else here)
    here.mkdir(parents=True, exist_ok=True)
    link.symlink_to(here, target_is_directory=True)
    monkeypatch.chdir(here)
    request.getfixturevalue("no_work")
    refused(capsys, scan, out.format(here=here, above=above, link=link), "is the folder this runs in, or holds it; give --out")
    assert os.stat(".").st_ino == here.stat().st_ino


def test_a_folder_inside_the_current_one_is_accepted(scan, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert main(["convert", str(scan), "--out", "grid"]) == 0
    assert main(["convert", "--each", str(scan), "--out", "."]) == 0
    assert named(tmp_path / "here") == ["floor", "grid"]


def test_a_mounted_disk_is_refused_before_any_work(scan, tmp_path, capsys, monkeypatch, no_work):
    disk = tmp_path / "disk"
    disk.mkdir()
    monkeypatch.setattr(os.path, "ismount", lambda path: Path(path) == disk)
    (tmp_path / "link").symlink_to(disk, target_is_directory=True)
    for out in (disk, tmp_path / "link"):
        refused(capsys, scan, str(out), "a disk is mounted there; give --out a folder inside it")
    assert named(disk) == []


@pytest.mark.parametrize("kept", ["scan.ply", "pictures/a.png"])
def test_other_files_in_a_folder_of_a_grid_are_not_deleted(scan, tmp_path, capsys, request, kept):
    out = tmp_path / "grid"
    convert([scan], out)
    (out / kept).parent.mkdir(exist_ok=True)
    (out / kept).write_bytes(scan.read_bytes())
    request.getfixturevalue("no_work")
    refused(capsys, scan, str(out), f"holds other files ({kept.split('/')[0]})")
    assert (out / kept).is_file() and open_scene(out).count == 3000


def test_files_added_while_a_grid_is_built_are_not_deleted(scan, tmp_path, capsys, monkeypatch):
    out, build = tmp_path / "grid", convert_module.build_scene
    convert([scan], out)
    before = (out / "meta.json").stat().st_mtime_ns

    def meanwhile(*given, **options):
        (out / "thesis.txt").write_text("years")
        return build(*given, **options)

    monkeypatch.setattr(convert_module, "build_scene", meanwhile)
    refused(capsys, scan, str(out), "holds other files (thesis.txt)")
    assert (out / "thesis.txt").read_text() == "years" and (out / "meta.json").stat().st_mtime_ns == before
    assert named(tmp_path) == ["floor.ply", "grid"], "something stays behind"


def test_a_scan_given_by_two_paths_is_opened_once(tmp_path, monkeypatch):
    scan = write_ply(tmp_path / "a.ply", *surface(2000))
    (tmp_path / "link.ply").symlink_to(scan)
    monkeypatch.chdir(tmp_path)
    assert open_scene(["a.ply", scan, "./a.ply", "link.ply"], cache=False).count == 2000
    assert scans_in([Path("."), tmp_path, Path("link.ply")]) == [Path("a.ply")]
    assert [folder.name for folder in convert_each([Path("."), tmp_path / "link.ply"], tmp_path / "out")] == ["a"]


def test_the_folder_of_the_grids_of_each_scan_is_one_place(tmp_path, capsys):
    (tmp_path / "scans").mkdir()
    for number, name in enumerate("ab"):
        xyz, rgb = surface(2000 + number)
        write_ply(tmp_path / "scans" / f"{name}.ply", xyz + (number, 0, 0), rgb)
    grids = str(tmp_path / "grids")
    assert main(["convert", "--each", str(tmp_path / "scans"), "--out", grids]) == 0
    capsys.readouterr()
    assert main(["info", grids, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["points"] == 4001
    assert main(["convert", "--each", grids, "--out", str(tmp_path / "again")]) == 2
    assert "a folder made by convert is not a scan; give the scans it was made from" in capsys.readouterr().err
    write_ply(tmp_path / "grids" / "c.ply", *surface(500))  # scans beside grids are those that are meant
    assert open_scene(grids, cache=False).count == 500
