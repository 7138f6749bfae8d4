"""E57 to E57: every node and record, read back with libe57 alone."""

import laspy
import numpy as np
import pye57
import pytest
from e57_files import contents, random_e57
from examples import examples
from untyped import read_las

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


@pytest.mark.parametrize(("stored", "told"), [(257, ""), (256, "cut to 8 bits"), (1, "colours have 16 bits")])
def test_colours_of_16_bits_that_hold_8_are_written_as_8_which_pye57_reads(tmp_path, capsys, stored, told):
    rng = np.random.default_rng(stored)
    las = laspy.create(point_format=7, file_version="1.4")
    las.xyz = rng.random((300, 3)) * 10
    levels = rng.integers(0, 256 if stored > 1 else 65536, (3, 300))
    las.red, las.green, las.blue = levels * stored
    las.write(tmp_path / "a.las")
    export(tmp_path / "a.las", "--out", tmp_path / "b.e57")
    said = capsys.readouterr().err
    assert ("16 bits" in said or "16-bit" in said) == bool(told) and told in said and "ignore_unsupported_fields" in said
    if not stored > 1:
        return
    scan = pye57.E57(str(tmp_path / "b.e57")).read_scan_raw(0, ignore_unsupported_fields=True)
    assert np.array_equal([scan["colorRed"], scan["colorGreen"], scan["colorBlue"]], levels)
    export(tmp_path / "b.e57", "--out", tmp_path / "c.las")
    back = read_las(tmp_path / "c.las")
    assert np.array_equal([back.red, back.green, back.blue], levels * 257)  # equal to those of the file where it has 257
