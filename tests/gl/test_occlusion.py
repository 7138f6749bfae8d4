"""Occlusion in two phases: what history leaves out is not missed, whatever happens between two frames.

A floor of furnished rooms, few pixels: walls hide most of it from everywhere.  Wrong pixels as in
viewer.bench.cases.occlusion_walk.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from clouds import room

from pointglass.model.reference import depth_filter
from pointglass.model.reference.projection import SoftZ
from pointglass.model.reference.pyramid import parents
from pointglass.viewer.bench.cases.occlusion_walk import LEVELS, LIMIT, VIEWS, compare, walk
from pointglass.viewer.bench.procedural_scan import EYE, PITCH, ProceduralScan, procedural_scene
from pointglass.viewer.grid.cell_boxes import SHARES
from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.culling.cull import Culler
from pointglass.viewer.render.culling.occlusion import (
    BLOCK_SHIFT,
    GAP_LEVELS,
    LAST,
    ROUNDS,
    SEEN,
    WORTH,
    Occlusion,
    OcclusionPasses,
    batches_of,
)
from pointglass.viewer.render.device.shader import BATCH
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl

SIZE = (128, 96)
FULL = (4, 0.3)
"""A room, and a heading in it, with much behind the walls."""
SPOT = 0.01
"""Of so small a picture: where what is hidden sways the filter, some tens of pixels change, be the picture large or small."""
SETTINGS = Settings(view="filled", raster="compute")


@pytest.fixture(scope="module")
def floor(context):
    scan = ProceduralScan(1_000_000, 9, seed=1)
    scene = procedural_scene(scan)
    renderer = Renderer(context, scene, raster="compute")
    yield SimpleNamespace(scan=scan, scene=scene, renderer=renderer)
    renderer.release()


def standing(scan: ProceduralScan, where: int, heading: float, size=SIZE) -> Camera:
    """Near the middle of a room, at eye height."""
    eye = scan.room_middle(where) + (-0.8, 0.3, EYE)
    return from_fov(size[0], size[1], 60.0, look_at(eye, eye + (np.cos(heading), np.sin(heading), -0.1)))


def picture(renderer: Renderer, camera: Camera, history: Occlusion | None = None, settings=SETTINGS, views=VIEWS):
    """(keep-mask, filled picture, stats), copies."""
    frame = renderer.render(camera, settings, views, history)
    return frame.mask().copy(), frame.image(views[-1]).copy(), frame.stats


def wrong(one, other) -> float:
    """Share of pixels whose keep-mask differs or whose filled colour does by more than LEVELS."""
    return float(((one[0] != other[0]) | (np.abs(one[1].astype(int) - other[1]) > LEVELS).any(axis=-1)).mean())


def equal(one, other) -> bool:
    return one[0].tobytes() == other[0].tobytes() and one[1].tobytes() == other[1].tobytes()


def settled(renderer: Renderer, camera: Camera, memory: Occlusion):
    """The third picture from one place: what the second found hidden by what had come into view is not drawn any more."""
    return [picture(renderer, camera, memory) for _ in range(3)][-1]


def is_first(renderer: Renderer, camera: Camera, one) -> bool:
    """Whether a picture was made as by one who remembers nothing."""
    fresh = picture(renderer, camera, Occlusion())
    return equal(fresh, one) and fresh[2]["occlusion"] == one[2]["occlusion"]


def hidden(stats: dict) -> int:
    return stats["occlusion"]["cells_hidden"]


def test_a_walk_with_a_jump_looks_the_same_and_draws_less(floor):
    cameras, jump = walk(floor.scan, SIZE, 15)
    rows, _ = compare(floor.renderer, cameras, SETTINGS)
    assert max(row["wrong"] for row in rows) < LIMIT
    assert rows[0]["cells_hidden"] > 0  # the nearest cells hide, where nothing is known yet
    past = [row for number, row in enumerate(rows) if number not in (0, jump)]
    assert np.median([row["points_with"] / row["points"] for row in past]) < 0.8
    assert all(row["points_with"] <= row["points"] for row in rows)


def test_no_jump_loses_a_pixel_in_its_first_frame(floor, seed):
    """From anywhere to anywhere: to another room, about, out of the house and back."""
    rng = np.random.default_rng(seed)
    memory, looked, saved = Occlusion(), [], 0
    for number in range(10):
        camera = standing(floor.scan, int(rng.integers(9)), rng.uniform(0, 2 * np.pi))
        if number == 5:
            camera = from_fov(*SIZE, 60.0, look_at(PITCH * (1.5, -2.0, 1.0), PITCH * (1.5, 1.5, 0.5)))
        plain = picture(floor.renderer, camera)
        first, again = picture(floor.renderer, camera, memory), picture(floor.renderer, camera, memory)
        looked += [wrong(plain, first), wrong(plain, again)]
        assert max(looked[-2:]) < SPOT, number
        saved += plain[2]["points_drawn"] - again[2]["points_drawn"]
    assert np.mean(looked) < LIMIT
    assert saved > 0  # or nothing was tested


def test_the_hidden_count_is_what_was_not_listed(floor):
    """Points and cells, counted from the lists that were drawn."""
    memory, renderer = Occlusion(), floor.renderer
    saved = 0
    for heading in (0.3, 0.5, 2.5):
        camera = standing(floor.scan, FULL[0], heading)
        plain = picture(renderer, camera)[2]
        stats = picture(renderer, camera, memory)[2]
        rasteriser, hider = renderer._passes.rasterisers["compute"], renderer._passes.rasterisers["compute"].hider
        bounds, rows = rasteriser.table.bounds, rasteriser.table.rows
        commands = np.frombuffer(hider._commands.buffer.read(), np.uint32)
        appended = np.frombuffer(hider._appended.buffer.read(), np.uint32).reshape(-1, 4)
        points, cells = 0, 0
        for page in range(len(renderer.pages.buffers)):
            drawn = [rows[slice(*batches_of(bounds, page, 0))]]
            for number in range(1, LAST + 1):
                command = commands[4 * (page * LAST + number - 1) :][:4]
                drawn.append(appended[batches_of(bounds, page, number)[0] :][: command[3]])
                assert rasteriser.workgroup.rows * command[0] * command[1] >= len(drawn[-1])  # enough workgroups for them
            points += sum(int(batches[:, 1].sum()) for batches in drawn)
            cells += sum(len(np.unique(batches[:, 2])) for batches in drawn)
        left_out = stats["occlusion"]
        assert points == stats["points_drawn"] == plain["points_drawn"] - left_out["points_hidden"]
        assert cells == stats["cells_drawn"] - left_out["cells_hidden"] and stats["cells_drawn"] == plain["cells_drawn"]
        assert "hidden cells skipped" in stats["approximations"] and "occlusion" not in plain
        saved += hidden(stats)
    assert saved > 0


def what_hides(scene, frame) -> np.ndarray:
    """(H, W): the inverse depth below which a point shows nowhere, by the filter's reference in torch."""
    depth = torch.from_numpy(frame.depth().copy())
    pyramid = list(zip(*depth_filter._near_pyramid(depth, GAP_LEVELS), strict=True))
    threshold = depth_filter._hiding_threshold(*pyramid[-1], 1.0, GAP_LEVELS)
    for level in range(GAP_LEVELS - 1, 0, -1):
        own = depth_filter._hiding_threshold(*pyramid[level], 1.0, level)
        threshold = torch.maximum(own, parents(threshold, *own.shape))
    soft = SoftZ.preset("auto", scene.spacing, 1.0)
    behind = 1.0 / torch.maximum(depth * (1.0 + soft.relative), depth + soft.absolute)
    return torch.maximum(parents(threshold, *depth.shape), behind).numpy()


