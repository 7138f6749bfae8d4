"""Values of single points and of all points are those of the file, bit for bit; where they cannot be, that is stated."""

import json
import os

import laspy
import numpy as np
import pytest
from cloud_files import write_ply
from untyped import read_las

from pointglass.viewer.commands.convert import convert
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.grid.records.file_records import FileRecords
from pointglass.viewer.grid.scene import unpack

SCALES = [(1e-3, 4000.0), (1e-7, 1e-3), (0.01, 1.0), (1e-3, 0.02)]
"""Coordinate scale of a LAS file, and the extent of its points: sparse aerial points to a small dense part."""
FLAGS = ("synthetic", "key_point", "withheld", "overlap", "scan_direction_flag", "edge_of_flight_line")


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


def random_las(path, seed: int, count: int = 3000, scale: float = 1e-3, extent: float = 50.0, form: int = 7) -> laspy.LasData:
    """Points at random, every dimension filled, with extra dimensions, one of them scaled."""
    rng = np.random.default_rng(seed)
    header = laspy.LasHeader(point_format=form, version="1.4")
    header.add_extra_dims([laspy.ExtraBytesParams("deviation", "float32"), laspy.ExtraBytesParams("echo", "uint16"),
                           laspy.ExtraBytesParams("height", "int16", scales=np.array([0.01]), offsets=np.array([5.0]))])
    middle = np.round(rng.random(3) * 1000, 3)
    header.scales, header.offsets = np.full(3, scale), np.floor(middle - 10 * rng.random(3))
    las = laspy.LasData(header)
    las.x, las.y, las.z = (middle + (rng.random((count, 3)) - 0.5) * extent).T
    for name in las.point_format.dimension_names:
        if name in ("X", "Y", "Z", "deviation", "height"):
            continue
        values = las[name]
        most = 15 if "return" in name else 3 if name == "scanner_channel" else 1 if name in FLAGS else None
        kind = np.asarray(values).dtype
        if kind.kind == "f":
            las[name] = rng.random(count) * 1e6
        else:
            high = most if most is not None else np.iinfo(kind).max
            las[name] = rng.integers(0 if most is not None or kind.kind == "u" else np.iinfo(kind).min, high + 1, count)
    las.deviation, las.height = rng.random(count).astype(np.float32), np.round(rng.random(count) * 100, 2)
    las.write(str(path))
    return read_las(str(path))


def assert_equals_las(scene, las, index) -> None:
    values = FileRecords(scene).of(index)
    numbers = scene.records.numbers(slice(None))[index]
    assert values.exact and values.note is None
    assert np.array_equal(values.xyz, np.asarray(las.xyz)[numbers])
    assert np.array_equal(values.rgb, np.stack([las.red, las.green, las.blue], axis=1)[numbers])
    names = set(las.point_format.dimension_names) - {"X", "Y", "Z", "red", "green", "blue"}
    assert set(values.columns) == names and {"gps_time", "deviation", "height", "scan_angle", "withheld"} <= names
    for name in names:
        expected = np.asarray(las[name])[numbers]
        assert values.columns[name].dtype == expected.dtype and np.array_equal(values.columns[name], expected), name


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize(("scale", "extent"), SCALES)
def test_las_values_are_those_that_laspy_reads(tmp_path, suffix, scale, extent):
    las = random_las(tmp_path / f"a.{suffix}", seed=int(extent) + len(suffix), scale=scale, extent=extent)
    for scene in (open_scene(tmp_path / f"a.{suffix}", cache=False), open_scene(tmp_path / f"a.{suffix}")):
        rng = np.random.default_rng(1)
        for index in (slice(None), slice(7, 8), slice(None, None, -3), rng.integers(0, scene.count, 200), np.array([5, 5, 2])):
            assert_equals_las(scene, las, index)


def test_many_chunks_of_a_laz_are_read_from_anywhere(tmp_path):
    las = random_las(tmp_path / "a.laz", seed=3, count=120_000)  # three chunks
    scene = open_scene(tmp_path / "a.laz")
    assert_equals_las(scene, las, np.random.default_rng(2).integers(0, scene.count, 100))
    assert_equals_las(scene, las, slice(None))  # more than are read one by one: from the beginning


