"""What an export cannot keep is named in its one line; what it can keep beside the points is kept."""

from typing import Any

import laspy
import numpy as np
import pytest
from e57_files import Writer, contents
from laspy.vlrs.vlrlist import VLRList

import pointglass
from pointglass.viewer import cli
from pointglass.viewer.readers.e57.e57_nodes import library

e57 = library()


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


def las(path, point_format, vlrs, evlrs=()):
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales = np.full(3, 0.001)
    header.vlrs.extend(laspy.VLR(*vlr) for vlr in vlrs)
    made = laspy.LasData(header)
    made.x, made.y, made.z = np.random.default_rng(point_format).random((3, 50))
    made.evlrs = VLRList([laspy.VLR(*vlr) for vlr in evlrs])
    made.write(str(path))


def scan(writer, guid, xyz, far, colour=100):
    """A scan with groups and bounds; ``far`` is added to its coordinates."""
    whole = {"startPointIndex": (e57.IntegerNode(writer.image, 0, 0, 1), np.zeros(1, np.longlong))}
    bounds = {"rangeMinimum": 0.0, "rangeMaximum": 99.0, "elevationMinimum": -1.5, "elevationMaximum": 1.5,
              "azimuthStart": -3.0, "azimuthEnd": 3.0}  # fmt: skip
    node = writer.node({"guid": guid, "sphericalBounds": bounds, "pointGroupingSchemes": {
        "groupingByLine": {"idElementName": "columnIndex"}}})  # fmt: skip
    groups = writer.vector(node["pointGroupingSchemes"]["groupingByLine"], "groups", whole)
    rgb = np.random.default_rng(1).integers(0, colour + 1, (3, len(xyz))).astype(np.longlong)
    fields = {f"cartesian{axis}": (e57.FloatNode(writer.image, 0.0), values + far) for axis, values in zip("XYZ", xyz.T.copy())}
    fields |= {f"color{name}": (e57.IntegerNode(writer.image, 0, 0, colour), values)
               for name, values in zip(("Red", "Green", "Blue"), rgb, strict=True)}  # fmt: skip
    points = writer.vector(node, "points", fields)
    return node, [(groups, whole), (points, fields)]


def test_a_clip_of_e57_names_groups_scans_and_photographs_and_counts_its_bounds(tmp_path, capsys):
    xyz = np.random.default_rng(2).random((400, 3)) * 10 + 1
    writer = Writer(tmp_path / "a.e57")
    root = writer.image.root()
    scans, filling = e57.VectorNode(writer.image, True), []
    for name, value in {"formatName": "ASTM E57 3D Imaging Data File", "guid": "{f}", "versionMajor": 1, "versionMinor": 0,
                        "data3D": scans}.items():  # fmt: skip
        root.set(name, writer.node(value))
    for guid, far in (("{near}", 0.0), ("{far}", 100.0)):
        node, more = scan(writer, guid, xyz, far)
        scans.append(node)
        filling += more
    root.set("images2D", writer.node([{"guid": "{p}", "associatedData3DGuid": guid} for guid in ("{near}", "{far}", "{far}")]))
    for points, fields in filling:
        writer.fill(points, fields)
    writer.image.close()
    export(tmp_path / "a.e57", "--clip", "0,0,0,5,6,7", "--out", tmp_path / "b.e57")
    told, found = capsys.readouterr().err, contents(tmp_path / "b.e57")
    for words in ("1 scan without a selected record is left out", "2 photographs of scans without", "pointGroupingSchemes"):
        assert words in told
    assert told.count("\n") == 1
    kept = xyz[(xyz <= (5, 6, 7)).all(axis=1)]
    ranges, azimuths = np.linalg.norm(kept, axis=1), np.arctan2(kept[:, 1], kept[:, 0])
    expected = {"rangeMinimum": ranges.min(), "rangeMaximum": ranges.max(), "azimuthStart": azimuths.min(),
                "azimuthEnd": azimuths.max()}  # fmt: skip
    for name, value in expected.items():
        assert found[f"/data3D/0/sphericalBounds/{name}"][1] == pytest.approx(value)
    export(tmp_path / "a.e57", "--out", tmp_path / "c.las")
    told = capsys.readouterr().err
    assert "3 photographs are left out" in told and "pointGroupingSchemes" in told and told.count("\n") == 1


def test_joined_las_of_different_layouts_keep_records_that_do_not_collide_and_name_the_others(tmp_path, capsys):
    las(tmp_path / "a.las", 6, [("maker", 1, "one", b"alpha"), ("maker", 2, "two", b"beta")])
    las(tmp_path / "b.las", 7, [("maker", 1, "one", b"other"), ("maker", 2, "two", b"beta"), ("maker", 3, "three", b"gamma")],
        [("maker", 4, "four", b"delta"), ("maker", 5, "five", bytes(70_000))])  # fmt: skip
    export(tmp_path / "a.las", tmp_path / "b.las", "--out", tmp_path / "c.las")
    told = capsys.readouterr().err
    read: Any = laspy.read(tmp_path / "c.las")
    assert len(read) == 100 and told.count("\n") == 1
    kept = {vlr.record_id: (vlr.record_data, vlr.description) for vlr in read.header.vlrs if vlr.user_id == "maker"}
    assert kept == {1: (b"alpha", "one"), 2: (b"beta", "two"), 3: (b"gamma", "three"), 4: (b"delta", "four")}
    assert "records maker 1 of later files differ" in told and "maker 5 are larger than 65535 bytes and left out" in told
    export(tmp_path / "b.las", "--out", tmp_path / "c.ply")
    assert "records maker 1, maker 2, maker 3, maker 4, maker 5 are left out" in capsys.readouterr().err


def test_whole_numbers_that_e57_cannot_hold_are_rounded_and_named(tmp_path, capfd):
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.add_extra_dim(laspy.ExtraBytesParams("ticks", np.dtype(np.uint64)))
    made = laspy.LasData(header)
    made.x, made.y, made.z = np.arange(12.0).reshape(3, 4)
    made.ticks = np.array([0, 5, 2**63, 2**64 - 1], np.uint64)
    made.write(tmp_path / "a.las")
    export(tmp_path / "a.las", "--out", tmp_path / "a.e57")
    assert "ticks is rounded to doubles" in capfd.readouterr().err
    with pointglass.open(tmp_path / "a.e57", cache=False) as scan:
        np.testing.assert_array_equal(scan.points[:]["ticks"], [0.0, 5.0, 2.0**63, 2.0**64])
