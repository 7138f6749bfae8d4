"""Residency of chunks in a pool: against a plain least-recently-used reference, rounds, and the chunks that fit."""

from collections import OrderedDict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pointglass.model.common.system import available_memory
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.scene import CHUNK, Scene
from pointglass.viewer.stream.residency import OVERVIEW, Residency, byte_count, opening_chunks, overview_chunks

SEEDS = st.integers(0, 2**32 - 1)


class PlainPool:
    """The reference implementation: an ordered dict of chunk -> slot, the next to be evicted in front."""

    def __init__(self, chunks: int, slots: int, pinned: int):
        self.chunks, self.slots = chunks, slots
        self.held, self.empty, self.pinned = OrderedDict(), list(range(slots)), pinned

    def frame(self, needed: list[int], limit: int | None) -> dict[int, int]:
        """The chunks to be loaded and their slots."""
        missing = [chunk for chunk in needed if chunk not in self.held][:limit]
        if self.slots >= self.chunks:
            return {chunk: chunk for chunk in missing}
        room = self.empty + [
            slot for chunk, slot in self.held.items() if chunk >= self.pinned and chunk not in needed
        ]
        return dict(zip(missing, room, strict=False))

    def load(self, chunk: int, slot: int) -> None:
        self.held = OrderedDict((c, s) for c, s in self.held.items() if s != slot)
        self.empty = [s for s in self.empty if s != slot]
        self.held[chunk] = slot

    def used(self, needed: list[int]) -> None:
        for chunk in reversed(needed):
            if chunk in self.held:
                self.held.move_to_end(chunk)


