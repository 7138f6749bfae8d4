"""``Points`` of the Python interface: values of the files by name, for any number of scans, in bounded memory."""

import tracemalloc

import laspy
import numpy as np
import pytest
from cloud_files import write_ply
from untyped import read_las

import pointglass
from pointglass.viewer.readers.source import CHUNK

CHUNKS = 3 * 24 * CHUNK
"""Bytes of the piece of a file that is being read: its records, its coordinates, and both while one replaces the other."""


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


def sparse_las(path, count: int = 2000):
    """Whole millimetres over 8 km, classes, and intensities of 16 bits."""
    rng = np.random.default_rng(3)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), (500_000.0, 5_800_000.0, 0.0)
    las = laspy.LasData(header)
    las.x, las.y, las.z = (np.round(rng.random((count, 3)) * (8000, 8000, 200), 3) + header.offsets).T
    las.intensity, las.gps_time = np.arange(count) * 9 % 65536, rng.random(count) * 1e9
    las.classification = np.arange(count) % 2 + 1
    las.write(str(path))
    return read_las(str(path))


def test_sparse_points_are_exact_and_keep_their_attributes(tmp_path):
    las = sparse_las(tmp_path / "a.laz")
    with pointglass.open(tmp_path / "a.laz") as scan:
        order = np.lexsort(scan.points.xyz.T)
        expected = np.lexsort(np.asarray(las.xyz).T)
        assert np.array_equal(scan.points.xyz[order], np.asarray(las.xyz)[expected])
        assert scan.points.intensity.dtype == np.uint16
        assert np.array_equal(scan.points.intensity[order], las.intensity[expected])
        assert np.array_equal(scan.points.classification[order], np.asarray(las.classification)[expected])
        assert np.array_equal(scan.points["gps_time"][order], las.gps_time[expected])
        assert {"gps_time", "intensity", "point_source_id", "rgb"} <= set(scan.points.attributes)
        assert np.array_equal(scan.points[3].attributes["gps_time"], scan.points["gps_time"][3:4])
        assert scan.points.note is None
        with pytest.raises(pointglass.InputError, match=r"points\['gps'\]: no such attribute; there are .*gps_time"):
            _ = scan.points["gps"]


def test_the_station_of_a_point_is_a_row_of_the_stations(tmp_path):
    paths = [write_ply(tmp_path / f"{i:03d}.ply", np.random.default_rng(i).random((4, 3)) + (i % 20, i // 20, 0))
             for i in range(300)]
    with pointglass.open(*paths) as scan:
        assert scan.stations.shape == (300, 3) and len(scan.info["scans"]) == 300
        assert scan.stations[scan.points.station].shape == (1200, 3)
        assert np.bincount(scan.points.station).tolist() == [4] * 300
        x = scan.points.xyz
        assert np.array_equal(np.floor(x[:, 0]) + 20 * np.floor(x[:, 1]), scan.points.station)


def test_a_changed_file_is_noted(tmp_path):
    sparse_las(tmp_path / "a.las")
    with pointglass.open(tmp_path / "a.las") as scan:
        assert scan.points.note is None
        (tmp_path / "a.las").unlink()
        assert "cannot be read" in (scan.points.note or "") and len(scan.points.xyz) == 2000


def test_reading_all_points_takes_at_most_twice_the_memory_of_the_result(tmp_path):
    count = 1_500_000
    xyz = np.random.default_rng(0).random((count, 3)) * 100
    with pointglass.open(write_ply(tmp_path / "a.ply", xyz)) as scan:
        _ = scan.points[:10].xyz
        tracemalloc.start()
        found = scan.points.xyz
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert np.array_equal(np.sort(found[:, 0]), np.sort(xyz[:, 0]))
    assert peak <= 2 * found.nbytes + CHUNKS, peak / found.nbytes
