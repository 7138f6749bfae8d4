"""Prefetch of chunks: correct points, new requests, bounded buffers, errors."""

import os
import tempfile
import threading
import time
import zlib
from dataclasses import dataclass

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.stream.chunk_reader import ChunkReader
from pointglass.viewer.stream.chunk_source import CHUNK, ChunkError, ChunkSource

pytestmark = pytest.mark.timeout(90)  # a deadlock fails soon


@dataclass
class Stored:
    """What a chunk source reads of a Scene."""

    points: np.ndarray
    checksums: np.ndarray | None
    marked: None = None


def random_points(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 2**32, (count, 3), dtype=np.uint32)


def on_disk(folder, points: np.ndarray) -> Stored:
    """A stand-in for a scene with what a source needs: points in a file, and checksums."""
    np.save(folder / "points.npy", points)
    raw = points.tobytes()
    sums = [zlib.crc32(raw[i : i + CHUNK * 12]) for i in range(0, len(raw), CHUNK * 12)]
    return Stored(points=np.load(folder / "points.npy", mmap_mode="r"), checksums=np.array(sums, np.uint32))


def in_file(points: np.ndarray) -> np.ndarray:
    """Points in a file without a name, as for large grids that are not cached."""
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
def test_every_chunk_arrives_with_the_scenes_points(tmp_path, where, threads):
    points = random_points(20_000)
    match where:
        case "file":
            scene = on_disk(tmp_path, points)
        case "memory":
            scene = Stored(points=points, checksums=None)
        case "nameless file":
            scene = Stored(points=in_file(points), checksums=None)
        case "part of a file":
            scene = Stored(points=on_disk(tmp_path, points).points[1000:], checksums=None)
        case "private copy":
            np.save(tmp_path / "points.npy", points)
            scene = Stored(points=np.load(tmp_path / "points.npy", mmap_mode="c"), checksums=None)
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
    scene = on_disk(tmp_path, points) if named else Stored(points=in_file(points), checksums=None)
    reader = ChunkReader(ChunkSource(scene))
    reader.request(np.arange(reader.source.chunks))
    assert sum(len(got) for _, got in reader.arrivals(wait=True)) == 600_000
    assert mapped_and_touched(scene.points) <= 256 << 10  # the edges of chunks, at most
    assert scene.points[::1000].tolist() == points[::1000].tolist()
    reader.close()


class Gate(ChunkSource):
    """A source that reads one chunk at a time on a signal, and records which."""

    def __init__(self, points: np.ndarray, chunk_points: int):
        super().__init__(Stored(points=points, checksums=None), chunk_points)
        self.begun: list[int] = []
        self.begins, self.may = threading.Semaphore(0), threading.Semaphore(0)

    def read(self, chunk, into):
        self.begun.append(chunk)
        self.begins.release()
        assert self.may.acquire(timeout=30)
        return super().read(chunk, into)


def test_a_new_request_cancels_old_chunks_and_keeps_common_ones():
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
    assert sorted(got) == [4, 9, 11] and sorted(source.begun) == [4, 9, 11]  # 5 was not read, and none twice
    assert all(np.array_equal(part, points[chunk * 64 : chunk * 64 + 64]) for chunk, part in got.items())
    reader.request(np.array([1, 2]))
    assert len(list(reader.arrivals(1, wait=True))) == 1
    reader.request(np.array([], np.int64))
    assert list(reader.arrivals(wait=True)) == [] and not reader.arrived
    reader.close()


def test_a_chunk_cancelled_while_it_is_read_is_dropped():
    source = Gate(random_points(20 * 64), 64)
    reader = ChunkReader(source, threads=1)
    reader.request(np.array([7]))
    assert source.begins.acquire(timeout=30)
    reader.request(np.array([8]))
    source.may.release(2)
    assert [chunk for chunk, _ in reader.arrivals(wait=True)] == [8] and source.begun == [7, 8]
    reader.close()


def test_a_chunk_is_never_read_by_two_threads():
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
def test_a_failed_chunk_is_not_read_again_before_its_error_is_raised():
    woken = threading.Semaphore(0)

    class Bad(Gate):
        def read(self, chunk, into):
            got = super().read(chunk, into)
            if chunk == 3 and self.begun.count(3) == 1:
                raise ChunkError("torn", 3)
            return got

    source = Bad(random_points(20 * 64), 64)
    source.may.release(9)
    reader = ChunkReader(source, threads=1, wake=woken.release)
    reader.request(np.array([3]))
    assert woken.acquire(timeout=30)
    reader.request(np.array([3, 4]))
    assert source.begins.acquire(timeout=30) and source.begins.acquire(timeout=30)  # the next is being read
    with pytest.raises(ChunkError, match="torn"):
        next(reader.arrivals(wait=True))
    assert [chunk for chunk, _ in reader.arrivals(wait=True)] == [4] and source.begun == [3, 4]
    reader.request(np.array([3]))
    assert [chunk for chunk, _ in reader.arrivals(wait=True)] == [3]
    reader.close()


@pytest.mark.timeout(30)
def test_buffers_are_bounded_and_reused():
    points = random_points(64 * 64)
    reader = ChunkReader(ChunkSource(Stored(points=points, checksums=None), 64), memory=3 * 64 * 12, threads=2)
    for turn in range(5):
        reader.request(np.arange(64) ^ turn % 2)
        for _ in reader.arrivals(30, wait=True):
            assert reader.memory <= 3 * 64 * 12
        with pytest.raises(ZeroDivisionError):
            for _ in reader.arrivals(wait=True):
                raise ZeroDivisionError
    for wanted in (np.arange(32), np.arange(32, 64), np.arange(64)):  # read and never taken: evicted
        reader.request(wanted)
        while len(reader._ready) < 3:
            time.sleep(0.001)
    assert len(list(reader.arrivals(wait=True))) == 64 and reader.memory == 3 * 64 * 12
    reader.close()


def test_a_file_truncated_while_open_gives_an_error_message(tmp_path):
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
def test_one_wrong_bit_is_detected_and_other_chunks_are_read(tmp_path, seed):
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


def test_a_missing_file_and_a_disk_error_give_error_messages(tmp_path, monkeypatch):
    scene = on_disk(tmp_path, random_points(100))
    reader = ChunkReader(ChunkSource(scene, 64))

    def fails(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "preadv", fails, raising=False)
    for _ in range(2):  # a new request is a new attempt
        reader.request(np.array([1]))
        with pytest.raises(ChunkError, match=r"points\.npy: cannot be read \(Input/output error\)") as caught:
            list(reader.arrivals(wait=True))
        assert caught.value.chunk == 1
    reader.close()
    (tmp_path / "points.npy").unlink()
    with pytest.raises(InputError, match=r"points\.npy: cannot be read"):
        ChunkSource(scene)


def test_reading_without_pread_gives_the_same_points(tmp_path, monkeypatch):
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


def test_closing_ends_the_threads_in_any_state():
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


def test_an_error_that_ends_a_thread_is_raised_where_chunks_are_awaited():
    def wake() -> None:
        raise RuntimeError("no window to wake")

    reader = ChunkReader(ChunkSource(Stored(points=random_points(1000), checksums=None), 64), threads=1, wake=wake)
    reader.request(np.arange(10))
    with pytest.raises(RuntimeError, match="no window to wake"):
        for _ in reader.arrivals(wait=True):
            pass
    assert 0 < reader.left < 10
    reader.close()
