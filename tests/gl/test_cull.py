"""Culling, level of detail and batches against brute force and against the same in plain NumPy."""

import itertools
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from clouds import camera_in, room
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from pointglass.viewer.grid.cell_boxes import SHARES, WHOLE
from pointglass.viewer.grid.density_layers import morton_order
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.projected_coverage import SQUARES, UNKNOWN
from pointglass.viewer.grid.scene import Scene, unpack
from pointglass.viewer.picture.camera import Camera, look_at
from pointglass.viewer.render.culling.crowding import ENOUGH
from pointglass.viewer.render.culling.cull import Culler
from pointglass.viewer.render.culling.cull_kernels import FEW
from pointglass.viewer.render.raster.batches import BatchTable, PageMap

SCENE = room(5, 20_000)
CULLER = Culler(SCENE)
XYZ, _, _, _ = unpack(SCENE)
CELLS = SCENE.cell_of_points()
LODS = (None, 1e-3, 0.5, 8.0, 1e9)


def first_of_parts(parts: int) -> list[int]:
    """Halves of halves: 0, then the one midway, then those midway between the ones there are, ..."""
    order, step = [0], parts
    while step > 1:
        step //= 2
        order += [number + step for number in order]
    return order




def plain_select(scene: Scene, camera: Camera, lod: float | None, kept: np.ndarray) -> dict:
    """What Culler.select should give: every cell asked, all layers as one table.  The sums in the same order.  kept: (C,), the
    share of the points wanted of each cell."""
    size, r = scene.cell_size, camera.view_rotation
    left, right = camera.cx + 1.0, camera.width - camera.cx + 1.0
    top, bottom = camera.cy + 1.0, camera.height - camera.cy + 1.0
    planes = np.array([(camera.fx, 0, left), (-camera.fx, 0, right), (0, camera.fy, top), (0, -camera.fy, bottom), (0, 0, 1)])
    px, py, pz = ((scene.cell_coords + 0.5) * size + (scene.origin - camera.position)).T
    x, y, z = (r[k, 0] * px + r[k, 1] * py + r[k, 2] * pz for k in range(3))
    corner = r @ np.full(3, 0.5 * (scene.step - size))
    view = np.zeros((len(x), 4), np.float32)
    view[:, :3] = np.stack([x + corner[0], y + corner[1], z + corner[2]], axis=1)
    boxes = np.tile(WHOLE, (len(x), 1)) if scene.boxes is None else scene.boxes
    view[:, 3] = boxes.astype(float) @ 16.0 ** np.arange(6)
    share = 0.5 * size / SHARES
    low, high = boxes[:, :3].astype(int), boxes[:, 3:].astype(int)
    half = (high - low + 1) * share * (1 + 1e-9)
    if scene.boxes is not None:
        dx, dy, dz = ((low + high + 1 - SHARES) * share).T
        px, py, pz = px + dx, py + dy, pz + dz
        x, y, z = (at + (r[k, 0] * dx + r[k, 1] * dy + r[k, 2] * dz) for k, at in enumerate((x, y, z)))
    sloping = np.abs(planes @ r)
    reach = [s[0] * half[:, 0] + s[1] * half[:, 1] + s[2] * half[:, 2] for s in sloping]
    sides = (camera.fx * x + left * z, right * z - camera.fx * x, camera.fy * y + top * z, bottom * z - camera.fy * y, z)
    rows = np.flatnonzero(np.all([side + extra >= 0.0 for side, extra in zip(sides, reach, strict=True)], axis=0))
    counts = np.diff(scene.offsets).reshape(scene.layers, -1)[:, rows]
    if lod is not None:
        nearest = np.maximum((z - reach[4])[rows], 1e-9 * size)
        need = lod * ((size * camera.fx / nearest) * (size * camera.fy / nearest))
        if scene.faces is not None:
            shares = scene.faces[rows].astype(float)
            seen = shares[:, 0] * np.abs(px[rows]) + shares[:, 1] * np.abs(py[rows]) + shares[:, 2] * np.abs(pz[rows])
            need = np.where(scene.faces[rows, 0] == UNKNOWN, need, need * (seen / (SQUARES * np.maximum(z[rows], nearest))))
        need = need * kept[rows]
        turned = np.array([int(f"{row & 0xFFFF:016b}"[::-1], 2) for row in rows.tolist()], float)
        drawn = (need >= FEW) | (need * (65536.0 / FEW) > turned)
        rows, need, counts = rows[drawn], np.maximum(need[drawn], FEW), counts[:, drawn]
        held = np.cumsum(counts, axis=0)
        before = np.vstack([np.zeros((1, len(rows)), int), held[:-1]])
        counts = np.where(before >= need, 0, counts)
        order = first_of_parts(scene.parts)
        for layer, slot in np.argwhere((counts > 0) & (held > need)):
            number = np.arange(int(counts[layer, slot]))  # of those, every so many, then those midway, ...
            taken = int(np.ceil(scene.parts * (need[slot] - before[layer, slot]) / len(number)))
            counts[layer, slot] = np.isin(number % scene.parts, order[:taken]).sum()
    layer, slot = np.nonzero(counts)
    first = np.asarray(scene.offsets)[:-1].reshape(scene.layers, -1)[layer, rows[slot]]
    return {
        "first": first, "count": counts[layer, slot], "slot": slot, "cells": rows, "cell_view": view[rows],
        "axes": (r * scene.step).astype(np.float32), "points": int(counts.sum()),
    }  # fmt: skip