def test_values_of_several_files_are_joined_by_name(tmp_path):
    """Files with different columns: NaN where a file lacks one; the station is the file's number."""
    las = [random_las(tmp_path / f"{i}.las", seed=i, count=400, form=form) for i, form in enumerate((7, 6, 7))]
    scene = open_scene([tmp_path / f"{i}.las" for i in range(3)])
    values = FileRecords(scene).of(slice(None))
    source, record = scene.records.places(scene.records.numbers(slice(None)))
    assert np.array_equal(values.source, source) and np.array_equal(values.station, source)
    for i in range(3):
        mine = source == i
        assert np.array_equal(values.xyz[mine], np.asarray(las[i].xyz)[record[mine]])
        assert np.array_equal(values.columns["gps_time"][mine], las[i].gps_time[record[mine]])
    assert np.isnan(values.rgb[source == 1]).all() and np.isfinite(values.rgb[source == 0]).all()


def test_a_changed_file_is_stated_and_the_grid_stands_in(tmp_path):
    random_las(tmp_path / "a.las", seed=1)
    convert([tmp_path / "a.las"], tmp_path / "grid")
    scene = open_scene(tmp_path / "grid")
    assert FileRecords(scene).of(np.array([3])).exact
    os.utime(tmp_path / "a.las", (1, 1))
    values = FileRecords(scene).of(np.array([3]))
    assert not values.exact and "has changed since the grid was built" in values.note and "rounded to" in values.note
    assert np.array_equal(values.xyz, unpack(scene, np.array([3]))[0])
    assert values.source.tolist() == [-1] and "intensity" in values.columns


def test_a_file_that_is_gone_is_stated(tmp_path):
    random_las(tmp_path / "a.las", seed=1)
    random_las(tmp_path / "b.las", seed=2)
    convert([tmp_path / "a.las", tmp_path / "b.las"], tmp_path / "grid")
    (tmp_path / "a.las").unlink()
    scene = open_scene(tmp_path / "grid")
    values = FileRecords(scene).of(slice(None))
    assert "a.las: cannot be read (No such file or directory)" in values.note
    assert set(values.source.tolist()) == {-1, 1}  # those of the other file are still exact
    assert np.array_equal(values.station, scene.records.places(scene.records.numbers(slice(None)))[0])


def test_a_file_of_the_same_size_and_time_with_other_points_is_found_out(tmp_path):
    random_las(tmp_path / "a.las", seed=1)
    convert([tmp_path / "a.las"], tmp_path / "grid")
    state = os.stat(tmp_path / "a.las")
    random_las(tmp_path / "a.las", seed=2)
    os.utime(tmp_path / "a.las", ns=(state.st_atime_ns, state.st_mtime_ns))
    values = FileRecords(open_scene(tmp_path / "grid")).of(np.arange(50))
    assert "its points are not those that the grid was built from" in values.note


def test_a_grid_of_an_earlier_version_states_its_precision(tmp_path):
    random_las(tmp_path / "a.las", seed=1)
    convert([tmp_path / "a.las"], tmp_path / "grid")
    head = json.loads((tmp_path / "grid" / "meta.json").read_text())
    del head["sum"], head["meta"]["records"]
    for name in ("records", "record_sums"):
        head["shapes"].pop(name), head["sums"].pop(name, None)
    (tmp_path / "grid" / "meta.json").write_text(json.dumps(head))
    scene = open_scene(tmp_path / "grid")
    values = FileRecords(scene).of(slice(0, 10))
    assert "made by an earlier version" in values.note and f"{scene.step / 2:.2g}" in values.note


def test_damaged_record_numbers_are_stated(tmp_path):
    random_las(tmp_path / "a.las", seed=1)
    convert([tmp_path / "a.las"], tmp_path / "grid")
    column = np.load(tmp_path / "grid" / "records.npy", mmap_mode="r+")
    column[1] ^= 4
    column.flush()
    values = FileRecords(open_scene(tmp_path / "grid")).of(slice(0, 10))
    assert not values.exact and "record numbers do not match their checksum" in values.note
    assert len(values.station) == 10


def test_300_files_have_300_stations(tmp_path):
    paths = [write_ply(tmp_path / f"{i:03d}.ply", np.random.default_rng(i).random((5, 3)) + (i % 20, i // 20, 0))
             for i in range(300)]
    scene = open_scene(paths)
    stations = FileRecords(scene).stations(slice(None))
    assert np.bincount(stations).tolist() == [5] * 300
    assert len(scene.meta.scans) == 300 and all(scan.count == 5 for scan in scene.meta.scans)


def test_points_in_memory_are_exact(tmp_path):
    xyz = np.random.default_rng(0).random((500, 3)) * 1000
    scene = scene_from_arrays(xyz, np.zeros((500, 3), np.uint8))
    values = FileRecords(scene).of(slice(None))
    assert values.exact and np.array_equal(values.xyz, xyz[scene.records.numbers(slice(None))])
