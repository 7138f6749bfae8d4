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


@pytest.mark.parametrize(("name", "said"), [
    ("a.e57", "its length is not what its header states, and there is no room in .* for a repaired copy .*copy it again or"),
    ("a.xyz", "is UTF-16 text, and there is no room in .* for a copy in UTF-8 of about .*; set TMPDIR"),
])  # fmt: skip
def test_a_copy_that_a_reader_needs_has_no_room(tmp_path, monkeypatch, name, said):
    import tempfile

    from cloud_files import E57Scan, surface, write_e57

    from pointglass.viewer.common.errors import InputError
    from pointglass.viewer.readers.formats import open_source

    def full(**_):
        raise OSError(28, "No space left on device")

    path = tmp_path / name
    if name == "a.e57":
        write_e57(path, [E57Scan(surface(300)[0] + 1)])
        path.write_bytes(path.read_bytes() + b"x" * 700)
    else:
        path.write_bytes("1 2 3\n4 5 6\n7 8 9\n".encode("utf-16"))
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    with pytest.raises(InputError, match=said):
        list(open_source(path).chunks())
