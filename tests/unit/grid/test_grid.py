"""The grid: every point once, at its position, in a random layer, and equal to a NumPy reference implementation."""

import itertools
import threading
import time

import numpy as np
import pytest
from cloud_files import surface
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid import density_layers as layers
from pointglass.viewer.grid import scene as scene_module
from pointglass.viewer.grid.building import histogram as histogram_module
from pointglass.viewer.grid.building import kernels, pack_kernels
from pointglass.viewer.grid.building import scatter as scatter_module
from pointglass.viewer.grid.building import two_passes as grid_module
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.preprocess.scan_table import ScanTable
from pointglass.viewer.readers import arrays as arrays_module
from pointglass.viewer.readers.source import Chunk, ScanInfo

PARTS = [int(f"{number:06b}"[::-1], 2) for number in range(64)]
"""Of each 64 points of a layer and cell, the one that goes into the first part, the second, ..."""
SLOW = settings(deadline=None, max_examples=15, suppress_health_check=list(HealthCheck))


def trailing_zeros(count):
    z = np.arange(count, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x706F696E74676C61)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    bits = (z[:, None] >> np.arange(15, dtype=np.uint64)) & np.uint64(1)
    return np.where(bits.any(axis=1), bits.argmax(axis=1), 15)


def test_cells_are_counted_up_to_a_limit(seed):
    rng = np.random.default_rng(seed)
    for _ in range(60):
        xyz = rng.normal(size=(int(rng.integers(1, 4000)), 3)) * 10.0 ** rng.uniform(-3, 3) + 10.0 ** rng.uniform(-3, 19)
        size, limit = 2.0 ** rng.integers(-8, 12), int(rng.integers(1, 5000))
        room = np.empty((2 << limit.bit_length(), 3))
        cells = len(np.unique(np.floor(xyz / size), axis=0))
        assert kernels.occupied(xyz, 1 / size, limit, room) == min(cells, limit + 1)


