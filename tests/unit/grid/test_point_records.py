"""The grid's record numbers: which record of which file each packed point came from."""

import json

import numpy as np
import pytest
from cloud_files import write_ply

from pointglass.viewer.commands.convert import convert
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid import cache, open_scene
from pointglass.viewer.grid.building import pack_kernels
from pointglass.viewer.grid.npy_column import NpyColumn
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.records import point_records
from pointglass.viewer.grid.records.point_records import PointRecords
from pointglass.viewer.grid.scene import CHUNK, unpack


def cloud(count: int, seed: int, size=(40.0, 30.0, 3.0)) -> tuple[np.ndarray, np.ndarray]:
    """Positions at random, of which some are not finite, and the running number as colour."""
    rng = np.random.default_rng(seed)
    xyz = (rng.random((count, 3)) * size).astype(np.float32).astype(np.float64)
    xyz[rng.random(count) < 0.01] = np.nan
    number = np.arange(count)
    return xyz, np.stack([number & 0xFF, number >> 8 & 0xFF, number >> 16], axis=1).astype(np.uint8)


def number_of(rgb: np.ndarray) -> np.ndarray:
    return rgb.astype(np.int64) @ np.array([1, 1 << 8, 1 << 16])


def test_every_packed_point_has_the_number_of_its_record():
    """The colour of each point is its running number, so both columns must agree; points that are not finite are counted."""
    xyz, rgb = cloud(300_000, seed=1)
    scene = scene_from_arrays(xyz, rgb, noise=False)
    assert scene.records is not None and scene.count == np.isfinite(xyz).all(axis=1).sum()
    numbers = scene.records.numbers(slice(None))
    assert numbers.tolist() == number_of(unpack(scene)[1]).tolist()
    assert np.abs(unpack(scene)[0] - xyz[numbers]).max() <= scene.step / 2
    assert scene.records.first.tolist() == [0, len(xyz)]
    assert scene.records.high is None


def test_numbers_beyond_32_bits_take_a_fifth_byte():
    """A piece that begins before 2**32 and ends behind it."""
    first, count = (1 << 32) - 300, 1000
    numbers = first + np.arange(count)
    words = np.zeros((count, 4), np.uint32)
    words[:, 3] = words[:, 0] = numbers & 0xFFFFFFFF
    runs, points = np.array([[0, 0], [count, 0]]), np.zeros((count, 3), np.uint32)
    low, high = np.zeros(count, np.uint32), np.zeros(count, np.uint8)
    starts, buckets = np.array([[0, count]], np.int32), np.zeros((1, count), np.int32)
    pack_kernels.place_points(buckets, words[None], starts, np.array([first]), 0, 1, runs, points, low, high)
    found = PointRecords(low, high, np.array([0, first + count])).numbers(slice(None))
    assert sorted(found.tolist()) == numbers.tolist()
    assert (found & 0xFFFFFFFF).tolist() == points[:, 0].tolist()
    assert point_records.allocated(lambda name, shape, dtype: np.zeros(1, dtype), 1, 1 << 33, 1).high is not None


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def files(tmp_path):
    """Three PLY files; the one in the middle has one point."""
    made = []
    for number, count in enumerate((5000, 1, 3000)):
        xyz, rgb = cloud(count, seed=number)
        made.append(write_ply(tmp_path / f"{number}.ply", xyz, rgb))
    return made


def test_a_file_has_one_identity_through_any_parent_folder(tmp_path, files):
    """Projects name scans beside and above themselves; through a link to a folder, ``..`` is what the system makes of it."""
    (tmp_path / "projects" / "deep").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "projects" / "deep")
    path = tmp_path / "scan.xyz"
    path.write_text("0 0 0\n")
    for other in (tmp_path / "projects" / ".." / "scan.xyz", tmp_path / "link" / ".." / ".." / "scan.xyz"):
        assert point_records.identity_of(other) == point_records.identity_of(path)
    assert point_records.identity_of(path)[0] == str(path)


def test_a_grid_on_disk_leads_back_to_file_and_record(files):
    built, stored = open_scene.open_scene(files, cache=False), open_scene.open_scene(files)
    assert built.records is not None and stored.records is not None
    numbers = stored.records.numbers(slice(None))
    assert numbers.tolist() == built.records.numbers(slice(None)).tolist()
    assert stored.records.first.tolist() == [0, 5000, 5001, 8001]
    source, record = stored.records.places(numbers)
    rgb = unpack(stored)[1]
    for number in (0, 2):
        assert record[source == number].tolist() == number_of(rgb[source == number]).tolist()
    assert stored.meta.records.files == tuple(point_records.identity_of(file) for file in files)
    assert isinstance(stored.records.low, NpyColumn)


def test_the_column_takes_four_bytes_a_point(files, tmp_path):
    scene = convert(files, tmp_path / "grid")
    held = sum((tmp_path / "grid" / f"{name}.npy").stat().st_size for name in ("records", "record_sums"))
    assert held <= 4 * scene.count + 2 * 256  # two headers


def test_numbers_are_checked_when_they_are_read(files, tmp_path):
    """A damaged chunk is refused, others are read; opening does not read the column."""
    xyz, rgb = cloud(2 * CHUNK + 5000, seed=5)
    xyz = np.nan_to_num(xyz)
    convert([write_ply(tmp_path / "large.ply", xyz, rgb)], tmp_path / "grid")
    column = np.load(tmp_path / "grid" / "records.npy", mmap_mode="r+")
    column[CHUNK + 7] ^= 1
    column.flush()
    records = cache.load_folder(tmp_path / "grid").records
    assert records is not None
    records.numbers(slice(0, CHUNK))
    records.numbers(np.array([5, 2 * CHUNK + 1]))
    for index in (slice(CHUNK, CHUNK + 1), slice(0, None, 2), slice(None, None, 3 * CHUNK // 2), np.array([CHUNK + 9])):
        with pytest.raises(InputError, match="record numbers do not match"):
            records.numbers(index)


def test_a_folder_of_an_earlier_version_has_no_numbers(files, tmp_path):
    folder = tmp_path / "grid"
    convert(files, folder)
    as_before(folder)
    assert cache.load_folder(folder).records is None


def as_before(folder) -> None:
    """Makes a grid's folder what the version before record numbers wrote."""
    head = json.loads((folder / "meta.json").read_text())
    del head["sum"], head["meta"]["records"]
    for name in ("records", "record_sums"):
        (folder / f"{name}.npy").unlink()
        del head["shapes"][name]
        head["sums"].pop(name, None)
    (folder / "meta.json").write_text(json.dumps(head))


def test_the_number_of_points_has_a_limit_that_is_stated():
    with pytest.raises(InputError, match="cannot be opened together"):
        point_records.allocated(lambda name, shape, dtype: np.zeros(1, dtype), 1, (1 << 40) + 1, 1)


def test_a_source_without_points_is_passed_over():
    records = PointRecords(np.array([0, 4, 9], np.uint32), None, np.array([0, 5, 5, 10]))
    source, record = records.places(records.numbers(slice(None)))
    assert source.tolist() == [0, 0, 2] and record.tolist() == [0, 4, 4]
