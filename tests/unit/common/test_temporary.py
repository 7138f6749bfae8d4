"""Temporary files and folders: exclusive, with the rights of their sources; those of killed processes are removed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pointglass.model.common import system
from pointglass.model.common.files import temporary
from pointglass.model.common.files.atomic_write import write_atomic
from pointglass.model.common.files.state_folder import state_dir
from pointglass.viewer.grid.scratch_folder import move, scratch

HOLDER = """
import sys, time
from pathlib import Path
from pointglass.model.common.files.temporary import temporary_file, temporary_folder

with temporary_folder(Path(sys.argv[1]) / "abc") as folder, temporary_file(Path(sys.argv[1]) / "abc.laz") as file:
    (folder / "points.npy").write_text("half")
    file.write_text("half")
    print(folder, file, sep="\\n", flush=True)
    time.sleep(60)
"""

RESERVER = """
import sys, time
from pathlib import Path
from pointglass.model.common.files.temporary import reserved

folder = Path(sys.argv[1])
with reserved([folder / "empty.png"]) as empty, reserved([folder / "full.png"]) as full:
    full.write_text("a picture")
    print("reserved", flush=True)
    time.sleep(60)
"""


def _new(parent: Path) -> None:
    with scratch(parent / "new") as work:
        (work / "points.npy").write_text("whole")
        move(work, parent / "new")


def _mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


@pytest.mark.parametrize("by", ["folder", "record"])
def test_what_killed_processes_left_is_removed_and_what_running_ones_use_is_not(tmp_path, by):
    """The process number is ignored: on another machine or in another container it means nothing."""
    ours = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert ours.stdout is not None
    left = [Path(ours.stdout.readline().strip()) for _ in range(2)]
    (tmp_path / ".theirs.tmp").mkdir()  # not one of ours
    sweep = temporary.sweep_recorded if by == "record" else lambda: temporary.sweep(tmp_path)
    sweep()
    assert all(path.exists() for path in left)
    ours.kill()
    ours.wait()
    sweep()
    assert [path.name for path in tmp_path.iterdir()] == [".theirs.tmp"]
    temporary.sweep_recorded()
    assert not list((state_dir() / "unfinished").iterdir())


def test_a_name_that_a_killed_process_had_reserved_is_free_again_and_its_picture_stays(tmp_path):
    holder = subprocess.Popen([sys.executable, "-c", RESERVER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None and holder.stdout.readline().strip() == "reserved"
    mine = tmp_path / "mine.png"
    mine.touch()  # empty, and nobody's
    temporary.sweep_recorded()
    assert (tmp_path / "empty.png").exists(), "in use"
    holder.kill()
    holder.wait()
    temporary.sweep_recorded()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["full.png", "mine.png"]
    assert not list((state_dir() / "unfinished").iterdir())


def test_files_of_earlier_versions_are_removed(tmp_path):
    for name in (".house.laz.4242.partial", ".abc.0123abcd.1.tmp", ".abc.0123abcd.1.old.1.tmp"):
        (tmp_path / name).write_text("half")
    (tmp_path / ".house.partial").write_text("somebody's")
    temporary.sweep(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [".house.partial"]


def test_without_locks_only_old_ones_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(system, "fcntl", None)
    old, new = tmp_path / ".abc.0123abcd.1.tmp", tmp_path / ".abc.0123456789abcdef.2.partial"
    for folder in (old, new):
        folder.mkdir()
        (folder / "points.npy").write_text("half")
    for path in (old, old / "points.npy"):
        os.utime(path, (0, 0))
    temporary.sweep(tmp_path)
    assert not old.exists() and new.exists()
    os.utime(new, (0, 0))
    temporary.sweep(tmp_path)
    assert new.exists(), "a file in it was written just now"


def test_a_folder_is_replaced_atomically_or_kept(tmp_path, monkeypatch):
    _new(tmp_path)
    with pytest.raises(OSError, match="no room"), scratch(tmp_path / "new") as work:
        (work / "points.npy").write_text("newer")
        rename = Path.replace

        def fails(path, target):
            if path == work:
                raise OSError(28, "no room")
            return rename(path, target)

        monkeypatch.setattr(Path, "replace", fails)
        move(work, tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    assert (tmp_path / "new" / "points.npy").read_text() == "whole"
    monkeypatch.undo()
    _new(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


@pytest.mark.parametrize("error", [OSError(24, "Too many open files"), PermissionError(13, "denied")])
def test_errors_of_locking_are_reported_and_leave_nothing_behind(tmp_path, monkeypatch, error):
    def fails(_):
        raise error

    monkeypatch.setattr(temporary, "locked", fails)
    with pytest.raises(OSError, match=error.strerror):
        _new(tmp_path)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(temporary, "locked", lambda folder: folder.rmdir())
    with pytest.raises(OSError, match="removed by another process"):
        _new(tmp_path)


@pytest.mark.parametrize("moment", ["restrict", "locked"])
def test_one_that_another_process_sweeps_before_it_is_locked_is_made_again(tmp_path, monkeypatch, moment):
    """Workers that start together sweep the folder in which others just begin."""
    (source := tmp_path / "a.laz").touch()
    real, times = getattr(temporary, moment), []

    def swept(path, *rest):
        if not times:
            path.rmdir()
        times.append(path)
        return real(path, *rest)

    monkeypatch.setattr(temporary, moment, swept)
    with temporary.temporary_folder(tmp_path / "grid", sources=[source]) as folder:
        assert folder.is_dir() and len(set(times)) == 2
    with pytest.raises(FileNotFoundError), temporary.temporary_folder(tmp_path / "grid", sources=[tmp_path / "gone"]):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.laz"]


def test_a_link_or_file_that_lies_there_is_never_written_to(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    monkeypatch.setattr(temporary, "_name", lambda target: f".{target.name}.0123456789abcdef.1.partial")
    (tmp_path / ".a.txt.0123456789abcdef.1.partial").symlink_to(victim)
    with pytest.raises(FileExistsError):
        write_atomic(tmp_path / "a.txt", lambda beside: beside.write_text("new"))
    assert victim.read_text() == "precious" and not (tmp_path / "a.txt").exists()


@pytest.mark.parametrize(("mode", "expected"), [(0o600, 0), (0o640, 0o040), (0o604, 0o004), (0o644, 0o044)])
def test_what_is_written_has_no_more_rights_than_its_sources(tmp_path, mode, expected):
    source, out = tmp_path / "scan.laz", tmp_path / "out.laz"
    source.write_text("points")
    source.chmod(mode)
    before = os.umask(0o022)
    try:
        inside: list[int] = []

        def write(beside: Path) -> None:
            inside.append(_mode(beside))
            beside.write_text("points")

        write_atomic(out, write, sources=[source])
        with scratch(tmp_path / "grid", sources=[source]) as work:
            inside.append(_mode(work) & 0o044)
            (work / "points.npy").write_text("points")
            temporary.restrict(work, [source])
            move(work, tmp_path / "grid")
    finally:
        os.umask(before)
    made = [_mode(out), *inside, _mode(tmp_path / "grid"), _mode(tmp_path / "grid" / "points.npy")]
    assert [each & 0o044 for each in made] == [expected] * 5


def test_a_file_that_is_replaced_keeps_its_rights(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")
    path.chmod(0o600)
    write_atomic(path, lambda beside: beside.write_text("new"))
    assert path.read_text() == "new" and _mode(path) == 0o600


def test_the_cache_of_a_private_scan_is_private(tmp_path, monkeypatch):
    from pointglass.viewer.grid.open_scene import open_scene

    scan, cache = tmp_path / "scan.xyz", tmp_path / "cache"
    scan.write_text("".join(f"{i % 7} {i % 11} {i % 13} 9 9 9\n" for i in range(500)))
    scan.chmod(0o600)
    monkeypatch.setenv("POINTGLASS_CACHE", str(cache))
    open_scene(scan)
    assert all(not _mode(path) & 0o077 for path in (cache, *cache.rglob("*"))) and len(list(cache.rglob("*.npy"))) > 2


def test_long_names_and_odd_endings(tmp_path):
    for name in ("x" * 250 + ".laz", "ä" * 120, "a." + "b" * 200):
        write_atomic(tmp_path / name, lambda beside: beside.write_text("new"))
        assert (tmp_path / name).read_text() == "new"
    with temporary.temporary_file(tmp_path / "house.laz") as beside:
        assert beside.suffix == ".laz" and temporary.OURS.match(beside.name)
