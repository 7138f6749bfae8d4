"""Points that come when they are needed: a scene that fits opens with its coarse layers, and no byte of a picture tells."""

import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from clouds import camera_in
from paged import CHUNK_BYTES, CHUNKS, POINTS, SCENE, draw_list, drawn, expected, on_disk, pages_of, plain_batches

from pointglass.viewer.common.errors import DeviceError
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.shader import BATCH
from pointglass.viewer.render.raster.batches import PageMap
from pointglass.viewer.render.raster.points import PointPages
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.window.viewport.viewport import Viewport

pytestmark = pytest.mark.gl

COARSE = int(SCENE.offsets[len(SCENE.cell_coords)])  # points of the coarsest layer
AHEAD = -(-COARSE // POINTS)
assert SCENE.layers > 1 and 0 < AHEAD < CHUNKS // 2


def opened(context, scene=SCENE, **options):
    return pages_of(context, scene, slots=CHUNKS + 10, overview=COARSE, **options)


@pytest.mark.parametrize("software", [True, False])
def test_a_scene_that_fits_opens_with_its_coarse_layers_and_draws_what_is_asked_of_it(context, tmp_path, software):
    rng = np.random.default_rng(1)
    pages = opened(context, on_disk(tmp_path), software=software)
    try:
        assert np.flatnonzero(pages.slot_of_chunk >= 0).tolist() == list(range(AHEAD))
        assert (len(pages.buffers) == -(-CHUNKS // 9)) != software  # in software, made when needed
        for share in (0.0, 0.02, 0.3):
            first, count = draw_list(rng, share)
            before = pages.slot_of_chunk >= 0
            (part,) = pages.prepare(first, count)
            made = len(pages.buffers)
            pages.load(part)
            assert len(pages.buffers) == made  # while the round is drawn they stay
            there = np.flatnonzero(pages.slot_of_chunk >= 0)
            assert (pages.slot_of_chunk[there] == there).all()
            assert set(there) == set(np.flatnonzero(before)) | set(part.chunks)  # and nothing that was not asked for
            assert not PageMap.of(pages, BATCH).whole
            assert np.array_equal(drawn(pages, plain_batches(first, count, pages, 0, SCENE.count)), expected(first, count))
        pages.load_all()
        assert PageMap.of(pages, BATCH).whole and pages.slot_of_chunk.tolist() == list(range(CHUNKS))
        for page, buffer in enumerate(pages.buffers):
            held = np.frombuffer(buffer.read(), np.uint32).reshape(-1, 3)
            assert np.array_equal(held, SCENE.points[page * pages.size :][: pages.size + BATCH])
    finally:
        pages.release()


@pytest.mark.parametrize("seed", range(3))
def test_what_a_moving_picture_needs_comes_first_and_then_all_the_rest(context, seed):
    rng = np.random.default_rng(seed)
    news, before = threading.Event(), set(threading.enumerate())
    pages = opened(context, upload=3 * CHUNK_BYTES, wake=news.set)
    try:
        first, count = draw_list(rng, 0.1)
        needed = set(pages.residency.need(first, count).tolist())
        order: list[int] = []

        def until(done, step) -> None:
            for _ in range(1000):
                held = pages.slot_of_chunk >= 0
                step()
                new = np.flatnonzero((pages.slot_of_chunk >= 0) & ~held)
                assert len(new) <= 3
                order.extend(new.tolist())
                if done():
                    return
                if not pages.arrived:
                    assert news.wait(30)
                news.clear()
            raise AssertionError("never done")

        until(lambda: not pages.pending, lambda: pages.prepare(first, count, streaming=True))
        (part,) = pages.prepare(first, count, streaming=True)
        times = drawn(pages, plain_batches(first, count, pages, part.start, part.stop))
        assert np.array_equal(times, expected(first, count)) and not pages.approximations
        assert order and set(order) <= needed and pages.idle
        pages.load(pages.prepare(*draw_list(rng, 0.1))[0])  # a screenshot, say
        assert pages.idle and not pages.arrived
        until(lambda: pages.residency.complete, pages.take_in)
        assert not pages.take_in() and set(threading.enumerate()) <= before  # nothing left to read
        assert pages.slot_of_chunk.tolist() == list(range(CHUNKS))
    finally:
        pages.release()


@pytest.mark.parametrize("kind", ["compute", "points", "cpu"])
@pytest.mark.parametrize("slots", [20, CHUNKS + 10])
def test_where_and_when_points_came_changes_no_byte_of_an_exact_picture(context, tmp_path, kind, slots):
    whole, other = Renderer(context, SCENE), Renderer(context, SCENE)
    other.pages.release()
    other.pages = pages_of(context, on_disk(tmp_path), slots=slots, software=True, overview=COARSE)
    several, budget = 0, slots * CHUNK_BYTES
    try:
        assert whole.pages.residency.complete and not other.pages.residency.complete
        for seed in range(6):
            camera, settings = camera_in(SCENE, seed, (160, 120)), Settings(raster=kind)
            frames = [renderer.render(camera, settings, views=("raw", "filtered")) for renderer in (whole, other)]
            assert frames[0].image("raw").tobytes() == frames[1].image("raw").tobytes(), seed
            assert frames[0].depth().tobytes() == frames[1].depth().tobytes() and frames[1].depth().size
            draw = other._culler.select(camera, None)
            several += len(other.pages.prepare(draw.first, draw.count)) > 1
            assert other.pages.nbytes <= budget
        assert (several > 0) == (slots < CHUNKS)
    finally:
        whole.release()
        other.release()


def test_a_chunk_that_cannot_be_read_is_missed_when_it_is_needed_and_no_sooner(context, tmp_path):
    scene = on_disk(tmp_path)
    bad = CHUNKS - 2
    with open(scene.points.filename, "r+b") as file:
        file.truncate(scene.points.offset + bad * CHUNK_BYTES + 5)
    pages = opened(context, scene)
    try:
        first, count = np.array([0]), np.array([bad * POINTS])
        pages.load(pages.prepare(first, count)[0])
        for _ in range(10_000):
            pages.take_in()
            if pages.problem and not pages._reader.left:
                break
        assert pages.problem and "points.npy: damaged grid" in pages.problem
        assert pages.lost == pages.missing == 0 and not pages.residency.complete
        pages.prepare(first, np.array([SCENE.count]), streaming=True)
        assert pages.lost == SCENE.count - bad * POINTS and not pages.pending
    finally:
        pages.release()


def test_at_rest_points_that_no_picture_waits_for_come_without_a_picture(context):
    """The window's painter: a picture that lacks points is made again, another is left as it is."""
    session = SimpleNamespace(picture=SimpleNamespace(dirty=False), flight=SimpleNamespace(moving=False))
    painter = Viewport(context, session, memory=None, wake=lambda: None)  # type: ignore[arg-type]
    assert not painter.note_arrivals()
    pages = opened(context, upload=2 * CHUNK_BYTES)
    painter.renderer = SimpleNamespace(pages=pages, release=pages.release, photographs=SimpleNamespace(arrived=False))  # type: ignore[assignment]

    def arrived() -> None:
        with pages._reader._news:
            assert pages._reader._news.wait_for(lambda: pages.arrived, 30)

    try:
        first, count = np.array([0]), np.array([SCENE.count])
        pages.prepare(first, count, streaming=True)
        assert pages.pending
        arrived()
        held = pages.residency.absent
        session.flight.moving = True
        assert not painter.note_arrivals() and not session.picture.dirty and pages.residency.absent == held
        session.flight.moving = False
        asked, request = [], pages._reader.request
        pages._reader.request = lambda chunks: (asked.append(chunks), request(chunks))  # type: ignore[method-assign]
        painter.note_arrivals()
        assert session.picture.dirty and pages.residency.absent < held
        assert sorted(asked[0]) == sorted(set(asked[0])) and len(asked) == 1  # each once, though all are wanted twice over
        pages.prepare(first, np.array([1]), streaming=True)  # one point, which has been there from the start
        session.picture.dirty = False
        assert not pages.pending and pages.idle
        painter.note_arrivals()
        assert not pages.idle
        while not pages.residency.complete:
            arrived()
            painter.note_arrivals()
        assert not session.picture.dirty and not painter.note_arrivals()
    finally:
        painter.release()


def test_a_scan_there_is_no_room_for_leaves_the_one_before(context, monkeypatch):
    """Neither beside it nor in its place: what was shown is made again, and nothing that is shown is gone."""
    from pointglass.viewer.picture.settings import Memory

    painted = SimpleNamespace(dirty=False, adaptive_lod=SimpleNamespace(target_ms=0.0))
    said: list[tuple] = []
    session = SimpleNamespace(accept=lambda _: None, notices=SimpleNamespace(say=lambda *text: said.append(text)),
                              picture=painted, size=(64, 48), choice=SimpleNamespace(split_at=0.5))
    painter = Viewport(context, session, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
    small, large = SCENE, replace(SCENE)
    make, made = Viewport._new, []

    def new(self, scene):
        made.append(scene)
        if scene is large:
            raise DeviceError("no memory left for the points")
        return make(self, scene)

    monkeypatch.setattr(Viewport, "_new", new)
    try:
        assert painter.upload(SimpleNamespace(scene=small))  # type: ignore[arg-type]
        painter.frame = painter.renderer.render(camera_in(SCENE, 1), Settings(view="filtered"))  # type: ignore[union-attr]
        painter._shown = ("filtered",)
        assert not painter.upload(SimpleNamespace(scene=large))  # type: ignore[arg-type]
        assert [scene is large for scene in made] == [False, True, True, False] and len(said) == 1
        assert painter.renderer is not None and painter.renderer.scene is small and painted.dirty
        assert painter.frame is None and painter._shown == (), "of what is gone nothing is shown"
        painter.renderer.render(camera_in(SCENE, 1), Settings(view="filtered"))
    finally:
        painter.release()


def test_the_room_of_the_scan_before_is_for_the_next_one(context, monkeypatch):
    """A device with memory for one of them: the second is uploaded beside the first, with what is left, and then alone."""
    from pointglass.viewer.picture.settings import Memory
    from pointglass.viewer.render import renderer as module

    held: list[int] = []
    said: list[str] = []

    class Limited(PointPages):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            self.short = bool(held)
            held.append(id(self))

        def release(self):
            super().release()
            held.remove(id(self))

    monkeypatch.setattr(module, "PointPages", Limited)
    session = SimpleNamespace(accept=said.append, notices=SimpleNamespace(say=lambda *text: said.append(text)),
                              picture=SimpleNamespace(adaptive_lod=SimpleNamespace(target_ms=0.0)))
    painter = Viewport(context, session, memory=Memory(), wake=lambda: None)  # type: ignore[arg-type]
    try:
        for number in range(1, 4):
            loaded = SimpleNamespace(scene=SCENE)
            assert painter.upload(loaded)  # type: ignore[arg-type]
            assert len(held) == 1 and not painter.renderer.pages.short  # type: ignore[union-attr]
            assert said == [loaded] * number
    finally:
        painter.release()
    assert not held