def as_dict(draw) -> dict:
    return {name: np.copy(getattr(draw, name)) for name in ("first", "count", "slot", "cells", "cell_view", "axes", "points")}


def cells_only(rng, cells: int, scale: float, reach: float) -> Scene:
    """A scene without points: clumps of cells, some layers of a cell and whole cells empty, far from the file's origin."""
    size = 2.0 ** round(np.log2(scale))
    clumps = rng.integers(-400, 400, (1 + cells // 200, 3))
    coords = clumps[rng.integers(0, len(clumps), cells)] + rng.integers(0, 12, (cells, 3))
    coords = np.unique(coords, axis=0).astype(np.int32)
    coords = coords[morton_order(coords - coords.min(axis=0))]
    layers = int(rng.integers(1, 15))
    count = rng.poisson(rng.choice([0.0, 3.0, 4000.0], len(coords)), (layers, len(coords)))
    offsets = np.concatenate([[0], np.cumsum(count.ravel())])
    origin = np.floor(rng.uniform(-reach, reach, 3)) * size
    low, high = coords.min(axis=0) * size + origin, (coords.max(axis=0) + 1) * size + origin
    empty = np.zeros((0, 3), np.uint32)
    faces = rng.integers(1, SQUARES + 1, (len(coords), 3)).astype(np.uint8)
    faces[rng.random(len(coords)) < 0.2] = UNKNOWN
    sides = np.sort(rng.integers(0, SHARES, (2, len(coords), 3)), axis=0).astype(np.uint8)
    boxes = np.hstack(list(sides)) if rng.integers(2) else None
    return Scene(empty, coords, offsets, origin, size, layers, int(offsets[-1]), 0.01 * size, np.array([low, high]),
                 parts=int(rng.choice([1, 8, 64])), faces=faces if rng.integers(2) else None, boxes=boxes)  # fmt: skip


def any_camera(rng, scene: Scene) -> Camera:
    """Anywhere near the scene, often on a cell's corner, looking at a cell or past all, any lens."""
    cell = scene.cell_min[rng.integers(len(scene.cell_coords))]
    eye = cell + rng.choice([0.0, rng.random(), 30 * rng.normal()], 3) * scene.cell_size
    aim = scene.cell_min[rng.integers(len(scene.cell_coords))] + rng.random(3) * scene.cell_size
    width, height = (int(n) for n in np.exp(rng.uniform(0, np.log(4000), 2)))
    focal = 0.5 * height / np.tan(np.radians(np.exp(rng.uniform(0, np.log(170)))) / 2)
    centre = np.array([width, height]) * (rng.uniform(-1, 2, 2) if rng.random() < 0.3 else 0.5)
    pose = look_at(eye, aim, rng.normal(size=3))
    return Camera(width, height, focal * rng.uniform(0.5, 2), focal, centre[0], centre[1], pose)


@given(st.integers(0, 10**9), st.floats(1.0, 170.0))
@settings(max_examples=examples(300), deadline=None)
def test_culling_never_drops_a_visible_point(number, fov):
    camera = camera_in(SCENE, number, (97, 61), fov)
    x, y, z = ((XYZ - camera.position) @ camera.view_rotation.T).T
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    rows = np.zeros(len(SCENE.cell_coords), bool)
    rows[CULLER.visible(camera)] = True
    assert rows[CELLS[inside]].all()


@pytest.mark.parametrize("block,cells,scale,reach", [
    *((block, *scene) for block in (1, 7, 64) for scene in ((1, 1.0, 0.0), (60, 1e-3, 1e6), (3000, 0.5, 1e4))),
    (7, 3000, 1e3, 0.0), (64, 20_000, 0.25, 1e7),
])  # fmt: skip
def test_two_levels_in_compiled_loops_give_what_plain_numpy_gives(seed, block, cells, scale, reach):
    rng = np.random.default_rng(seed)
    scene = cells_only(rng, cells, scale, reach)
    culler = Culler(scene, block=block)
    found = 0
    for number in range(40):
        camera, lod = any_camera(rng, scene), LODS[number % len(LODS)]
        got, share = as_dict(culler.select(camera, lod)), np.ones(len(scene.cell_coords))
        if scene.faces is not None and lod is not None:
            share = np.repeat(culler.share, block)[: len(share)]
        wanted = plain_select(scene, camera, lod, share)
        assert np.array_equal(culler.visible(camera, lod or 0.0), wanted["cells"]), f"frustum {number}: {camera}"
        for name, value in wanted.items():
            assert np.array_equal(got[name], value), f"{name}, lod {lod}, frustum {number}: {camera}"
        found += 0 < len(wanted["cells"]) < len(scene.cell_coords) or cells == 1
    assert found > 3  # or nothing was tested


@pytest.mark.parametrize("number", range(5))
def test_without_level_of_detail_every_point_of_a_visible_cell_is_drawn_once(number):
    draw = CULLER.select(camera_in(SCENE, number))
    drawn = np.zeros(SCENE.count, int)
    for first, count in zip(draw.first, draw.count, strict=True):
        drawn[first : first + count] += 1
    assert np.array_equal(drawn == 1, np.isin(CELLS, draw.cells)) and drawn.max() <= 1
    assert (np.diff(draw.first) > 0).all() and draw.points == drawn.sum()


def test_level_of_detail_draws_fewer_points_and_what_it_draws_stays():
    """With more points wanted, those drawn before are drawn too, so that nothing flickers; and not many more than wanted."""
    scene = room(6, 400_000)
    camera = camera_in(scene, 2, (80, 60))
    drawn, points = {}, {}
    for parts in (1, 8, 64):
        culler = Culler(replace(scene, parts=parts))
        for lod in (0.25, 0.3, 0.5, 0.7, 2.0, 8.0, None):
            draw = culler.select(camera, lod)
            drawn[lod] = np.zeros(scene.count, bool)
            for first, count in zip(draw.first, draw.count, strict=True):
                drawn[lod][first : first + count] = True
            assert drawn[lod].sum() == draw.points
            points[parts, lod] = draw.points
            assert {int(f) for f in draw.first} <= {int(o) for o in scene.offsets}
        for less, more in itertools.pairwise(drawn):
            assert not (drawn[less] & ~drawn[more]).any()
    assert points[64, 0.25] < points[64, 0.3] < points[64, 0.5]
    assert all(points[64, lod] <= points[8, lod] <= points[1, lod] for lod in drawn) and points[64, 0.5] < 0.9 * points[1, 0.5]


@pytest.mark.parametrize("lod", [0.5, 1.0])
def test_a_wall_gets_as_many_points_as_it_covers_pixels(seed, lod):
    """A dense wall, seen squarely and along it: about as many points are drawn as it covers pixels, times the level."""
    rng = np.random.default_rng(seed)
    wall = np.stack([rng.uniform(0, 8, 1_500_000), rng.normal(0, 1e-3, 1_500_000) + 0.01, rng.uniform(0, 2, 1_500_000)], 1)
    scene = scene_from_arrays(wall, np.zeros(wall.shape, np.uint8))
    for eye in ((4.0, -6.0, 1.0), (-2.0, -0.7, 1.0)):
        camera = Camera(320, 240, 200.0, 200.0, 160.0, 120.0, look_at(np.array(eye), np.array([4.0, 0.0, 1.0])))
        x, y, z = ((wall - camera.position) @ camera.view_rotation.T).T
        inside = (z > 0) & (np.abs(x / z) < 0.8) & (np.abs(y / z) < 0.6)
        covered = len(np.unique((200 * y / z + 120)[inside].astype(int) * 320 + (200 * x / z + 160)[inside].astype(int)))
        wanted, plain = (Culler(s).select(camera, lod).points for s in (scene, replace(scene, faces=None)))
        assert 0.8 * lod * covered < wanted < 3 * lod * covered  # cells reach beyond the picture
        assert wanted < (1.15 if eye[1] < -1 else 0.6) * plain


def walls_of_cells(depths: list[int], side: int = 40) -> Scene:
    """Walls across y of side x side cells, each covered wholly, 600 points in each cell."""
    x, z = np.meshgrid(np.arange(side), np.arange(side))
    coords = np.concatenate([np.stack([x.ravel(), np.full(x.size, depth), z.ravel()], axis=1) for depth in depths])
    coords = coords[morton_order(coords)].astype(np.int32)
    faces = np.tile(np.array([0, SQUARES, 0], np.uint8), (len(coords), 1))
    ends = np.arange(len(coords) + 1) * 600
    bounds = np.array([coords.min(axis=0), coords.max(axis=0) + 1]).astype(float)
    return Scene(np.zeros((0, 3), np.uint32), coords, ends, np.zeros(3), 1.0, 1, int(ends[-1]), 0.01, bounds,
                 parts=64, faces=faces)  # fmt: skip


def test_what_many_surfaces_hide_is_thinned_and_what_stands_alone_is_not():
    eye = np.array([20.0, -60.0, 20.0])
    camera = Camera(320, 240, 200.0, 200.0, 160.0, 120.0, look_at(eye, eye + (0.0, 1.0, 0.0)))
    one = Culler(walls_of_cells([0])).select(camera, 1.0).points
    few = Culler(walls_of_cells([0, 4]))
    assert few.select(camera, 1.0).points > one and (few.share == 1.0).all()
    for walls in (20, 100):
        culler = Culler(walls_of_cells(list(range(0, 4 * walls, 4))))
        draw = culler.select(camera, 1.0)
        assert one < draw.points < 2.5 * ENOUGH * one and culler.share.min() > 0
        depth = culler.scene.cell_coords[:: 64, 1]
        assert (culler.share[depth < 8] == 1.0).all() and culler.share[depth > 4 * (ENOUGH + 8)].max() < 1.0
        assert culler.select(camera).points == culler.scene.count  # without a level of detail
    eye = np.array([20.0, -3.0, 20.0])  # blocks of the next walls lie around the camera: they cover by cells
    culler = Culler(walls_of_cells(list(range(0, 80, 4))))
    culler.select(replace(camera, camera_to_world=look_at(eye, eye + (0.0, 1.0, 0.0))), 1.0)
    depth = culler.scene.cell_coords[:, 1]
    thinned = np.repeat(culler.share < 1.0, 64)[: len(depth)]
    assert 4 * (ENOUGH - 1) < depth[thinned].min() <= 4 * (ENOUGH + 1)


def test_a_view_past_everything_draws_nothing():
    low, high = SCENE.bounds
    away = Camera(64, 48, 60.0, 60.0, 32.0, 24.0, look_at(high + 10, high + (high - low) + 20))
    draw = CULLER.select(away)
    for lod in LODS:
        draw = CULLER.select(away, lod)
        lists = (draw.first, draw.count, draw.slot, draw.cells, draw.cell_view)
        assert draw.points == 0 and not any(map(len, lists))
    table = BatchTable(4, (0, 1, 2), 256)
    assert len(table.fill(draw, PageMap(np.zeros(1, np.int32), 1, 16, 1, True))) == 0 and table.bounds.tolist() == [0, 0]


@pytest.mark.parametrize("lod", [None, 1e9])
def test_a_steady_frame_allocates_nothing_that_grows_with_the_scene(lod):
    scene = cells_only(np.random.default_rng(3), 20_000, 0.5, 100.0)
    scene = replace(scene, faces=np.full((len(scene.cell_coords), 3), SQUARES, np.uint8))
    culler, table = Culler(scene), BatchTable(4, (0, 1, 2), 256)
    where = PageMap(np.arange(scene.count // 65536 + 1, dtype=np.int32), 8, 16, scene.count // (8 * 65536) + 1, True)
    cameras = [replace(any_camera(np.random.default_rng(number), scene), width=640, height=480) for number in range(30)]

    def turn() -> list[int]:
        places, listed = [], 0
        for camera in cameras:
            draw = culler.select(camera, lod)
            table.fill(draw, where)
            listed = max(listed, draw.first.nbytes)
            scratch = *culler._crowding, *culler._scratch, culler.share  # what a compiled loop allocates itself is not traced
            places += [array.ctypes.data for array in (draw.first, draw.count, draw.slot, draw.cell_view, *scratch)]
        assert listed > 100_000  # lists worth counting
        return places

    for _ in range(20):
        places = turn()
    # The least of several turns: numba keeps some 1,300 small objects (70 KB), of whatever scene, over the first turns.
    growths, peaks = [], []
    for _ in range(6):
        tracemalloc.start()
        try:
            before = tracemalloc.get_traced_memory()[0]
            again = turn()
            after, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert again == places  # the same memory, frame after frame
        growths.append(after - before)
        peaks.append(peak - before)
    assert min(growths) < 20_000 and min(peaks) < 40_000


def plain_pieces(draw, where: PageMap, group) -> list[tuple[int, int, int, int]]:
    """(page, group, index in the page, slot) of every point whose chunk is there, from the definition alone."""
    out = []
    for first, count, slot in zip(draw.first.tolist(), draw.count.tolist(), draw.slot.tolist(), strict=True):
        for p in range(first, first + count):
            place = int(where.slot_of_chunk[p >> where.shift])
            if place >= 0:
                index = (place % where.slots_per_page << where.shift) + (p & ((1 << where.shift) - 1))
                out.append((place // where.slots_per_page, int(group[slot]), index, slot))
    return out


@pytest.mark.parametrize("shift", [3, 6, 9])
@pytest.mark.parametrize("whole", [True, False])
def test_batches_cover_every_point_that_is_there_once_by_page_and_group(seed, shift, whole):
    rng = np.random.default_rng(seed)
    camera = camera_in(SCENE, seed, (97, 61), 90.0)
    draw = Culler(SCENE).select(camera, 2.0)
    chunks, per_page = (SCENE.count >> shift) + 1, int(rng.integers(1, 9))
    slots = np.arange(chunks, dtype=np.int32)
    if not whole:
        slots[:] = rng.permutation(2 * chunks)[:chunks]
        slots[rng.random(chunks) < 0.3] = -1
    pages = int(slots.max(initial=0)) // per_page + 1
    where = PageMap(slots, per_page, shift, pages, whole)
    for size in (1, 16, 256):
        for groups in (1, 2):
            group = rng.integers(0, groups, len(draw.cells)).astype(np.uint8)
            table = BatchTable(4, (0, 1, 2), size, {3: 77})
            rows = table.fill(draw, where, group=group if groups > 1 else None, groups=groups)
            assert (rows[:, 3] == 77).all() and rows[:, 1].max(initial=0) <= size and rows[:, 1].min(initial=1) > 0
            key = np.repeat(np.arange(pages * groups), np.diff(table.bounds))
            got = [(k // groups, k % groups, index + n, slot)
                   for k, (index, count, slot, _) in zip(key.tolist(), rows.tolist(), strict=True) for n in range(count)]
            wanted = plain_pieces(draw, where, group)
            assert sorted(got) == sorted(wanted)
            assert table.absent == draw.points - len(wanted)
            assert (rows[:, 0] % (per_page << shift) + rows[:, 1] <= per_page << shift).all()  # each within its page
