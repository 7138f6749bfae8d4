"""Properties of packing, layers and culling on random input: nothing lost, nothing moved further than said."""

import numpy as np
import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from pointglass.viewer.bench.cases.stability import direction, walls
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.density_layers import layer_count, layer_sizes, morton_order
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import Camera, look_at
from pointglass.viewer.render.culling.cull import Culler

seeds = st.integers(0, 2**32 - 1)


def random_cloud(rng, count: int):
    """Clusters of very different widths around a centre of any size, with colours, intensities and scan numbers."""
    centre = direction(int(rng.integers(2**31))) * 10.0 ** rng.uniform(-3, 7)
    width = 10.0 ** rng.uniform(-2, 3, (count, 1))
    xyz = rng.normal(size=(count, 3)) * width + centre
    return (xyz, rng.integers(0, 256, (count, 3)).astype(np.uint8), rng.integers(0, 65536, count).astype(np.uint16),
            rng.integers(0, 256, count).astype(np.uint8))


def sorted_rows(*columns):
    """Rows in an order that depends on their values alone."""
    table = np.column_stack(columns)
    return table[np.lexsort(table.T)]


@given(seeds, st.integers(1, 3000))
@settings(max_examples=examples(20), deadline=None)
def test_packing_there_and_back_keeps_every_point_within_half_a_step(seed, count):
    rng = np.random.default_rng(seed)
    xyz, rgb, intensity, scan = random_cloud(rng, count)
    number = np.arange(count)
    rgb[:, 0], rgb[:, 1] = number % 256, number // 256  # so that each point can be told
    scene = scene_from_arrays(xyz, rgb, intensity=intensity, scan=scan)
    back, colours, level, of_scan = unpack(scene)
    order = np.argsort(colours[:, 0].astype(int) + 256 * colours[:, 1].astype(int), kind="stable")
    assert scene.count == count and np.array_equal(colours[order], rgb)
    assert np.array_equal(level[order], intensity) and np.array_equal(of_scan[order], scan)
    rounding = np.abs(xyz).max() * 2.0**-51
    assert np.abs(back[order] - xyz).max() <= 0.5 * scene.step + rounding
    low = scene.cell_min[scene.cell_of_points()]
    assert (back >= low).all() and (back <= low + scene.cell_size).all()
    assert scene.cell_size == 2.0 ** np.round(np.log2(scene.cell_size))


@given(seeds, st.integers(1, 2000))
@settings(max_examples=examples(15), deadline=None)
def test_a_packed_cloud_packed_again_does_not_move(seed, count):
    rng = np.random.default_rng(seed)
    xyz, rgb, *_ = random_cloud(rng, count)
    first = unpack(scene_from_arrays(xyz, rgb))
    again = scene_from_arrays(first[0], first[1])
    back = unpack(again)
    moved = sorted_rows(first[0], first[1]) - sorted_rows(back[0], back[1])
    assert np.abs(moved[:, :3]).max() <= 0.5 * again.step + np.abs(xyz).max() * 2.0**-51 and not moved[:, 3:].any()


@given(st.lists(st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3), min_size=1, max_size=40))
@settings(max_examples=examples(60), deadline=None)
def test_any_floats_at_all_make_a_scene_or_one_line(rows):
    xyz = np.array(rows, np.float64)
    try:
        scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    except InputError as error:
        assert "\n" not in str(error)
        return
    lost = scene.meta.dropped
    assert scene.count + lost.nan + lost.stray == len(xyz)
    assert lost.nan == (~np.isfinite(xyz).all(axis=1)).sum()
    assert np.isfinite(unpack(scene)[0]).all() and np.isfinite(scene.spacing) and scene.spacing > 0


@pytest.mark.parametrize("count", [70_000, 300_000])
def test_layers_are_nested_uniform_subsamples(seed, count):
    """The first k layers together hold a share 8**-(L - k) of the points, in every part of the room alike."""
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.random((count, 3)) * 2**16) / 2**16
    scene = scene_from_arrays(xyz, rng.integers(0, 256, xyz.shape).astype(np.uint8))
    cells = len(scene.cell_coords)
    assert scene.layers == layer_count(count) >= 2
    places = unpack(scene)[0]
    octant = (places > 0.5) @ [1, 2, 4]
    for kept in range(1, scene.layers + 1):
        held = int(scene.offsets[kept * cells])
        expected = count * 8.0 ** (kept - scene.layers)
        assert abs(held - expected) <= 6 * np.sqrt(expected) + 1  # six standard deviations
        by_octant = np.bincount(octant[:held], minlength=8)
        assert np.abs(by_octant - held / 8).max() <= 7 * np.sqrt(held / 8)
    together = np.add.reduceat(np.diff(scene.offsets).reshape(scene.layers, cells), [0], axis=0)[0]
    assert np.array_equal(together, np.bincount(scene.cell_of_points(), minlength=cells))


@given(seeds, st.integers(1, 6), st.integers(1, 50))
def test_layer_sizes_hold_every_point_once(seed, layers, cells):
    counts = np.random.default_rng(seed).integers(0, 1000, (cells, 16))
    sizes = layer_sizes(counts, layers)
    assert sizes.shape == (layers, cells) and np.array_equal(sizes.sum(axis=0), counts.sum(axis=1))
    if layers > 1:
        assert np.array_equal(sizes[-1], counts[:, :3].sum(1))  # the finest: values 0 to 2