def lowest(level: np.ndarray, side: int) -> np.ndarray:
    """Of each block of ``side`` by ``side``, those at the border cut off by it."""
    rows, columns = (np.arange(0, n, side) for n in level.shape)
    return np.minimum.reduceat(np.minimum.reduceat(level, rows, axis=0), columns, axis=1)


@pytest.mark.parametrize("size", [SIZE, (97, 61), (63, 130)])
def test_each_level_of_the_pyramid_is_the_lowest_of_what_hides(floor, size):
    memory, camera = Occlusion(), standing(floor.scan, *FULL, size=size)
    for _ in range(2):
        frame = floor.renderer.render(camera, SETTINGS, VIEWS, memory)
    hider = floor.renderer._passes.rasterisers["compute"].hider
    pyramid, level = np.frombuffer(hider._pyramid.read(), np.float32), lowest(what_hides(floor.scene, frame), 1 << BLOCK_SHIFT)
    while True:
        assert np.allclose(pyramid[: level.size].reshape(level.shape), level, rtol=1e-6, atol=0)
        pyramid = pyramid[level.size :]
        if level.size == 1:
            break
        level = lowest(level, 2)
    assert len(pyramid) == 0


def test_what_is_said_of_a_frame_is_the_same_when_the_next_is_there(floor):
    cameras, memory = [standing(floor.scan, FULL[0], heading) for heading in (0.3, 2.5)], Occlusion()
    frames = [floor.renderer.render(camera, SETTINGS, VIEWS, memory) for camera in cameras]
    late, memory = [frame.stats["occlusion"] for frame in frames], Occlusion()
    assert late == [picture(floor.renderer, camera, memory)[2]["occlusion"] for camera in cameras] and late[0] != late[1]


