"""Atomic writes, to links and devices as well."""

import os
import subprocess
import sys
import threading

import pytest

from pointglass.model.common.files.atomic_write import write_atomic
from pointglass.model.common.files.folders import made_folder


def test_an_existing_file_stays_until_the_new_one_is_complete(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")

    def fails(beside):
        beside.write_text("ha")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomic(path, fails)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    write_atomic(path, lambda beside: beside.write_text("new"))
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_a_link_stays_a_link_and_its_target_is_written(tmp_path):
    (tmp_path / "results").mkdir()
    real, link = tmp_path / "results" / "real.json", tmp_path / "link.json"
    link.symlink_to(real)
    for text in ("first", "second"):  # at first its target does not exist
        write_atomic(link, lambda beside, text=text: beside.write_text(text))
        assert link.is_symlink() and real.read_text() == text
    assert [path.name for path in real.parent.iterdir()] == ["real.json"]


def test_a_pipe_is_written_directly(tmp_path):
    pipe, heard = tmp_path / "pipe", []
    os.mkfifo(pipe)
    listener = threading.Thread(target=lambda: heard.append(pipe.read_text()), daemon=True)
    listener.start()
    write_atomic(pipe, lambda beside: beside.write_text("figures"))
    listener.join(10.0)
    assert heard == ["figures"] and pipe.is_fifo() and list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize("to_a_file", [False, True])
def test_standard_output_is_appended_to(tmp_path, to_a_file):
    """To a pipe, and to a file that a shell opened, which is not replaced."""
    code = """
from pathlib import Path
from pointglass.model.common.files.atomic_write import passes_through, write_atomic
print("table")
assert passes_through(Path("/dev/stdout"))
write_atomic(Path("/dev/stdout"), lambda beside: beside.write_text("figures"))
"""
    if to_a_file:
        with (tmp_path / "message").open("a") as target:
            subprocess.run([sys.executable, "-c", code], stdout=target, check=True)
        message = (tmp_path / "message").read_text()
    else:
        message = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True, text=True).stdout
    assert message == "table\nfigures" and len(list(tmp_path.iterdir())) == to_a_file


@pytest.mark.parametrize("held", [True, False])
def test_empty_new_folders_are_removed_from_the_innermost_outwards(tmp_path, held):
    inner = tmp_path / "a" / "b" / "c"
    with pytest.raises(KeyboardInterrupt), made_folder(inner):
        if held:
            (tmp_path / "a" / "kept.txt").write_text("somebody's")
        raise KeyboardInterrupt
    assert sorted(tmp_path.rglob("*")) == ([tmp_path / "a", tmp_path / "a" / "kept.txt"] if held else [])
