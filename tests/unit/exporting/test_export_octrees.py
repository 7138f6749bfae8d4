"""Octrees to LAS: further attributes keep names and values.  Matched exposures in an E57 that declares narrow ranges."""

import json
from typing import Any

import laspy
import numpy as np
import pytest
from e57_files import Writer
from format_files import some, write_ept, write_potree1, write_potree2

from pointglass.viewer import cli
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.readers.e57.e57_nodes import library, open_e57

e57 = library()
MORE = [("gps-time", "double", "<f8"), ("return number", "uint8", "u1"), ("quality", "int16", "<i2")]


def more_of(points):
    """Further values that follow from the intensity, which tells the points apart."""
    number = points.intensity.astype(np.float64)
    return {"gps-time": 3e8 + number / 1000, "return number": points.intensity % 5 + 1,
            "quality": points.intensity.astype(np.int32) - 32768}  # fmt: skip


def unique(points):
    points.intensity[:] = np.random.default_rng(1).permutation(65536)[: len(points.xyz)]
    return points


def with_more(folder, points):
    """Adds attributes to a Potree 2 folder without compression."""
    meta = json.loads((folder / "metadata.json").read_text())
    old = np.dtype([("xyz", "<i4", 3), ("i", "<u2"), ("c", "u1"), ("rgb", "<u2", 3)])
    table = np.frombuffer((folder / "octree.bin").read_bytes(), old)
    wide = np.zeros(len(table), np.dtype([*old.descr, *((name, kind) for name, _, kind in MORE)]))
    for name in old.names or ():
        wide[name] = table[name]
    order = np.argsort(points.intensity)[np.searchsorted(np.sort(points.intensity), table["i"])]
    for name, values in more_of(points).items():
        wide[name] = values[order]
    (folder / "octree.bin").write_bytes(wide.tobytes())
    nodes = np.frombuffer((folder / "hierarchy.bin").read_bytes(), [("kind", "u1"), ("mask", "u1"), ("n", "<u4"), ("at", "<i8"),
                                                                    ("length", "<i8")]).copy()  # fmt: skip
    told = nodes["kind"] != 2  # the others state places in the hierarchy
    nodes["at"][told] = nodes["at"][told] // old.itemsize * wide.itemsize
    nodes["length"][told] = nodes["length"][told] // old.itemsize * wide.itemsize
    (folder / "hierarchy.bin").write_bytes(nodes.tobytes())
    meta["attributes"] += [{"name": name, "type": kind, "numElements": 1} for name, kind, _ in MORE]
    (folder / "metadata.json").write_text(json.dumps(meta))


def exported(path, out):
    assert cli.main(["export", "--no-cache", str(path), "--out", str(out)]) == 0
    return laspy.read(out)


def order_of(las: Any, points):
    """(n,) the record of each point."""
    found = np.argsort(las.intensity)
    rows = found[np.searchsorted(np.asarray(las.intensity)[found], points.intensity)]
    assert np.array_equal(np.asarray(las.intensity)[rows], points.intensity)
    return rows


def test_potree_2_keeps_further_attributes(tmp_path):
    points = unique(some(300))
    with_more(write_potree2(tmp_path / "p", points), points)
    las: Any = exported(tmp_path / "p", tmp_path / "b.las")
    rows, more = order_of(las, points), more_of(points)
    assert np.abs(np.asarray(las.xyz)[rows] - points.xyz).max() < 1e-6
    assert np.array_equal(np.asarray(las.classification)[rows], points.classes)
    assert np.array_equal(np.asarray(las.gps_time)[rows], more["gps-time"])
    assert np.array_equal(np.asarray(las.return_number)[rows], more["return number"])
    assert np.array_equal(np.asarray(las["quality"])[rows], more["quality"])


@pytest.mark.parametrize("form", ["bin", "laz"])
def test_potree_1_keeps_intensity_class_and_colour(tmp_path, form):
    points = unique(some(300))
    write_potree1(tmp_path / "p", points, form=form)
    las: Any = exported(tmp_path / "p", tmp_path / "b.las")
    rows = order_of(las, points)
    assert np.abs(np.asarray(las.xyz)[rows] - points.xyz).max() < 1e-3
    assert np.array_equal(np.stack([las.red, las.green, las.blue], axis=1)[rows], points.rgb * np.uint16(257))
    assert form == "laz" or np.array_equal(np.asarray(las.classification)[rows], points.classes)


