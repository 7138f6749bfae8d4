"""Random access to records equals reading the file from its beginning, column by column and bit for bit."""

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las, write_ply
from format_files import some, write_pcd

from pointglass.viewer.readers import record_blocks
from pointglass.viewer.readers.e57 import e57_blocks
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.source import Source


def streamed(source: Source, numbers: np.ndarray):
    """The same records by the reference implementation, which reads the file from its beginning."""
    return Source.records(source, numbers)


def assert_same(path, seed: int, *, quick: bool | None = None) -> None:
    source = open_source(path)
    count = sum(len(chunk.xyz) for chunk in source.chunks())
    rng = np.random.default_rng(seed)
    for numbers in (np.unique(rng.integers(0, count, 50)), np.array([0]), np.array([count - 1]), np.arange(count)):
        found, expected = source.records(numbers), streamed(open_source(path), numbers)
        assert np.array_equal(found.xyz, expected.xyz, equal_nan=True)
        assert (found.rgb is None) == (expected.rgb is None)
        assert found.rgb is None or (found.rgb.dtype == expected.rgb.dtype and np.array_equal(found.rgb, expected.rgb))
        assert np.array_equal(*(np.broadcast_to(records.scan, len(numbers)) for records in (found, expected)))
        assert found.columns.keys() == expected.columns.keys()
        for name, values in expected.columns.items():
            own = found.columns[name]
            assert own.dtype.newbyteorder("=") == values.dtype.newbyteorder("="), name
            assert np.array_equal(own, values, equal_nan=True), name
    if quick is not None:
        assert source.has_quick_records == quick


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(e57_blocks, "BLOCK", 700)
    monkeypatch.setattr(record_blocks, "MOST", 700)
    monkeypatch.setattr(record_blocks.even_blocks, "__defaults__", (700,))


def test_ply(tmp_path, seed):
    xyz, rgb = surface(2500)
    for order in ("binary_little_endian", "binary_big_endian"):
        assert_same(write_ply(tmp_path / f"{order}.ply", xyz, rgb, order=order, extra=True), seed, quick=True)
    assert_same(write_ply(tmp_path / "text.ply", xyz, rgb, order="ascii"), seed, quick=False)
    assert_same(write_ply(tmp_path / "lists.ply", xyz, rgb, vertex_list=True), seed, quick=False)


@pytest.mark.parametrize("kind", ["double", "float", "scaled"])
def test_e57(tmp_path, seed, kind):
    """Two scans of several blocks with poses, invalid points, further fields; the last scan has no intensity."""
    rng = np.random.default_rng(seed)
    xyz, rgb = surface(2500)
    beside = {"rowIndex": np.arange(2500) % 50, "columnIndex": np.arange(2500) // 50}
    pose = {"quaternion": (np.sqrt(0.5), 0, 0, np.sqrt(0.5)), "translation": (5.0, 6.0, 7.0)}
    first = E57Scan(xyz=xyz, rgb=rgb, intensity=rng.random(2500), kind=kind, invalid=(rng.random(2500) < 0.2) * 2,
                    beside=beside, **pose)  # fmt: skip
    scans = [first, E57Scan(xyz=xyz[:900], rgb=rgb[:900], kind=kind)]
    assert_same(write_e57(tmp_path / "a.e57", scans), seed, quick=True)


def test_e57_leaves_points_at_the_scanner_out(tmp_path, seed):
    xyz, rgb = surface(2500)
    xyz[np.random.default_rng(seed).random(2500) < 0.1] = 0
    assert_same(write_e57(tmp_path / "a.e57", [E57Scan(xyz=xyz, rgb=rgb)]), seed, quick=True)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las(tmp_path, seed, suffix):
    xyz, rgb = surface(2500)
    assert_same(write_las(tmp_path / f"a.{suffix}", xyz, rgb, np.arange(2500)), seed, quick=True)


@pytest.mark.parametrize("form", ["binary", "ascii", "binary_compressed"])
def test_pcd(tmp_path, seed, form):
    write_pcd(tmp_path / "a.pcd", some(2500), data=form, pad=True)
    assert_same(tmp_path / "a.pcd", seed)
