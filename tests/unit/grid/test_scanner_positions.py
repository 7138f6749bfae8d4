"""Files that do not say where their scanners stood, opened: stations by the order of their points, or none."""

import numpy as np
import pytest
from cloud_files import E57Scan, write_e57, write_las
from scipy.spatial import KDTree
from swept_room import PLACES, sweep

from pointglass.viewer.commands.info import facts, format_text
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.preprocess import scanner_positions
from pointglass.viewer.preprocess.scan_description import ScanSummary
from pointglass.viewer.preprocess.scan_lines import WINDOW
from pointglass.viewer.preprocess.scanner_positions import StationInference
from pointglass.viewer.readers.source import Chunk, ScanInfo, Source


def swept(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """xyz (n, 3) of ``count`` stations in a room one after the other, rgb (n, 3), and each point's station."""
    parts = [sweep(place, seed, 260, 260) for place in PLACES[:count]]
    xyz = np.concatenate(parts)
    grey = 110 + 60 * np.sin(3 * xyz.sum(axis=1, keepdims=True))
    return xyz, np.repeat(grey, 3, axis=1), np.repeat(np.arange(count), [len(part) for part in parts])


def written(path, xyz, rgb):
    rgb = np.clip(np.rint(rgb), 0, 255).astype(np.uint8)
    if path.suffix == ".laz":
        return write_las(path, xyz, rgb.astype(np.uint16) * 257)
    vertex = np.zeros(len(xyz), [("xyz", "<f8", 3), ("rgb", "u1", 3)])  # cloud_files.write_ply takes a minute for so many
    vertex["xyz"], vertex["rgb"] = xyz, rgb
    kinds = "double x", "double y", "double z", "uchar red", "uchar green", "uchar blue"
    names = "".join(f"property {kind}\n" for kind in kinds)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(xyz)}\n{names}end_header\n"
    path.write_bytes(head.encode() + vertex.tobytes())
    return path


def stations_of(scene, xyz) -> np.ndarray:
    """(n,) the scan number of the scene's point nearest to each of xyz."""
    points, _, _, scan = unpack(scene)
    return scan[KDTree(points, balanced_tree=False).query(xyz)[1]]


@pytest.mark.parametrize("kind", ["ply", "laz"])
def test_a_merged_file_is_split_into_stations_by_the_order_of_its_points(tmp_path, kind):
    xyz, rgb, station = swept(3)
    scene = open_scene([written(tmp_path / f"room.{kind}", xyz, rgb)], cache=False)
    assert np.abs(scene.station_places - PLACES).max() < 0.05
    assert (stations_of(scene, xyz) == station).mean() > 0.97
    scans = scene.meta.scans
    assert sum(scan.count for scan in scans) == len(xyz) and all(scan.inferred for scan in scans)
    told = format_text(scene)
    assert "room, station 2: " in told and "inferred from the order of the points" in told
    assert facts(scene)["stations"] == "weighed"


@pytest.mark.slow
def test_inferred_stations_get_exposure_compensation(tmp_path):
    xyz, rgb, station = swept(2)
    file = written(tmp_path / "room.laz", xyz, rgb * np.array([0.85, 1.15])[station][:, None])
    scene = open_scene([file], cache=False)
    assert scene.meta.exposures.matched == scene.meta.exposures.stations == 2
    points, colours, _, _ = unpack(scene)
    expected = 110 + 60 * np.sin(3 * points.sum(axis=1))
    ratio = colours[:, 0] / expected
    assert np.percentile(np.abs(ratio / np.median(ratio) - 1), 98) < 0.03, "one brightness on all surfaces"
    plain = open_scene([file], cache=False, match=False)
    assert plain.meta.exposures is None and (unpack(plain)[3] == unpack(scene)[3]).all(), "stations, but no colour changed"


@pytest.mark.slow
def test_files_of_one_station_each_get_inferred_positions(tmp_path):
    xyz, rgb, station = swept(2)
    files = [written(tmp_path / f"{n}.ply", xyz[station == n], rgb[station == n]) for n in range(2)]
    scene = open_scene(files, cache=False)
    assert np.abs(scene.station_places - PLACES[:2]).max() < 0.05
    assert [scan.name for scan in scene.meta.scans] == ["0, station 1", "1, station 1"]
    alone = open_scene(files[:1], cache=False)
    assert alone.meta.scans == (ScanSummary("0", int((station == 0).sum())),), "one: nothing to gain"


def test_shuffled_files_and_files_that_state_positions_are_not_split(tmp_path):
    xyz, rgb, station = swept(2)
    order = np.random.default_rng(1).permutation(len(xyz))
    scene = open_scene([written(tmp_path / "mixed.ply", xyz[order], rgb[order])], cache=False)
    assert scene.meta.scans == (ScanSummary("mixed", len(xyz)),)
    rgb = np.rint(rgb).astype(np.uint8)
    scans = [E57Scan(xyz[station == n] - (n, 0, 0), rgb[station == n], translation=(n, 0, 0)) for n in range(2)]
    scene = open_scene([write_e57(tmp_path / "says.e57", scans)], cache=False)
    assert np.array_equal(scene.station_places, [[0, 0, 0], [1, 0, 0]]), "a file that says is believed"


def test_stretches_are_consecutive_points_for_any_chunk_size_and_few(monkeypatch):
    xyz, _, _ = swept(2)
    monkeypatch.setattr(scanner_positions, "MOST_STRETCHES", 20)
    for size in (1000, 4096, 7777):
        watcher = StationInference([Source("room.ply", "PLY", scans=[ScanInfo("room")])])  # pyright: ignore[reportArgumentType]
        for first in range(0, len(xyz), size):
            watcher.add(0, first, Chunk(xyz[first : first + size]))
        kept = watcher._kept
        assert 10 <= len(kept) <= 40 and kept[-1][0] > 0.9 * len(xyz), "evenly from the whole file"
        for place, window in kept:
            assert place % WINDOW == 0 and np.array_equal(window, xyz[place : place + WINDOW])


def test_stretches_of_only_one_file_are_held_at_a_time():
    xyz, _, _ = swept(1)
    watcher = StationInference([Source(f"{n}.ply", "PLY", scans=[ScanInfo(str(n))]) for n in range(3)])  # pyright: ignore[reportArgumentType]
    for source in range(3):
        watcher.add(source, source * len(xyz), Chunk(xyz + (0.1 * source, 0.0, 0.0)))
        assert len(watcher._kept) == len(xyz) // WINDOW
    found = watcher.solve()
    assert not watcher._kept and sorted(found.turns) == [0, 1, 2]
    assert found.counts == {(source, 0): len(xyz) for source in range(3)}
