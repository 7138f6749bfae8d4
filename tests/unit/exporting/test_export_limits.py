"""A disk that becomes full while an export is written, and little memory: one line, exit code 2, nothing left behind."""

import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cloud_files import write_las

from pointglass.viewer import cli

ROOT = Path(__file__).resolve().parents[3]
MEMORY = 1 << 30
"""Bytes of address space."""


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """100,000 points whose colours do not compress: more than 512 KB in each format."""
    rng, path = np.random.default_rng(1), tmp_path_factory.mktemp("scan") / "a.laz"
    write_las(path, rng.random((100_000, 3)) * 10, rng.integers(0, 65536, (100_000, 3)).astype(np.uint16))
    return path


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("disk")
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(folder)], capture_output=True, text=True)
    if made.returncode:
        pytest.skip(f"a small disk cannot be mounted here: {made.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def export(scan, out, cache, *options, memory=0):
    """Runs the command in a process of its own."""

    def limited():
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    line = [sys.executable, "-m", "pointglass.viewer", "export", str(scan), "--out", str(out), *options]
    return subprocess.run(line, cwd=ROOT, env=os.environ | {"POINTGLASS_CACHE": str(cache)}, capture_output=True, text=True,
                          timeout=120, preexec_fn=limited)  # fmt: skip


def messages(done):
    """Lines of standard error without progress."""
    return [line for line in done.stderr.splitlines() if not re.search(r": [\d,.]+ ?\S*( of |, |/)", line)]


@pytest.mark.parametrize("ending", ["laz", "e57", "ply"])
def test_a_disk_that_becomes_full_is_one_line(scan, small_disk, tmp_path_factory, ending):
    """With a clip the size is not known before."""
    cache = tmp_path_factory.getbasetemp() / "limits"
    done = export(scan, small_disk / f"a.{ending}", cache, "--clip=-1,-1,-1,11,11,11")
    assert done.returncode == 2 and len(messages(done)) == 1, done.stderr
    assert re.search("make room|no space left", messages(done)[0], re.IGNORECASE)
    assert not list(small_disk.iterdir())


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_a_disk_that_becomes_full_while_columns_are_written_is_one_line(scan, small_disk, monkeypatch, capsys, ending):
    monkeypatch.setattr("pointglass.viewer.commands.exporting.targets.can_copy_las", lambda _: False)
    box = "--clip=-1,-1,-1,11,11,11"
    assert cli.main(["export", "--no-cache", str(scan), box, "--out", str(small_disk / f"a.{ending}")]) == 2
    told = capsys.readouterr().err
    assert "no space left" in told.lower() and told.count("pointglass: ") == 1 and not list(small_disk.iterdir())


@pytest.mark.parametrize("ending", ["laz", "e57", "ply"])
def test_little_memory_is_one_line_or_a_whole_file(scan, tmp_path, tmp_path_factory, ending):
    cache = tmp_path_factory.getbasetemp() / "limits"  # with the grid
    done = export(scan, tmp_path / f"a.{ending}", cache, "--clip=-1,-1,-1,11,11,11", memory=MEMORY)
    left = [path.name for path in tmp_path.iterdir()]
    if done.returncode == 0:
        assert left == [f"a.{ending}"] and "100,000 points" in done.stdout
    else:
        assert done.returncode == 2 and len(messages(done)) == 1 and "not enough memory" in messages(done)[0], done.stderr
        assert not left and "damaged" not in done.stderr
