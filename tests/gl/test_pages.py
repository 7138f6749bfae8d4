"""Points in pages: what slot_of_chunk says is what the buffers hold, under the budget, whole, in rounds and streamed."""

import os
import threading
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from paged import (
    CHUNK_BYTES,
    CHUNKS,
    POINTS,
    SCENE,
    draw_list,
    drawn,
    expected,
    on_disk,
    pages_of,
    plain_batches,
    within_budget,
)

from pointglass.viewer.common.errors import DeviceError, InputError
from pointglass.viewer.render.device.shader import BATCH
from pointglass.viewer.render.raster.points import LEAST_SLOTS, PointPages

pytestmark = pytest.mark.gl


def test_a_scene_that_fits_is_there_whole(context):
    pages = pages_of(context, slots=CHUNKS + 10)
    try:
        assert len(pages.buffers) == -(-CHUNKS // 9) > 3
        assert pages.slot_of_chunk.tolist() == list(range(CHUNKS))
        rng = np.random.default_rng(0)
        first, count = draw_list(rng, 0.5)
        for streaming in (False, True):
            (part,) = pages.prepare(first, count, streaming=streaming)
            pages.load(part)
            batches = plain_batches(first, count, pages, part.start, part.stop)
            assert np.array_equal(drawn(pages, batches), expected(first, count))
            assert not pages.pending and not pages.approximations
        for page, buffer in enumerate(pages.buffers):  # a batch more than a page, for cutting from a run's start
            held = np.frombuffer(buffer.read(), np.uint32).reshape(-1, 3)
            assert np.array_equal(held, SCENE.points[page * pages.size :][: pages.size + BATCH])
    finally:
        pages.release()


def test_a_small_scene_takes_no_more_than_it_needs(context):
    points = SCENE.points[:7]
    pages = PointPages(context, replace(SCENE, points=points), 128 << 20, budget=1 << 30)
    try:
        assert pages.nbytes == 7 * 12 and pages.buffers[0].read() == points.tobytes()
    finally:
        pages.release()


@pytest.mark.parametrize("stored", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_rounds_draw_every_point_once_under_the_budget(context, tmp_path, seed, stored):
    rng = np.random.default_rng(seed)
    pages = pages_of(context, on_disk(tmp_path) if stored else SCENE, software=stored)
    try:
        assert len(pages.buffers) == (1 if stored else 5)  # in software, made when needed
        pinned = pages.residency.pinned
        assert pinned == 5 and not pages.residency.holds_all
        several, seen = 0, set()
        for share in rng.choice([0.0, 0.01, 0.3, 1.0], 8):
            first, count = draw_list(rng, share)
            if rng.random() < 0.5:  # what a camera close by needs: a few places, all layers
                keep = (first // POINTS) % 10 < 2
                first, count = first[keep], count[keep]
            rounds = pages.prepare(first, count)
            several += len(rounds) > 1
            made = len(pages.buffers)
            for sweep in (rounds, rounds[::-1]):
                times = np.zeros(SCENE.count, int)
                for part in sweep:
                    pages.load(part)
                    assert within_budget(pages)
                    times += drawn(pages, plain_batches(first, count, pages, part.start, part.stop))
                assert np.array_equal(times, expected(first, count))
            seen |= set(pages.residency.need(first, count)[:pinned].tolist()) & set(range(pinned))
            assert (pages.slot_of_chunk[sorted(seen)] >= 0).all() and len(pages.buffers) == made  # once there, they stay
        assert several
    finally:
        pages.release()


@pytest.mark.parametrize("seed", range(3))
def test_streaming_brings_everything_coarse_chunks_first_and_so_much_a_frame(context, tmp_path, seed):
    rng = np.random.default_rng(seed)
    news = threading.Event()
    pages = pages_of(context, on_disk(tmp_path), upload=3 * CHUNK_BYTES, wake=news.set)
    try:
        for turn in range(4):
            first, count = draw_list(rng, 1.0)
            start = rng.integers(0, SCENE.count - 20 * POINTS)
            keep = (first + count < 8 * POINTS) | ((first > start) & (first + count < start + 20 * POINTS))
            first, count = first[keep], count[keep]
            total = expected(first, count)
            frames = 0
            while True:
                before = pages.slot_of_chunk.copy()
                (part,) = pages.prepare(first, count, streaming=True)
                pages.load(part)
                new = np.flatnonzero((pages.slot_of_chunk >= 0) & (before < 0))
                coarse = pages.residency.pinned if turn == frames == 0 else 0  # for which the first picture waits
                assert len(new[new >= coarse]) <= 3 and within_budget(pages)
                times = drawn(pages, plain_batches(first, count, pages, part.start, part.stop))
                assert (times <= total).all() and total.sum() - times.sum() == pages.missing
                assert any("still loading" in text for text in pages.approximations) == (pages.missing > 0)
                assert (times[: pages.residency.pinned * POINTS] == total[: pages.residency.pinned * POINTS]).all()
                if not pages.pending:
                    break
                if not pages.arrived:
                    assert news.wait(30)
                news.clear()
                frames += 1
                assert frames < 1000
            assert np.array_equal(times, total) and pages.left_out == pages.lost == 0
    finally:
        pages.release()


def test_what_a_moving_picture_cannot_hold_is_said_and_is_the_finest(context):
    pages = pages_of(context, read_ahead=1 << 20)
    first, count = np.array([0]), np.array([SCENE.count])
    try:
        for _ in range(10_000):
            pages.prepare(first, count, streaming=True)
            if not pages.pending:
                break
        slots = pages.residency.slots
        assert np.flatnonzero(pages.slot_of_chunk >= 0).tolist() == list(range(slots))
        assert pages.missing == 0 and pages.left_out == SCENE.count - slots * POINTS
        assert pages.approximations == [f"{pages.left_out / SCENE.count:.0%} of the points beyond the memory for points"]
        held = pages.slot_of_chunk.copy()
        pages.prepare(first, count, streaming=True)  # and it stays so: nothing goes round in circles
        assert np.array_equal(pages.slot_of_chunk, held) and not pages.pending
    finally:
        pages.release()


def test_a_file_that_shrinks_while_open_is_reported_and_the_rest_is_drawn(context, tmp_path):
    scene = on_disk(tmp_path)
    pages = pages_of(context, scene)
    first, count = np.array([0]), np.array([30 * POINTS])
    try:
        os.truncate(scene.points.filename, scene.points.offset + 20 * CHUNK_BYTES - 1)
        with pytest.raises(InputError, match=r"points\.npy: damaged grid"):
            pages.load(pages.prepare(first, count)[0])
        for _ in range(10_000):
            (part,) = pages.prepare(first, count, streaming=True)
            if not pages.pending:
                break
        assert pages.problem and "points.npy: damaged grid" in pages.problem
        assert pages.lost == 11 * POINTS and pages.missing == pages.left_out == 0
        assert pages.approximations == [f"{11 / 30:.0%} of the points cannot be read"]
        pages.prepare(first, count, streaming=True)
        assert pages._reader._left == 0  # what failed is not tried for ever
        times = drawn(pages, plain_batches(first, count, pages, part.start, part.stop))
        assert times[: 19 * POINTS].all() and not times[19 * POINTS :].any()
    finally:
        pages.release()
    with pytest.raises(InputError, match="damaged grid"):  # at opening: nothing is shown, nothing left behind
        pages_of(context, scene, slots=CHUNKS + 10)


@pytest.mark.parametrize("spare", [-1, 0, 3 * BATCH * 12, CHUNKS // 9 * BATCH * 12, CHUNKS * CHUNK_BYTES])
def test_a_budget_close_to_the_scene_is_obeyed(context, spare):
    budget = SCENE.count * 12 + spare
    pages = pages_of(context, slots=budget / CHUNK_BYTES)
    try:
        assert pages.nbytes <= budget
        assert pages.residency.holds_all == (spare >= CHUNKS // 9 * BATCH * 12)
    finally:
        pages.release()


def test_a_budget_that_is_too_small_names_the_option(context):
    with pytest.raises(InputError, match=r"^\S+ KiB for points on the GPU: expected \S+ KiB at least; raise --gpu-memory"):
        pages_of(context, slots=15)
    with pytest.raises(InputError, match=r"5 MiB for points on the GPU: expected 12 MiB at least"):
        PointPages(context, replace(SCENE, points=np.zeros((1 << 20, 3), np.uint32)), 128 << 20, budget=5 << 20)


class Refusing:
    """A context whose device has ``memory`` bytes for buffers.  raises: moderngl raises for what it refuses, as it does where a
    driver returns no buffer; else OpenGL reports GL_OUT_OF_MEMORY."""

    def __init__(self, context, memory: int, *, raises: bool = False):
        self._context, self._memory, self._raises = context, memory, raises
        self._made: list = []
        self.error = "GL_NO_ERROR"

    def __getattr__(self, name):
        return getattr(self._context, name)

    def buffer(self, *, reserve: int, **options):
        held = sum(buffer.size for buffer in self._made if not isinstance(buffer.mglo, moderngl.InvalidObject))
        refused = held + reserve > self._memory
        if refused and self._raises:
            raise moderngl.Error("cannot create buffer")
        self.error = "GL_OUT_OF_MEMORY" if refused else "GL_NO_ERROR"
        self._made.append(self._context.buffer(reserve=reserve, **options))
        return self._made[-1]


@pytest.mark.parametrize("raises", [False, True])
@pytest.mark.parametrize(("slots", "memory"), [(40.5, 30.0), (CHUNKS + 10, 30.0), (CHUNKS + 10, 17.0)])
def test_refused_memory_halves_the_budget_and_every_point_is_still_drawn(context, caplog, slots, memory, raises):
    pages = pages_of(Refusing(context, int(memory * CHUNK_BYTES), raises=raises), slots=slots, software=False)
    try:
        assert LEAST_SLOTS <= pages.residency.slots <= memory and pages.short and pages.nbytes <= memory * CHUNK_BYTES
        said = [record.message for record in caplog.records if "refused memory for points" in record.message]
        assert said and all("continuing with" in line and "\n" not in line for line in said)
        first, count = draw_list(np.random.default_rng(5), 0.9)
        times = np.zeros(SCENE.count, int)
        for part in pages.prepare(first, count):
            pages.load(part)
            times += drawn(pages, plain_batches(first, count, pages, part.start, part.stop))
        assert np.array_equal(times, expected(first, count))
    finally:
        pages.release()


@pytest.mark.parametrize("raises", [False, True])
def test_a_device_without_memory_for_the_least_is_refused_in_one_line(context, raises):
    with pytest.raises(DeviceError, match="no memory left for the points") as raised:
        pages_of(Refusing(context, 10 * CHUNK_BYTES, raises=raises), software=False)
    assert "\n" not in str(raised.value) and raised.value.exit_code == 3


def test_nothing_runs_on_once_released(context):
    before = set(threading.enumerate())
    pages = pages_of(context)
    assert set(threading.enumerate()) - before
    pages.prepare(np.array([0]), np.array([SCENE.count]), streaming=True)
    pages.release()
    assert set(threading.enumerate()) <= before and not pages.buffers
    whole = pages_of(context, slots=CHUNKS + 10)
    assert set(threading.enumerate()) <= before  # all is there: nothing left to read
    whole.release()