@given(st.lists(st.tuples(*[st.integers(0, 2**31 - 1)] * 3), min_size=1, max_size=40))
def test_morton_order_is_that_of_the_interleaved_bits(cells):
    def interleaved(cell):
        return sum((value >> bit & 1) << (3 * bit + axis) for axis, value in enumerate(cell) for bit in range(31))

    order = morton_order(np.array(cells, np.int32))
    keys = [interleaved(cells[i]) for i in order]
    assert keys == sorted(keys) and sorted(order.tolist()) == list(range(len(cells)))


# Culling


def scene_for_culling(rng, kind: str):
    if kind == "room":
        return scene_from_arrays(*walls(int(rng.integers(2**31)), 12_000))
    if kind == "far away":
        place, rgb = walls(int(rng.integers(2**31)), 12_000)
        return scene_from_arrays(place * 37.0 + direction(int(rng.integers(2**31))) * 1e7, rgb)
    xyz, rgb, *_ = random_cloud(rng, 6_000)  # a few dense cells and many with a point or two
    return scene_from_arrays(xyz, rgb)


def random_frustum(rng, scene) -> Camera:
    """Anywhere: far outside, inside a cell, on a cell's face; any lens, any size, principal point in or out of the picture."""
    low, high = scene.bounds
    where = rng.integers(4)
    if where == 0:
        eye = rng.uniform(low, high)
    elif where == 1:
        eye = (low + high) / 2 + rng.normal(size=3) * (high - low).max() * 10.0 ** rng.uniform(-1, 2)
    else:
        eye = scene.cell_min[rng.integers(len(scene.cell_coords))] + rng.random(3) * scene.cell_size * (rng.random(3) < 0.6)
    aim = unpack(scene, rng.integers(scene.count, size=1))[0][0] if rng.random() < 0.7 else eye + rng.normal(size=3)
    width, height = (int(n) for n in np.exp(rng.uniform(0, np.log(4000), 2)))
    focal = 0.5 * height / np.tan(np.radians(np.exp(rng.uniform(0, np.log(170)))) / 2)
    centre = np.array([width, height]) * (rng.uniform(-1, 2, 2) if rng.random() < 0.3 else 0.5)
    pose = look_at(eye, aim, rng.normal(size=3))
    return Camera(width, height, focal * rng.uniform(0.5, 2), focal, centre[0], centre[1], pose)


@pytest.mark.parametrize("kind", ["room", "far away", "clusters"])
def test_culling_never_drops_a_visible_point(seed, kind):
    """Brute force: every point of a thousand frusta projected in float64."""
    rng = np.random.default_rng(seed)
    scene = scene_for_culling(rng, kind)
    culler, xyz, cells = Culler(scene), unpack(scene)[0], scene.cell_of_points()
    seen_any = 0
    for number in range(1000):
        camera = random_frustum(rng, scene)
        draw = culler.select(camera)
        rows = np.zeros(len(scene.cell_coords), bool)
        rows[draw.cells] = True
        x, y, z = camera.view_rotation @ (xyz - camera.position).T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        # half a pixel more to the left and top: the published program rounds
        seen = (z > 0) & (u >= -0.5) & (u < camera.width) & (v >= -0.5) & (v < camera.height)
        assert rows[cells[seen]].all(), f"frustum {number}: {camera}"
        seen_any += bool(seen.any())
        drawn = np.zeros(scene.count + 1, int)
        np.add.at(drawn, draw.first, 1)
        np.add.at(drawn, draw.first + draw.count, -1)
        drawn = drawn.cumsum()[:-1]
        assert (drawn[seen] == 1).all() and drawn.max(initial=0) <= 1, f"frustum {number}: {camera}"
    assert seen_any > 300  # or nothing was tested


@given(seeds)
@settings(max_examples=examples(20), deadline=None)
def test_culling_drops_what_lies_behind_or_wholly_to_a_side(seed):
    rng = np.random.default_rng(seed)
    camera = random_frustum(rng, ROOM)
    drawn = ROOM_CULLER.select(camera).cells
    assert not (outside(ROOM, camera)[drawn]).any(), f"{camera}"


def test_a_culler_that_keeps_all_in_front_would_be_noticed(seed):
    """That is: of most frusta there are cells in front and wholly to a side."""
    rng = np.random.default_rng(seed)
    noticed = 0
    for _ in range(100):
        camera = random_frustum(rng, ROOM)
        beside = outside(ROOM, camera)
        beside &= ~outside(ROOM, camera, sides=False)
        noticed += bool(beside.any())
    assert noticed > 50


def outside(scene, camera: Camera, *, sides: bool = True) -> np.ndarray:
    """(cells,) bool: all corners behind the camera, or beyond one side of its frustum widened by a pixel and a thousandth."""
    corners = scene.cell_min[:, None] + scene.cell_size * np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    x, y, z = np.moveaxis((corners - camera.position) @ camera.view_rotation.T, -1, 0)
    slack = 1e-3 * scene.cell_size
    beyond = [z < -1e-6 * scene.cell_size]
    for a, focal, centre, pixels in ((x, camera.fx, camera.cx, camera.width), (y, camera.fy, camera.cy, camera.height)):
        if sides:
            low, high = (-1.0 - centre) / focal, (pixels + 1.0 - centre) / focal
            beyond += [a < low * z - slack * np.hypot(1, low), a > high * z + slack * np.hypot(1, high)]
    return np.any([side.all(axis=1) for side in beyond], axis=0)


ROOM = scene_from_arrays(*walls(1, 30_000))
ROOM_CULLER = Culler(ROOM)
