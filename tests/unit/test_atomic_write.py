"""Files written whole or not at all, links and devices included."""

import os
import subprocess
import sys
import threading

import pytest

from model.common.atomic_write import write_atomic
from model.common.folders import made_folder


def test_an_older_file_stays_until_the_new_one_is_whole(tmp_path):
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


def test_a_link_stays_one_and_what_it_leads_to_is_written(tmp_path):
    (tmp_path / "results").mkdir()
    real, link = tmp_path / "results" / "real.json", tmp_path / "link.json"
    link.symlink_to(real)
    for text in ("first", "second"):  # at first it leads nowhere
        write_atomic(link, lambda beside, text=text: beside.write_text(text))
        assert link.is_symlink() and real.read_text() == text
    assert [path.name for path in real.parent.iterdir()] == ["real.json"]


def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    pipe, heard = tmp_path / "pipe", []
    os.mkfifo(pipe)
    listener = threading.Thread(target=lambda: heard.append(pipe.read_text()), daemon=True)
    listener.start()
    write_atomic(pipe, lambda beside: beside.write_text("figures"))
    listener.join(10.0)
    assert heard == ["figures"] and pipe.is_fifo() and list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize("to_a_file", [False, True])
def test_what_goes_to_standard_output_joins_what_is_there(tmp_path, to_a_file):
    """In a pipe and in a file that a shell opened, which is not replaced."""
    code = """
from pathlib import Path
from model.common.atomic_write import passes_through, write_atomic
print("table")
assert passes_through(Path("/dev/stdout"))
write_atomic(Path("/dev/stdout"), lambda beside: beside.write_text("figures"))
"""
    if to_a_file:
        with (tmp_path / "said").open("a") as target:
            subprocess.run([sys.executable, "-c", code], stdout=target, check=True)
        said = (tmp_path / "said").read_text()
    else:
        said = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True, text=True).stdout
    assert said == "table\nfigures" and len(list(tmp_path.iterdir())) == to_a_file


@pytest.mark.parametrize("held", [True, False])
def test_folders_made_in_vain_go_again_from_the_innermost_out(tmp_path, held):
    inner = tmp_path / "a" / "b" / "c"
    with pytest.raises(KeyboardInterrupt), made_folder(inner):
        if held:
            (tmp_path / "a" / "kept.txt").write_text("somebody's")
        raise KeyboardInterrupt
    assert sorted(tmp_path.rglob("*")) == ([tmp_path / "a", tmp_path / "a" / "kept.txt"] if held else [])