def test_quantiles_are_numpys(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        points = np.round(rng.normal(0, 10, (int(rng.integers(1, 300)), 3)), int(rng.integers(0, 5)))
        shares = (0.0, 0.02, 0.5, 0.98, 1.0)
        expected = np.quantile(points, shares, axis=0, method="nearest")
        assert np.array_equal(histogram_module._quantiles(points, shares), expected)


def morton(cell):
    return sum((int(v) >> bit & 1) << (3 * bit + axis) for axis, v in enumerate(cell) for bit in range(32))


def reference(xyz, rgb, intensity, scan):
    """The reference implementation of the build in NumPy, for small clouds."""
    n = len(xyz)
    middle = np.sort(xyz, axis=0)[[int(0.02 * n), int(0.98 * n)]]
    size = 2.0 ** np.floor(np.log2((middle[1] - middle[0]).max() / 4096))
    while True:
        cells, inverse, counts = np.unique(np.floor(xyz / size), axis=0, return_inverse=True, return_counts=True)
        fullest = np.sort(counts)[::-1].cumsum()
        if 0.95 * n / (np.searchsorted(fullest, 0.95 * n) + 1) >= min(4096, 0.95 * n / 8):
            break
        size *= 2
    base = cells.min(axis=0)
    order = sorted(range(len(cells)), key=lambda i: morton(cells[i] - base))
    rank = np.empty(len(cells), int)
    rank[order] = np.arange(len(cells))
    depth = int(np.clip(1 + np.ceil(np.log2(n / 2**15) / 3), 1, 6))
    bucket = np.maximum(depth - 1 - trailing_zeros(n) // 3, 0) * len(cells) + rank[inverse.reshape(-1)]
    offsets = np.concatenate([[0], np.bincount(bucket, minlength=depth * len(cells)).cumsum()])
    unit = xyz / size
    q = np.minimum(np.floor((unit - np.floor(unit)) * 65536), 65535).astype(np.uint32)
    c = rgb.astype(np.uint32)
    words = np.stack([
        q[:, 0] | q[:, 1] << 16, q[:, 2] | intensity.astype(np.uint32) << 16,
        c[:, 0] | c[:, 1] << 8 | c[:, 2] << 16 | scan.astype(np.uint32) << 24,
    ], axis=1)  # fmt: skip
    words = words[np.argsort(bucket, kind="stable")]
    for start, stop in itertools.pairwise(offsets):
        words[start:stop] = np.concatenate([words[start:stop][first::64] for first in PARTS])
    return words, (cells[order] - base), offsets, base * size, size


def attributes(n, seed=0):
    random = np.random.default_rng(seed)
    return random.integers(0, 65536, n).astype(np.uint16), random.integers(0, 256, n).astype(np.uint8)


@SLOW
# a subnormal origin is left out: -5e-324 divided by a cell of 2 is no longer negative, here and in the reference
@given(n=st.integers(200, 90_000), exponent=st.floats(-3, 6), origin=st.floats(-1e7, 1e7, allow_subnormal=False),
       seed=st.integers(0, 1000))
def test_the_grid_equals_its_numpy_reference_bit_for_bit(n, exponent, origin, seed):
    xyz, rgb = surface(n, seed)
    xyz = xyz * 10**exponent + origin * np.array([1, -0.7, 0.01])
    intensity, scan = attributes(n, seed)
    scene = scene_from_arrays(xyz, rgb, intensity=intensity, scan=scan)
    points, cells, offsets, base, size = reference(xyz, rgb, intensity, scan)
    assert scene.cell_size == size
    np.testing.assert_array_equal(scene.origin, base)
    np.testing.assert_array_equal(scene.cell_coords, cells)
    np.testing.assert_array_equal(scene.offsets, offsets)
    np.testing.assert_array_equal(scene.points, points)


@SLOW
@given(n=st.integers(1, 3000), exponent=st.integers(-12, 20), seed=st.integers(0, 1000))
def test_unpacked_points_are_within_half_a_step(n, exponent, seed):
    xyz, rgb = surface(n, seed)
    xyz = (xyz - 2.0) * 1.7**exponent
    intensity, scan = attributes(n, seed)
    scene = scene_from_arrays(xyz, rgb, intensity=intensity, scan=scan)
    back, colours, levels, scans = unpack(scene)
    # the order differs: match points by their other attributes where these are unique
    key = np.lexsort((levels, scans, *colours.T))
    want = np.lexsort((intensity, scan, *rgb.T))
    np.testing.assert_array_equal(colours[key], rgb[want])
    np.testing.assert_array_equal(levels[key], intensity[want])
    distinct = len(np.unique(np.column_stack([rgb, intensity, scan]), axis=0)) == n
    if distinct:
        assert np.abs(back[key] - xyz[want]).max() <= scene.step * 0.5 * (1 + 1e-9) + np.abs(xyz).max() * 1e-15
    assert scene.count == n == len(back)
    assert [s.count for s in scene.meta.scans] == np.bincount(scan).tolist()


def test_each_layer_holds_seven_eighths_of_itself_and_coarser_ones_and_each_point_once():
    n = 400_000
    xyz, _ = surface(n)
    number = np.arange(n)
    rgb = np.stack([number & 255, number >> 8 & 255, number >> 16], axis=1).astype(np.uint8)
    scene = scene_from_arrays(xyz, rgb)
    ends = scene.layer_ends
    assert scene.layers == 3 and ends[-1] == n and np.array_equal(ends, scene.offsets[:: len(scene.cell_coords)][1:])
    for most in (1, *ends, *ends + 1, *ends - 1):
        assert scene.coarse_points(most) == min([end for end in ends if end >= most], default=n)
        assert scene.coarse_points_within(most) == max([end for end in ends if end <= most], default=ends[0])
    for k, end in enumerate(ends):
        assert abs(end / n - 8.0 ** (k + 1 - scene.layers)) < 0.01 * 8.0 ** (k + 1 - scene.layers) + 0.002
    _, colours, _, _ = unpack(scene)
    found = colours[:, 0].astype(int) | colours[:, 1].astype(int) << 8 | colours[:, 2].astype(int) << 16
    np.testing.assert_array_equal(np.sort(found), number)
    first = found[: ends[0]]  # the coarsest layer: uniform over the file's order and over space
    assert abs(first.mean() / n - 0.5) < 0.01
    quarters = np.histogram2d(xyz[first, 0], xyz[first, 1], bins=4)[0]
    assert quarters.min() > 0.8 * quarters.mean()


def test_the_first_parts_of_a_layer_and_cell_are_spread_over_the_files_order():
    n = 100_000
    xyz, _ = surface(n)
    number = np.arange(n)
    rgb = np.stack([number & 255, number >> 8 & 255, number >> 16], axis=1).astype(np.uint8)
    scene = scene_from_arrays(xyz, rgb)
    assert scene.parts == 64
    c = unpack(scene)[1].astype(int)
    found = c[:, 0] | c[:, 1] << 8 | c[:, 2] << 16
    for start, stop in itertools.pairwise(scene.offsets):
        run, size = found[start:stop], stop - start
        rank = np.empty(size, int)
        rank[np.argsort(run)] = np.arange(size)  # in the file's order
        for parts in range(1, 65):
            taken = size // 64 * parts + layers.PART_EXTRA[size % 64, parts]
            assert taken >= size * parts / 64 - 1e-9 and taken - size * parts / 64 < 3
            gaps = np.diff(np.sort(rank[:taken]), prepend=-1, append=size)
            assert gaps.max() <= 64 >> (parts.bit_length() - 1)


@pytest.mark.parametrize("exponent", [-20, -3, 1, 12, 30])
def test_scaling_by_a_power_of_two_changes_no_bit(exponent):
    xyz, rgb = surface(60_000, origin=(1000.25, -3.0, 7.0))
    one, other = scene_from_arrays(xyz, rgb), scene_from_arrays(xyz * 2.0**exponent, rgb)
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.cell_coords, other.cell_coords)
    np.testing.assert_array_equal(one.offsets, other.offsets)
    assert other.cell_size == one.cell_size * 2.0**exponent
    assert other.spacing == one.spacing * 2.0**exponent
    np.testing.assert_array_equal(other.origin, one.origin * 2.0**exponent)


@pytest.mark.parametrize("cells", [(1, 0, 0), (-3, 5, 1), (1_000_000, -2_000_000, 77)])
def test_shifting_by_whole_cells_changes_no_bit(cells):
    xyz, rgb = surface(60_000)
    one = scene_from_arrays(xyz, rgb)
    shift = np.array(cells) * one.cell_size
    other = scene_from_arrays(xyz + shift, rgb)  # exact: coordinates are multiples of 1/4096
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.cell_coords, other.cell_coords)
    np.testing.assert_array_equal(one.offsets, other.offsets)
    np.testing.assert_array_equal(one.origin + shift, other.origin)


