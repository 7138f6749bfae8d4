"""Chunks in a pool: the bookkeeping against a plain least-recently-used twin, rounds, and the reader and its troubles."""

import os
import tempfile
import threading
import time
import zlib
from collections import OrderedDict
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from viewer.cloud.chunk_reader import CHUNK, ChunkError, ChunkReader, ChunkSource
from viewer.cloud.residency import OVERVIEW, Residency, available_memory, byte_count, overview_chunks
from viewer.errors import InputError

SEEDS = st.integers(0, 2**32 - 1)


class PlainPool:
    """The twin: an ordered dict of chunk -> slot, the one to go first in front."""

    def __init__(self, slots: int, pinned: int):
        self.held, self.empty, self.pinned = OrderedDict(), list(range(slots)), pinned

    def frame(self, needed: list[int], limit: int | None) -> dict[int, int]:
        """chunk -> slot of what is to be loaded."""
        missing = [chunk for chunk in needed if chunk not in self.held][:limit]
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
    """Up to ``most`` of ``count`` chunks, ascending, with runs among them as a draw list has."""
    marks = np.zeros(count, bool)
    marks[rng.integers(0, count, rng.integers(0, most + 1))] = True
    start = rng.integers(0, count)
    marks[start : start + rng.integers(0, most + 1)] = True
    return np.flatnonzero(marks)


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_the_pool_agrees_with_a_plain_twin(seed):
    rng = np.random.default_rng(seed)
    chunks, slots = int(rng.integers(1, 120)), int(rng.integers(2, 60))
    pinned = int(rng.integers(0, slots // 2 + 1))
    residency = Residency(chunks * 64 - int(rng.integers(0, 64)), slots, chunk_points=64, pinned=pinned)
    twin = PlainPool(residency.slots, residency.pinned)
    for _ in range(60):
        needed = some(rng, chunks, slots)
        limit = None if rng.random() < 0.5 else int(rng.integers(0, 8))
        to_load, into = residency.plan(needed, limit)
        expected = twin.frame(needed.tolist(), limit)
        assert dict(zip(to_load.tolist(), into.tolist(), strict=True)) == expected
        arrive = rng.permutation(len(to_load))[: rng.integers(0, len(to_load) + 1)]
        pinned_before = set(np.flatnonzero(residency.slot_of_chunk[: residency.pinned] >= 0))
        for i in arrive:
            residency.place(int(to_load[i]), int(into[i]))
            twin.load(int(to_load[i]), int(into[i]))
        twin.used(needed.tolist())
        held = {c: int(s) for c, s in enumerate(residency.slot_of_chunk) if s >= 0}
        assert held == dict(twin.held) and len(set(held.values())) == len(held) <= slots
        assert {int(c): s for s, c in enumerate(residency.chunk_of_slot) if c >= 0} == held
        assert pinned_before <= set(held)


def test_of_chunks_needed_equally_long_ago_the_finest_goes_first():
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
        assert loads[len(rounds)] == 0  # the way back begins with what is there
        if len(needed) <= residency.room:
            assert len(rounds) == 1


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_what_fits_are_the_coarsest_chunks_and_no_chunk_more_would(seed):
    rng = np.random.default_rng(seed)
    residency = Residency(100 * 64, int(rng.integers(4, 120)), chunk_points=64, pinned=int(rng.integers(0, 4)))
    needed = some(rng, 100, 100)
    fitting = residency.fitting(needed)
    assert fitting.tolist() == needed[: len(fitting)].tolist()
    beside = residency.pinned - int((fitting < residency.pinned).sum())
    assert len(fitting) + beside <= residency.slots
    assert len(fitting) == len(needed) or len(fitting) + beside == residency.slots


def test_pinned_chunks_hold_the_coarse_layers_but_never_the_whole_pool():
    parts = np.array([0, 60, 100, 200, 300, 500, 700])  # two cells, layers of 100, 200 and 400 parts
    scene = SimpleNamespace(offsets=parts * (OVERVIEW // 300 + 1), cell_coords=np.zeros((2, 3)))
    assert overview_chunks(scene, 10**6) == -(-int(scene.offsets[4]) // CHUNK)
    assert overview_chunks(scene, 80) == 10 and overview_chunks(scene, 7) == 0


def test_a_pool_in_which_nothing_could_move_is_refused():
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


# -- the reader -----------------------------------------------------------------------------------------------------


def random_points(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 2**32, (count, 3), dtype=np.uint32)


def on_disk(folder, points: np.ndarray) -> SimpleNamespace:
    """The little a source wants of a scene, its points in a file, with checksums."""
    np.save(folder / "points.npy", points)
    raw = points.tobytes()
    sums = [zlib.crc32(raw[i : i + CHUNK * 12]) for i in range(0, len(raw), CHUNK * 12)]
    return SimpleNamespace(points=np.load(folder / "points.npy", mmap_mode="r"), checksums=np.array(sums, np.uint32))


def in_file(points: np.ndarray) -> np.ndarray:
    """Points in a file without a name, as grids that are not kept are."""
    with tempfile.TemporaryFile() as file:
        mapped = np.memmap(file, np.uint32, "w+", shape=points.shape)
    mapped[:] = points
    return mapped


def mapped_and_touched(points: np.ndarray) -> int:
    """Bytes of the memory map of ``points`` that are resident in this process."""
    address, size = points.__array_interface__["data"][0], 0
    inside = False
    with open("/proc/self/smaps") as file:
        for line in file:
            if "-" in (word := line.split()[0]) and not word.endswith(":"):
                low, high = (int(part, 16) for part in word.split("-"))
                inside = low <= address < high
            elif inside and word == "Rss:":
                size = int(line.split()[1]) << 10
    return size


@pytest.mark.parametrize("where", ["file", "memory", "nameless file", "part of a file", "private copy"])
@pytest.mark.parametrize("threads", [1, 3])
def test_every_chunk_arrives_as_it_is_in_the_scene(tmp_path, where, threads):
    points = random_points(20_000)
    match where:
        case "file":
            scene = on_disk(tmp_path, points)
        case "memory":
            scene = SimpleNamespace(points=points, checksums=None)
        case "nameless file":
            scene = SimpleNamespace(points=in_file(points), checksums=None)
        case "part of a file":
            scene = SimpleNamespace(points=on_disk(tmp_path, points).points[1000:], checksums=None)
        case "private copy":
            np.save(tmp_path / "points.npy", points)
            scene = SimpleNamespace(points=np.load(tmp_path / "points.npy", mmap_mode="c"), checksums=None)
            scene.points[5000:6000] = 7
    reader = ChunkReader(ChunkSource(scene, 512), memory=4 * 512 * 12, threads=threads)
    assert (reader.source.path is not None) == (where == "file")
    wanted = np.random.default_rng(1).permutation(reader.source.chunks)
    reader.request(wanted)
    order = []
    for chunk, got in reader.arrivals(wait=True):
        assert np.array_equal(got, scene.points[chunk * 512 : (chunk + 1) * 512])
        order.append(chunk)
    assert sorted(order) == list(range(reader.source.chunks)) and reader.memory <= 4 * 512 * 12
    if threads == 1:
        assert order == wanted.tolist()
    reader.close()


@pytest.mark.skipif(not os.path.exists("/proc/self/smaps"), reason="only Linux tells")
@pytest.mark.parametrize("named", [True, False])
def test_reading_leaves_no_page_of_the_map_in_memory(tmp_path, named):
    points = random_points(600_000)
    scene = on_disk(tmp_path, points) if named else SimpleNamespace(points=in_file(points), checksums=None)
    reader = ChunkReader(ChunkSource(scene))
    reader.request(np.arange(reader.source.chunks))
    assert sum(len(got) for _, got in reader.arrivals(wait=True)) == 600_000
    assert mapped_and_touched(scene.points) <= 256 << 10  # the edges of chunks, at most
    assert scene.points[::1000].tolist() == points[::1000].tolist()
    reader.close()


class Gate(ChunkSource):
    """A source that reads one chunk at a time, when told to, and notes which."""

    def __init__(self, points: np.ndarray, chunk_points: int):
        super().__init__(SimpleNamespace(points=points, checksums=None), chunk_points)
        self.begun: list[int] = []
        self.begins, self.may = threading.Semaphore(0), threading.Semaphore(0)

    def read(self, chunk, into):
        self.begun.append(chunk)
        self.begins.release()
        assert self.may.acquire(timeout=30)
        return super().read(chunk, into)


def test_a_newer_request_drops_what_is_stale_and_keeps_what_is_not():
    points, woken = random_points(20 * 64), threading.Semaphore(0)
    source = Gate(points, 64)
    reader = ChunkReader(source, threads=1, wake=woken.release)
    reader.request(np.array([9, 4, 5]))
    source.may.release()
    assert woken.acquire(timeout=30)  # 9 has arrived
    assert source.begins.acquire(timeout=30) and source.begins.acquire(timeout=30)  # 4 is being read
    reader.request(np.array([9, 11, 4]))
    source.may.release(20)
    got = {chunk: part.copy() for chunk, part in reader.arrivals(wait=True)}
    assert sorted(got) == [4, 9, 11] and sorted(source.begun) == [4, 9, 11]  # 5 never was, none twice
    assert all(np.array_equal(part, points[chunk * 64 : chunk * 64 + 64]) for chunk, part in got.items())
    reader.request(np.array([1, 2]))
    assert len(list(reader.arrivals(1, wait=True))) == 1
    reader.request(np.array([], np.int64))
    assert list(reader.arrivals(wait=True)) == [] and not reader.arrived
    reader.close()


def test_a_chunk_no_longer_wanted_when_it_is_there_is_dropped():
    source = Gate(random_points(20 * 64), 64)
    reader = ChunkReader(source, threads=1)
    reader.request(np.array([7]))
    assert source.begins.acquire(timeout=30)
    reader.request(np.array([8]))
    source.may.release(2)
    assert [chunk for chunk, _ in reader.arrivals(wait=True)] == [8] and source.begun == [7, 8]
    reader.close()


def test_a_chunk_being_read_is_not_read_by_another_thread_too():
    source = Gate(random_points(20 * 64), 64)
    reader = ChunkReader(source, threads=2)
    reader.request(np.array([7]))
    assert source.begins.acquire(timeout=30)
    reader.request(np.array([7, 8]))
    assert source.begins.acquire(timeout=30)
    source.may.release(9)
    assert sorted(chunk for chunk, _ in reader.arrivals(wait=True)) == [7, 8] and sorted(source.begun) == [7, 8]
    reader.close()


@pytest.mark.timeout(30)
def test_buffers_are_bounded_and_come_back():
    points = random_points(64 * 64)
    reader = ChunkReader(ChunkSource(SimpleNamespace(points=points, checksums=None), 64), memory=3 * 64 * 12, threads=2)
    for turn in range(5):
        reader.request(np.arange(64) ^ turn % 2)
        for _ in reader.arrivals(30, wait=True):
            assert reader.memory <= 3 * 64 * 12
        with pytest.raises(ZeroDivisionError):
            for _ in reader.arrivals(wait=True):
                raise ZeroDivisionError
    for wanted in (np.arange(32), np.arange(32, 64), np.arange(64)):  # read and never taken: it makes way
        reader.request(wanted)
        while len(reader._ready) < 3:
            time.sleep(0.001)
    assert len(list(reader.arrivals(wait=True))) == 64 and reader.memory == 3 * 64 * 12
    reader.close()


def test_a_file_cut_short_while_open_is_a_message_and_no_crash(tmp_path):
    scene = on_disk(tmp_path, random_points(5 * 1024))
    reader = ChunkReader(ChunkSource(scene, 1024), threads=2)
    os.truncate(tmp_path / "points.npy", 128 + 2 * 1024 * 12 + 100)
    reader.request(np.arange(5))
    there, failed = {}, {}
    while len(there) + len(failed) < 5:
        try:
            for chunk, got in reader.arrivals(wait=True):
                there[chunk] = got.copy()
        except ChunkError as error:
            failed[error.chunk] = str(error)
    assert sorted(there) == [0, 1] and sorted(failed) == [2, 3, 4]
    text = failed[2]
    assert f"{tmp_path / 'points.npy'}: damaged grid" in text and "too early" in text and "\n" not in text
    assert text.endswith("convert the scan again")
    reader.close()


@pytest.mark.parametrize("seed", range(3))
def test_one_wrong_bit_is_found_and_the_other_chunks_are_served(tmp_path, seed):
    rng = np.random.default_rng(seed)
    points = random_points(2 * CHUNK + 999, seed)
    scene = on_disk(tmp_path, points)
    place = int(rng.integers(0, points.nbytes))
    with open(tmp_path / "points.npy", "r+b") as file:
        file.seek(scene.points.offset + place)
        byte = file.read(1)[0]
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([byte ^ 1 << int(rng.integers(0, 8))]))
    source, bad = ChunkSource(scene), place // (CHUNK * 12)
    into = np.empty((CHUNK, 3), np.uint32)
    for chunk in range(3):
        if chunk != bad:
            assert np.array_equal(source.read(chunk, into), points[chunk * CHUNK : (chunk + 1) * CHUNK])
            continue
        with pytest.raises(ChunkError, match=r"points\.npy: damaged grid .*checksum.*; convert the scan again"):
            source.read(chunk, into)
    source.close()


def test_a_file_that_is_gone_and_a_disk_that_fails_are_messages(tmp_path, monkeypatch):
    scene = on_disk(tmp_path, random_points(100))
    reader = ChunkReader(ChunkSource(scene, 64))

    def fails(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "preadv", fails, raising=False)
    for _ in range(2):  # asked for again it is tried again
        reader.request(np.array([1]))
        with pytest.raises(ChunkError, match=r"points\.npy: cannot be read \(Input/output error\)") as caught:
            list(reader.arrivals(wait=True))
        assert caught.value.chunk == 1
    reader.close()
    (tmp_path / "points.npy").unlink()
    with pytest.raises(InputError, match=r"points\.npy: cannot be read"):
        ChunkSource(scene)


def test_without_pread_the_same_is_read(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "preadv", raising=False)
    points = random_points(3000)
    reader = ChunkReader(ChunkSource(on_disk(tmp_path, points), 128), threads=3)
    reader.request(np.arange(reader.source.chunks))
    got = {chunk: part.copy() for chunk, part in reader.arrivals(wait=True)}
    assert np.array_equal(np.concatenate([got[chunk] for chunk in sorted(got)]), points)
    os.truncate(tmp_path / "points.npy", 200)
    with pytest.raises(ChunkError, match="damaged grid"):
        reader.source.read(5, np.empty((128, 3), np.uint32))
    reader.close()


def test_closing_ends_the_threads_whatever_they_are_at():
    source = Gate(random_points(1000), 64)
    reader = ChunkReader(source, threads=2)
    threads = reader._threads
    reader.request(np.arange(10))
    assert source.begins.acquire(timeout=30)
    source.may.release(100)
    reader.close()
    assert not any(thread.is_alive() for thread in threads)
    reader.close()
    assert list(reader.arrivals(wait=True)) == []