@pytest.mark.parametrize("where", [FULL, (4, 1.2), (0, 2.0), (7, 4.0), (2, 5.5)])
def test_what_hides_is_what_the_filter_says(floor, where):
    """The cells' verdicts against every pixel they could touch."""
    memory, renderer, scene = Occlusion(), floor.renderer, floor.scene
    camera = standing(floor.scan, *where)
    renderer.render(camera, SETTINGS, VIEWS, memory)
    frame = renderer.render(camera, SETTINGS, VIEWS, memory)
    hider = renderer._passes.rasterisers["compute"].hider
    occluder = what_hides(scene, frame)
    side = 1 << BLOCK_SHIFT
    blocks = occluder.reshape(SIZE[1] // side, side, SIZE[0] // side, side).min(axis=(1, 3))
    assert where != FULL or np.count_nonzero(blocks) > 0.2 * blocks.size

    draw = Culler(scene).select(camera)
    flags = np.frombuffer(hider._flags.buffer.read(), np.uint32)[: len(draw.cells)]
    share = np.linspace(0.0, 1.0, 24)
    spread = np.array(np.meshgrid(share, share, share)).reshape(3, -1).T
    agreed = slanted = 0
    for cell, seen in zip(draw.cells, flags & SEEN, strict=True):
        low, high = scene.boxes[cell].reshape(2, 3) + np.array([[0], [1]])
        places = (low + spread * (high - low)) * (scene.cell_size / SHARES)
        x, y, z = camera.view_rotation @ (scene.cell_min[cell] + places - camera.position).T
        if z.min() <= 0:
            assert seen
            continue
        u, v = (np.floor(w).astype(int) for w in (camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy))
        inside = (u >= 0) & (u < SIZE[0]) & (v >= 0) & (v < SIZE[1])
        over = occluder[v[inside], u[inside]]
        away = (1.0 / z[inside] < over).all()  # every place in it lies behind what is drawn there
        assert away or seen, cell
        agreed += away and not seen
        slanted += not seen and inside.any() and 1.0 / z.min() >= over.min()  # its nearest corner alone would not tell
    assert where != FULL or (agreed > 10 and slanted > 0)


@pytest.mark.parametrize("levels, strength", [(None, 0.3), (1, 1.0), (3, 3.0)])
def test_settings_of_the_filter_are_heeded(floor, levels, strength):
    settings = Settings(view="filled", raster="compute", filter_levels=levels, filter_strength=strength, lod=4.0)
    memory = Occlusion()
    for heading in (0.0, 0.15, 0.3, 3.0):
        camera = standing(floor.scan, 4, heading)
        plain, got = (picture(floor.renderer, camera, history, settings) for history in (None, memory))
        assert wrong(plain, got) < LIMIT


def test_a_new_picture_size_is_a_first_frame(floor):
    memory = Occlusion()
    for size in (SIZE, (97, 61), SIZE):
        camera = standing(floor.scan, *FULL, size=size)
        plain = picture(floor.renderer, camera)
        first, later = picture(floor.renderer, camera, memory), settled(floor.renderer, camera, memory)
        assert is_first(floor.renderer, camera, first)
        assert wrong(plain, later) < LIMIT and hidden(later[2]) > hidden(first[2])


def test_another_scene_is_a_first_frame(context, floor):
    other = Renderer(context, room(8, 300_000), raster="compute")
    memory = Occlusion()
    inside = from_fov(*SIZE, 60.0, look_at((3.0, 2.5, 1.5), (0.0, 0.5, 1.0)))
    here = standing(floor.scan, *FULL)
    try:
        for renderer, camera in ((other, inside), (floor.renderer, here), (other, inside)):
            plain, first = picture(renderer, camera), picture(renderer, camera, memory)
            second = picture(renderer, camera, memory)
            assert is_first(renderer, camera, first)
            assert wrong(plain, first) < LIMIT and wrong(plain, second) < LIMIT
        picture(floor.renderer, here, memory)
        assert hidden(picture(floor.renderer, here, memory)[2]) > 0
    finally:
        other.release()


def test_forget_and_frames_of_another_make_a_first_frame(floor):
    camera = standing(floor.scan, *FULL)
    plain, memory = picture(floor.renderer, camera), Occlusion()
    picture(floor.renderer, camera, memory)
    assert hidden(picture(floor.renderer, camera, memory)[2]) > 0
    memory.forget()
    first = picture(floor.renderer, camera, memory)
    assert wrong(plain, first) < LIMIT and is_first(floor.renderer, camera, first)
    picture(floor.renderer, standing(floor.scan, 0, 0.3), Occlusion())
    first = picture(floor.renderer, camera, memory)
    assert wrong(plain, first) < LIMIT and is_first(floor.renderer, camera, first)


@pytest.mark.parametrize("views, settings", [
    (("raw",), SETTINGS),
    (("filtered", "raw"), SETTINGS),
    (VIEWS, Settings(view="filled", raster="points")),
    (VIEWS, Settings(view="filled", raster="compute", filter="off")),
    (VIEWS, Settings(view="filled", raster="compute", filter="paper-code")),
])  # fmt: skip
def test_where_hiding_would_show_nothing_is_hidden_and_the_memory_is_kept(floor, views, settings):
    memory = Occlusion()
    camera = standing(floor.scan, *FULL)
    known = settled(floor.renderer, camera, memory)
    frames = [floor.renderer.render(camera, settings, views, history) for history in (None, memory)]
    stats, looks = frames[1].stats, []
    for history in (None, memory):
        frame = floor.renderer.render(camera, settings, views, history)
        looks.append([frame.image(view).tobytes() for view in views] + [frame.depth().tobytes()])
    assert looks[0] == looks[1] and "occlusion" not in stats and "hidden cells skipped" not in stats["approximations"]
    assert hidden(picture(floor.renderer, camera, memory)[2]) == hidden(known[2]) > 0


def test_near_cells_are_tested_before_those_that_they_may_hide(floor):
    """In rounds of so many points a pixel; what is known to be visible is drawn without a test."""
    camera = standing(floor.scan, *FULL)
    draw = Culler(floor.scene).select(camera)
    points = np.bincount(draw.slot, draw.count, len(draw.cells))
    distance = np.linalg.norm(draw.cell_view[:, :3], axis=1)
    hider = SimpleNamespace(lag=1, size=SIZE, begin=lambda: 1, flags_of=lambda *_: np.where(distance < 4.0, SEEN, 0))
    memory = Occlusion()
    for known in (np.zeros(len(distance), bool), distance < 4.0):  # a first frame and a second one
        rounds = memory.recall(floor.scene, draw, hider).copy()
        assert np.array_equal(rounds == 0, known)
        for number, most in enumerate(ROUNDS, 1):
            nearer, farther = ~known & (rounds <= number), rounds > number
            assert points[nearer].sum() > most * SIZE[0] * SIZE[1] or not farther.any()
            assert not nearer.any() or not farther.any() or distance[nearer].max() <= distance[farther].min()
        assert rounds.max() > 1


def test_a_frame_that_fails_on_its_way_is_forgotten(floor, monkeypatch):
    """Memory ran out between taking note of the cells and the passes: the flags there are belong to an earlier frame."""
    memory, elsewhere = Occlusion(), standing(floor.scan, 2, 1.0)
    settled(floor.renderer, standing(floor.scan, *FULL), memory)

    def no_room(*_):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(OcclusionPasses, "start", no_room)
        with pytest.raises(MemoryError):
            picture(floor.renderer, elsewhere, memory)
    camera = standing(floor.scan, *FULL)
    plain, got = picture(floor.renderer, camera), picture(floor.renderer, camera, memory)
    assert wrong(plain, got) < LIMIT and is_first(floor.renderer, camera, got)


def test_a_view_of_nothing_and_back(floor):
    memory = Occlusion()
    here = standing(floor.scan, *FULL)
    away = from_fov(*SIZE, 60.0, look_at((-50.0, 0.0, 90.0), (-80.0, 0.0, 200.0)))
    picture(floor.renderer, here, memory)
    mask, _, stats = picture(floor.renderer, away, memory)
    assert stats["points_drawn"] == stats["cells_drawn"] == 0 and not mask.any()
    assert equal(picture(floor.renderer, here), picture(floor.renderer, here, memory))


def test_several_pages_and_many_batches(context, floor, monkeypatch):
    """Storage blocks that hold a tenth of the scene: a list a page, and more batches than one row of workgroups."""
    from pointglass.viewer.render.culling import occlusion
    from pointglass.viewer.render.device import compute_pass
    from pointglass.viewer.render.raster.points import PointPages

    limit = max(16 * SIZE[0] * SIZE[1], floor.scene.count * 12 // 10)
    for module in (occlusion, compute_pass):
        monkeypatch.setattr(module, "MAX_GROUPS", 5)
    small = Renderer(context, floor.scene, raster="compute")
    small.pages.release()
    small.pages = PointPages(context, floor.scene, limit)
    memory = Occlusion()
    try:
        assert len(small.pages.buffers) > 3 and small.pages.size > BATCH
        for heading in (0.0, 0.2, 0.4):
            camera = standing(floor.scan, 4, heading)
            plain, got = picture(floor.renderer, camera), picture(small, camera, memory)
            assert wrong(plain, got) < LIMIT and plain[2]["points_drawn"] >= got[2]["points_drawn"]
        assert hidden(got[2]) > 0
    finally:
        small.release()


@pytest.mark.parametrize("size", [SIZE, (640, 480)])
def test_where_there_is_little_to_hide_nothing_is_looked_for(floor, size):
    """Few points a pixel: the passes that look would cost more than they save."""
    memory, camera = Occlusion(), standing(floor.scan, *FULL, size=size)
    plain, first, again = (picture(floor.renderer, camera, history) for history in (None, memory, memory))
    few = plain[2]["points_drawn"] < WORTH * size[0] * size[1]
    assert few == (size != SIZE), plain[2]["points_drawn"]
    for one in (first, again):
        assert few == ("occlusion" not in one[2])
    assert equal(plain, first) and (equal(plain, again) or not few)