def test_the_grid_does_not_depend_on_chunks_or_processors(monkeypatch):
    xyz, rgb = surface(150_000)
    one = scene_from_arrays(xyz, rgb)
    for chunk, piece, slab, group, processors in ((10_007, 1000, 7000, 900, 5), (60_000, 7_777, 1 << 21, 1 << 15, 1)):
        monkeypatch.setattr(arrays_module, "CHUNK", chunk)
        monkeypatch.setattr(scatter_module, "PIECE", piece)
        monkeypatch.setattr(scatter_module, "SLAB", slab)
        monkeypatch.setattr(scatter_module, "GROUP", group)
        monkeypatch.setattr(grid_module, "processors", lambda processors=processors: processors)
        other = scene_from_arrays(xyz, rgb)
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.offsets, other.offsets)
        np.testing.assert_array_equal(one.boxes, other.boxes)


@pytest.mark.parametrize("processors", [1, 2, 5])
def test_no_array_is_written_by_two_threads_at_a_time(monkeypatch, processors):
    """Pieces are packed on several threads, groups placed, some with delays; no two threads use an array at the same time."""
    pack, place, calls = pack_kernels.pack_points, pack_kernels.place_points, itertools.count()
    busy, shared, lock = {}, [], threading.Lock()

    def alone(work, own, *arguments):
        names = [array.ctypes.data for array in own]
        with lock:
            shared.extend(name for name in names if name in busy)
            busy.update(dict.fromkeys(names))
            late = next(calls) % 7 == 0
        if late:
            time.sleep(0.01)
        done = work(*arguments)
        with lock:
            for name in names:
                busy.pop(name, None)
        return done

    monkeypatch.setattr(arrays_module, "CHUNK", 5_000)
    monkeypatch.setattr(scatter_module, "PIECE", 500)
    monkeypatch.setattr(scatter_module, "SLAB", 8_000)
    monkeypatch.setattr(scatter_module, "GROUP", 2_000)
    monkeypatch.setattr(grid_module, "processors", lambda: processors)

    def packed(points, buckets, pieces, marks):
        own = [array for array in (*pieces, marks) if len(pieces.buckets)]
        return alone(pack, own, points, buckets, pieces, marks)

    monkeypatch.setattr(pack_kernels, "pack_points", packed)
    monkeypatch.setattr(pack_kernels, "place_points", lambda *a: alone(place, (), *a))
    xyz, rgb = surface(60_000)
    made = scene_from_arrays(xyz, rgb)
    assert next(calls) > 30 and not shared
    monkeypatch.undo()
    plain = scene_from_arrays(xyz, rgb)
    np.testing.assert_array_equal(made.points, plain.points)
    np.testing.assert_array_equal(made.boxes, plain.boxes)


