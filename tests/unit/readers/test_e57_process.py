"""Large E57 files are decoded by a process of their own: the same chunks, and nothing left of it."""

import os
import signal

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57

from pointglass.model.common.system import child_processes
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.e57 import e57_source
from pointglass.viewer.readers.formats import open_source


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """A file of two scans, of blocks of 4,000 points."""
    monkeypatch.setattr(e57_source, "BLOCK", 4_000)
    monkeypatch.setattr(e57_source, "APART", 0)
    xyz, rgb = surface(30_000)
    return write_e57(tmp_path / "rooms.e57", [E57Scan(xyz[:17_000], rgb[:17_000]), E57Scan(xyz[17_000:], None)])


def content(chunk):
    arrays = (chunk.xyz, chunk.rgb, chunk.intensity)
    return [None if array is None else (array.dtype, array.tobytes()) for array in arrays], chunk.scan, chunk.invalid


def test_chunks_are_those_of_this_process(scans, monkeypatch):
    before = child_processes()
    apart = [content(chunk) for chunk in open_source(scans).chunks()]
    assert child_processes() <= before
    monkeypatch.setattr(e57_source, "APART", 1 << 40)
    assert apart == [content(chunk) for chunk in open_source(scans).chunks()]
    assert len(apart) == 9  # more blocks than are in memory at a time, and the second scan begins in the other one


def test_a_process_that_is_killed_is_an_error_of_the_file(scans):
    before, chunks = child_processes(), open_source(scans).chunks()
    next(chunks)
    (process,) = child_processes() - before
    os.kill(process, signal.SIGKILL)
    with pytest.raises(InputError, match="process that decodes it has ended") as error:
        list(chunks)
    assert str(scans) in str(error.value) and "\n" not in str(error.value)
    assert child_processes() <= before


def test_nothing_is_left_where_no_more_is_wanted(scans):
    before, chunks = child_processes(), open_source(scans).chunks()
    assert np.isfinite(next(chunks).xyz).all()
    chunks.close()
    assert child_processes() <= before


def test_a_file_truncated_while_it_is_read_is_refused(scans):
    chunks = open_source(scans).chunks()
    next(chunks)
    os.truncate(scans, 2_000)
    with pytest.raises(InputError, match="again") as error:
        list(chunks)
    assert str(scans) in str(error.value) and "\n" not in str(error.value)
