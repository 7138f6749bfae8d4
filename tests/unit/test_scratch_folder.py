"""Scratch folders: replaced atomically; those of killed processes are removed, those of running ones are not."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pointglass.viewer.grid import scratch_folder as scratch


def new(parent: Path) -> None:
    """Makes a scratch folder, which removes abandoned ones."""
    with scratch.scratch(parent / "new") as work:
        (work / "points.npy").write_text("whole")
        scratch.move(work, parent / "new")


HOLDER = """
import sys, time
from pathlib import Path
from pointglass.viewer.grid.scratch_folder import scratch

with scratch(Path(sys.argv[1])) as work:
    (work / "points.npy").write_text("half")
    print(work, flush=True)
    time.sleep(60)
"""


def test_folders_of_killed_processes_are_removed_and_those_of_running_ones_are_not(tmp_path):
    """The process number is ignored: on another machine or in another container it means nothing."""
    ours = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path / "abc")], stdout=subprocess.PIPE, text=True)
    assert ours.stdout is not None
    made = Path(ours.stdout.readline().strip())
    elsewhere = made.with_name(".abc.0123abcd.999999999.tmp")  # a number of no process here
    made.rename(elsewhere)
    (tmp_path / ".theirs.tmp").mkdir()  # not a scratch folder
    new(tmp_path)
    assert (elsewhere / "points.npy").exists() and (tmp_path / ".theirs.tmp").exists()
    ours.kill()
    ours.wait()
    new(tmp_path)
    assert not elsewhere.exists() and (tmp_path / ".theirs.tmp").exists()


def test_without_locks_only_old_folders_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(scratch, "fcntl", None)
    old, new = tmp_path / ".abc.0123abcd.1.tmp", tmp_path / ".abc.0123abce.2.old.2.tmp"
    for folder in (old, new):
        folder.mkdir()
        (folder / "points.npy").write_text("half")
    for path in (old, old / "points.npy"):
        os.utime(path, (0, 0))
    scratch.sweep(tmp_path)
    assert not old.exists() and new.exists()
    os.utime(new, (0, 0))
    scratch.sweep(tmp_path)
    assert new.exists(), "a file in it was written just now"


def test_a_folder_is_replaced_atomically_or_kept(tmp_path, monkeypatch):
    new(tmp_path)
    with pytest.raises(OSError, match="no room"), scratch.scratch(tmp_path / "new") as work:
        (work / "points.npy").write_text("newer")
        rename = Path.rename

        def fails(path, target):
            if path == work:
                raise OSError(28, "no room")
            return rename(path, target)

        monkeypatch.setattr(Path, "rename", fails)
        scratch.move(work, tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["new"]
    assert (tmp_path / "new" / "points.npy").read_text() == "whole"
    monkeypatch.undo()
    new(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


@pytest.mark.parametrize("error", [OSError(24, "Too many open files"), PermissionError(13, "denied")])
def test_errors_of_locking_are_reported_and_leave_nothing_behind(tmp_path, monkeypatch, error):
    def fails(_):
        raise error

    monkeypatch.setattr(scratch, "_lock", fails)
    with pytest.raises(OSError, match=error.strerror):
        new(tmp_path)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(scratch, "_lock", lambda folder: folder.rmdir())
    with pytest.raises(OSError, match="removed by another process"):
        new(tmp_path)


def test_some_of_the_disk_stays_free(tmp_path, monkeypatch):
    size, usage = 5000, shutil.disk_usage(tmp_path)
    with (tmp_path / "points").open("w+b") as file:
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=size + (64 << 20) - 1))
        with pytest.raises(OSError, match="no space left"):
            scratch.reserve(file.fileno(), size, tmp_path)
        assert os.fstat(file.fileno()).st_size == 0
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=size + (64 << 20)))
        scratch.reserve(file.fileno(), size, tmp_path)
        assert os.fstat(file.fileno()).st_size == size