@pytest.mark.slow
def test_the_grid_does_not_depend_on_which_thread_is_ahead(monkeypatch):
    """Tables become full while one of the threads is a chunk ahead of the other."""
    random = np.random.default_rng(4)
    xyz = random.normal(0, 0.01, (200_000, 3))
    xyz[20_000:] = np.cumsum(random.normal(0, 1, (180_000, 3)), axis=0)  # grows, so that cells are merged often
    rgb = random.integers(0, 256, (len(xyz), 3), dtype=np.uint8)
    monkeypatch.setattr(arrays_module, "CHUNK", 20_000)
    count, room, merged = kernels.count_points, histogram_module.Histogram._make_room, []
    monkeypatch.setattr(histogram_module.Histogram, "_make_room", lambda self: (merged.append(1), room(self)))
    scenes = []
    for slow in (None, 0, 1):

        def counted(rows, start, *rest, slow=slow):
            if slow == (start > 0):
                time.sleep(0.02)
            return count(rows, start, *rest)

        monkeypatch.setattr(kernels, "count_points", counted)
        scenes.append(scene_from_arrays(xyz, rgb))
    assert len(merged) >= 3 * 2
    for other in scenes[1:]:
        assert other.cell_size == scenes[0].cell_size
        np.testing.assert_array_equal(other.points, scenes[0].points)
        np.testing.assert_array_equal(other.offsets, scenes[0].offsets)


def test_all_ways_of_indexing_unpack_the_same_points(monkeypatch):
    scene = scene_from_arrays(*surface(5_000))
    for part in (slice(3, 4_000), slice(3, 4_000, 7), slice(None, None, 11), slice(None, None, -1), slice(7, 7)):
        few = unpack(scene, np.arange(5_000)[part])
        for least in (scene_module._FEW, 0):  # by NumPy, and in a compiled loop
            monkeypatch.setattr(scene_module, "_FEW", least)
            for one, other in zip(unpack(scene, part), few, strict=True):
                np.testing.assert_array_equal(one, other)
        monkeypatch.undo()


def test_unpack_takes_any_index():
    xyz, rgb = surface(70_000)
    scene = scene_from_arrays(xyz, rgb)
    whole = unpack(scene)[0]
    cells = scene.cell_of_points()
    assert cells.dtype == np.int32 and len(cells) == scene.count
    some = np.array([5, 69_999, 0, 33])
    np.testing.assert_array_equal(unpack(scene, some)[0], whole[some])
    np.testing.assert_array_equal(unpack(scene, slice(10, 500))[0], whole[10:500])
    np.testing.assert_array_equal(unpack(scene, slice(None, None, 7))[0], whole[::7])
    np.testing.assert_array_equal(unpack(scene, slice(9, 9))[0], whole[:0])
    np.testing.assert_array_equal(unpack(scene, 12)[0], whole[12:13])


def test_scans_are_numbered_through_all_files_and_share_the_last_number():
    scans = ScanTable(tuple((ScanInfo("a scan"),) * count for count in (200, 100)))
    numbers = [scans.numbers(file, 7, Chunk(np.zeros((3, 3)), scan=scan)).tolist()
               for file, scan in ((0, 0), (0, 199), (1, 0), (1, 54), (1, 55), (1, 99))]  # fmt: skip
    assert numbers == [[n] * 3 for n in (0, 199, 200, 254, 255, 255)]
    scans = ScanTable((scans.scans[0], (ScanInfo("a station"),) * 3), turns={1: np.array([1002, 1005])})
    split = scans.numbers(1, 1001, Chunk(np.zeros((6, 3))))
    assert split.tolist() == [200, 201, 201, 201, 202, 202]


def test_arrays_that_do_not_fit_are_named():
    xyz, rgb = surface(10)
    with pytest.raises(InputError, match="rgb: expected"):
        scene_from_arrays(xyz, rgb[:5])
    with pytest.raises(InputError, match="rgb: expected"):
        scene_from_arrays(xyz, rgb.astype(np.uint16))
    with pytest.raises(InputError, match="xyz: expected"):
        scene_from_arrays(xyz[:, :2], rgb)
    with pytest.raises(InputError, match="holds no points"):
        scene_from_arrays(xyz[:0], rgb[:0])


def test_a_scan_too_large_for_memory_is_built_in_a_file_without_a_name(monkeypatch):
    from pointglass.viewer.grid import build_scene as build

    xyz, rgb = surface(5000)
    one = scene_from_arrays(xyz, rgb)
    monkeypatch.setattr(build, "_IN_MEMORY", 4999)
    other = scene_from_arrays(xyz, rgb)
    assert isinstance(other.points, np.memmap)
    np.testing.assert_array_equal(one.points, other.points)