def some(rng, count: int, most: int) -> np.ndarray:
    """Up to ``most`` of ``count`` chunks, ascending, with runs as in a draw list."""
    marks = np.zeros(count, bool)
    marks[rng.integers(0, count, rng.integers(0, most + 1))] = True
    start = rng.integers(0, count)
    marks[start : start + rng.integers(0, most + 1)] = True
    return np.flatnonzero(marks)


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_the_pool_agrees_with_its_reference_implementation(seed):
    rng = np.random.default_rng(seed)
    chunks, slots = int(rng.integers(1, 120)), int(rng.integers(2, 60))
    pinned = int(rng.integers(0, slots // 2 + 1))
    residency = Residency(chunks * 64 - int(rng.integers(0, 64)), slots, chunk_points=64, pinned=pinned)
    reference = PlainPool(residency.chunks, residency.slots, residency.pinned)
    for _ in range(60):
        needed = some(rng, chunks, slots)
        limit = None if rng.random() < 0.5 else int(rng.integers(0, 8))
        to_load, into = residency.plan(needed, limit)
        expected = reference.frame(needed.tolist(), limit)
        assert dict(zip(to_load.tolist(), into.tolist(), strict=True)) == expected
        arrive = rng.permutation(len(to_load))[: rng.integers(0, len(to_load) + 1)]
        pinned_before = set(np.flatnonzero(residency.slot_of_chunk[: residency.pinned] >= 0))
        for i in arrive:
            residency.place(int(to_load[i]), int(into[i]))
            reference.load(int(to_load[i]), int(into[i]))
        reference.used(needed.tolist())
        held = {c: int(s) for c, s in enumerate(residency.slot_of_chunk) if s >= 0}
        assert held == dict(reference.held) and len(set(held.values())) == len(held) <= slots
        assert {int(c): s for s, c in enumerate(residency.chunk_of_slot) if c >= 0} == held
        assert pinned_before <= set(held)
        assert residency.absent == chunks - len(held) and residency.complete == (len(held) == chunks)


def test_the_finest_of_equally_old_chunks_is_evicted_first():
    residency = Residency(10 * 64, 4, chunk_points=64)
    for chunk, slot in zip(*residency.plan(np.array([1, 2, 5, 7])), strict=True):
        residency.place(chunk, slot)
    assert residency.plan(np.array([3]))[1].tolist() == [residency.slot_of_chunk[7]]


@given(SEEDS, st.integers(0, 10))
@settings(max_examples=60, deadline=None)
def test_need_agrees_with_a_plain_loop(seed, shift):
    rng = np.random.default_rng(seed)
    points = int(rng.integers(1, 3000))
    residency = Residency(points, 10**6, chunk_points=1 << shift)
    first = rng.integers(0, points, 20)
    count = np.minimum(rng.integers(0, 700, 20), points - first)
    tally = np.zeros(residency.chunks, int)
    for a, n in zip(first, count, strict=True):
        for point in range(a, a + n):
            tally[point >> shift] += 1
    assert residency.need(first, count).tolist() == np.flatnonzero(tally).tolist()
    assert residency.tally.tolist() == tally.tolist()


@given(SEEDS)
@settings(max_examples=100, deadline=None)
def test_rounds_hold_every_needed_chunk_once_and_each_fits(seed):
    rng = np.random.default_rng(seed)
    chunks, slots = int(rng.integers(1, 200)), int(rng.integers(2, 40))
    residency = Residency(chunks * 64 - int(rng.integers(0, 64)), slots, chunk_points=64, pinned=slots // 8)
    for chunk in range(residency.pinned):
        residency.place(chunk, chunk)
    for _ in range(5):
        needed = some(rng, chunks, chunks)
        rounds = residency.rounds(needed)
        assert [r.start for r in rounds] == [0, *(r.stop for r in rounds[:-1])] and rounds[-1].stop == residency.points
        assert np.concatenate([r.chunks for r in rounds]).tolist() == needed.tolist()
        loads = []
        for part in [*rounds, *reversed(rounds)]:
            assert ((part.chunks * 64 >= part.start) & (part.chunks * 64 < part.stop)).all()
            to_load, into = residency.plan(part.chunks)
            loads.append(len(to_load))
            for chunk, slot in zip(to_load, into, strict=True):
                residency.place(chunk, slot)
            assert (residency.slot_of_chunk[part.chunks] >= 0).all()
            assert (residency.slot_of_chunk[: residency.pinned] >= 0).all()
        assert loads[len(rounds)] == 0  # the way back begins with loaded chunks
        if len(needed) <= residency.room:
            assert len(rounds) == 1


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_fitting_returns_the_coarsest_chunks_and_as_many_as_fit(seed):
    rng = np.random.default_rng(seed)
    residency = Residency(100 * 64, int(rng.integers(4, 120)), chunk_points=64, pinned=int(rng.integers(0, 4)))
    needed = some(rng, 100, 100)
    fitting = residency.fitting(needed)
    assert fitting.tolist() == needed[: len(fitting)].tolist()
    beside = residency.pinned - int((fitting < residency.pinned).sum())
    assert len(fitting) + beside <= residency.slots
    assert len(fitting) == len(needed) or len(fitting) + beside == residency.slots


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_the_slots_allocated_are_exactly_those_needed(seed):
    rng = np.random.default_rng(seed)
    chunks, slots = int(rng.integers(1, 100)), int(rng.integers(2, 120))
    residency = Residency(chunks * 64, slots, chunk_points=64, pinned=int(rng.integers(0, 2)))
    for _ in range(8):
        needed = residency.fitting(some(rng, chunks, int(rng.integers(1, 30))))
        reach = residency.reach(needed)
        for chunk, slot in zip(*residency.plan(needed), strict=True):
            residency.place(int(chunk), int(slot))
        held = residency.slot_of_chunk[needed]
        assert (held >= 0).all() and (held < reach).all()
        assert reach == (needed.max(initial=-1) + 1 if residency.holds_all else np.count_nonzero(residency.chunk_of_slot >= 0))
    assert residency.reach(needed[:0]) == (0 if residency.holds_all else np.count_nonzero(residency.chunk_of_slot >= 0))


def layered(offsets: np.ndarray) -> Scene:
    """Three layers of two cells."""
    points = np.zeros((0, 3), np.uint32)
    return Scene(points, np.zeros((2, 3), np.int32), offsets, np.zeros(3), 1.0, 3, int(offsets[-1]), 0.1, np.zeros((2, 3)))


def test_pinned_chunks_hold_the_coarse_layers_but_never_the_whole_pool():
    parts = np.array([0, 60, 100, 200, 300, 500, 700])  # two cells, layers of 100, 200 and 400 parts
    scene = layered(parts * (OVERVIEW // 300 + 1))
    assert overview_chunks(scene, 10**6) == -(-int(scene.offsets[4]) // CHUNK)
    assert overview_chunks(scene, 80) == 10 and overview_chunks(scene, 7) == 0


def test_a_first_picture_waits_for_whole_layers_at_least_the_coarsest():
    scene = layered(np.array([0, 60, 100, 200, 300, 500, 700]))
    waits = [opening_chunks(scene, 10, points) for points in (0, 99, 100, 299, 300, 699, 700, 10**9)]
    assert waits == [10, 10, 10, 10, 30, 30, 70, 70]


def test_a_pool_without_slots_to_load_into_is_refused():
    with pytest.raises(ValueError, match="nothing could be loaded"):
        Residency(64 * 64, 4, chunk_points=64, pinned=4)
    with pytest.raises(ValueError, match="power of two"):
        Residency(64 * 64, 4, chunk_points=63)
    assert Residency(64, 4, chunk_points=64, pinned=4).holds_all


def test_sizes_are_read_as_people_write_them():
    assert [byte_count(text, "--x") for text in ("512M", "4G", "1.5 GiB", "700", "64kb")] == [
        512 << 20, 4 << 30, 3 << 29, 700, 64 << 10]  # fmt: skip
    for text in ("", "G", "-4G", "nan", "1e99", "4X", "0"):
        with pytest.raises(InputError, match=r"--gpu-memory.*expected a size"):
            byte_count(text, "--gpu-memory")
    free = available_memory()
    assert free is None or 0 <= free < 1 << 50
