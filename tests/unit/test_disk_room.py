"""Room on the disk is taken before points are written to it."""

import os
import shutil

import pytest

from pointglass.viewer.grid import scratch_folder as scratch


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