@pytest.mark.parametrize("data", ["binary", "zstandard", "laszip"])
def test_ept_keeps_its_dimensions(tmp_path, data):
    points = unique(some(300))
    folder = write_ept(tmp_path / "e", points, data=data)
    times = 3e8 + points.intensity / 1000
    if data == "binary":
        for file in (folder / "ept-data").iterdir():
            schema = json.loads((folder / "ept.json").read_text())["schema"]
            kinds = {"float": "f", "signed": "i", "unsigned": "u"}
            table = np.frombuffer(file.read_bytes(), [(d["name"], f"<{kinds[d['type']]}{d['size']}") for d in schema]).copy()
            table["GpsTime"], table["PointSourceId"] = 3e8 + table["Intensity"] / 1000, table["Intensity"] // 2
            file.write_bytes(table.tobytes())
    las: Any = exported(tmp_path / "e", tmp_path / "b.laz")
    rows = order_of(las, points)
    assert np.abs(np.asarray(las.xyz)[rows] - points.xyz).max() < 1e-3
    assert np.array_equal(np.asarray(las.classification)[rows], points.classes)
    if data == "binary":
        assert np.array_equal(np.asarray(las.gps_time)[rows], times)
        assert np.array_equal(np.asarray(las.point_source_id)[rows], points.intensity // 2)


@pytest.mark.parametrize("limits", [False, True])
def test_matched_colours_beyond_the_range_that_an_e57_declares_widen_it(tmp_path, limits):
    """Some writers declare the range of the values, which matched exposures leave."""
    rng, writer = np.random.default_rng(4), Writer(tmp_path / "a.e57")
    scans = e57.VectorNode(writer.image, True)
    for name, value in {"formatName": "ASTM E57 3D Imaging Data File", "guid": "{f}", "versionMajor": 1, "versionMinor": 0,
                        "data3D": scans}.items():  # fmt: skip
        writer.image.root().set(name, writer.node(value))
    filling, count = [], 20_000
    xyz = rng.random((3, count)) * np.array([[6.0], [6.0], [0.01]])
    level = (60 + 60 * np.sin(xyz[0]) * np.cos(xyz[1])).clip(0, 120)
    for number, gain in enumerate((0.5, 1.0)):
        node = writer.node({"guid": f"{{{number}}}", "name": f"s{number}", "pose": {
            "rotation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}, "translation": {"x": 1.0, "y": 2.0 + number, "z": 1.5}}} | (
                {"colorLimits": {f"color{name}{end}": most for name in ("Red", "Green", "Blue")
                                 for end, most in (("Minimum", 0), ("Maximum", round(120 * gain)))}} if limits else {}))
        local = xyz - np.array([[1.0], [2.0 + number], [1.5]])
        fields = {f"cartesian{axis}": (e57.FloatNode(writer.image, 0.0), np.ascontiguousarray(values))
                  for axis, values in zip("XYZ", local, strict=True)}  # fmt: skip
        grey = np.rint(level * gain).astype(np.longlong)
        fields |= {f"color{name}": (e57.IntegerNode(writer.image, 0, 0, int(grey.max())), grey)
                   for name in ("Red", "Green", "Blue")}  # fmt: skip
        filling.append((writer.vector(node, "points", fields), fields))
        scans.append(node)
    for vector, fields in filling:
        writer.fill(vector, fields)
    writer.image.close()
    scene = open_scene([tmp_path / "a.e57"], cache=False)
    _, shown, _, station = unpack(scene)
    assert scene.matched and shown[station == 0].max() > 60  # the range that its fields declare
    options = ("--exposures", "matched", "--no-cache", "--out", str(tmp_path / "b.e57"))
    assert cli.main(["export", str(tmp_path / "a.e57"), *options]) == 0
    _, again, _, numbers = unpack(open_scene([tmp_path / "b.e57"], cache=False, match=False))
    for number in (0, 1):
        assert np.array_equal(np.sort(shown[station == number], axis=0), np.sort(again[numbers == number], axis=0))
    with open_e57(tmp_path / "b.e57") as file:
        stated = [file.root()["data3D"][number] for number in (0, 1)]
        assert [node.isDefined("colorLimits") for node in stated] == [limits, limits]
        for number, node in enumerate(stated) if limits else ():
            assert node["colorLimits"]["colorRedMaximum"].value() >= shown[station == number][:, 0].max()
