"""E57 to E57: every node and record, read back with libe57 alone."""

import pytest
from e57_files import contents, random_e57
from examples import examples

from pointglass.viewer import cli


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


@pytest.mark.parametrize("seed", range(examples(8)))
@pytest.mark.parametrize("path", ["bytes", "nodes"])
def test_every_value_of_every_record_is_copied(tmp_path, monkeypatch, seed, path):
    """path: nodes go through the writer that selections use; without one the file is copied as it is."""
    random_e57(tmp_path / "a.e57", seed)
    if path == "nodes":
        monkeypatch.setattr("pointglass.viewer.commands.exporting.targets.can_copy_file", lambda *_: False)
    export(tmp_path / "a.e57", "--out", tmp_path / "b.e57")
    a, b = contents(tmp_path / "a.e57"), contents(tmp_path / "b.e57")
    for found in (a, b):
        found.pop("/e57LibraryVersion")
    assert list(a) and a.keys() == b.keys()
    assert [key for key in a if a[key] != b[key]] == []


def test_scans_and_photographs_of_several_files_follow_each_other(tmp_path):
    for number in (1, 2):
        random_e57(tmp_path / f"{number}.e57", 40 + number, scans=2)
    export(tmp_path / "1.e57", tmp_path / "2.e57", "--out", tmp_path / "b.e57")
    a, b, both = (contents(tmp_path / f"{name}.e57") for name in ("1", "2", "b"))
    for first, found in ((0, a), (2, b)):
        for key, value in found.items():
            if key.startswith("/data3D/"):
                number, _, rest = key.removeprefix("/data3D/").partition("/")
                assert both["/".join(["/data3D", str(int(number) + first), *([rest] if rest else [])])] == value
    blobs = [[value for key, value in found.items() if key.endswith("/jpegImage")] for found in (a, b, both)]
    assert blobs[0] + blobs[1] == blobs[2] and both["/coordinateMetadata"] == a["/coordinateMetadata"]
