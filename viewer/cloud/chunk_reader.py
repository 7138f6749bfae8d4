"""Chunks of packed points, read by threads into a bounded ring of buffers, checked, in the order asked for.

A chunk is a run of ``CHUNK`` points of ``Scene.points``; the first chunks are the coarse layers.  Points that are a file
are read with pread and never through their memory map: resident memory does not grow with what was read, and a file that
shrinks while it is open is a message and not a bus error.  No OpenGL here.
"""

import mmap
import os
import threading
import zlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from viewer.cloud.scene import CHUNK
from viewer.errors import InputError
from viewer.settings import MEMORY

if TYPE_CHECKING:
    from pathlib import Path

    from viewer.cloud.scene import Scene

POINT_BYTES = 12
READ_AHEAD = MEMORY.read_ahead
"""Bytes of main memory the buffers of a reader may take, unless told otherwise."""
_THREADS = 4  # at most: beyond that the disk or the memory is the limit
_PATIENCE = 5.0  # seconds closing waits for a read that hangs


class ChunkError(InputError):
    """A chunk that cannot be had.  chunk: its number."""

    def __init__(self, message: str, chunk: int):
        super().__init__(message)
        self.chunk = chunk


def checksum(points: np.ndarray) -> int:
    """CRC-32 of packed points (n, 3) uint32 as they lie in memory.  Leaves the interpreter's lock to others."""
    return zlib.crc32(points.data)


class ChunkSource:
    """Where the chunks of a scene are read from: the file behind a memory map, or the array.

    chunk_points: points a chunk; checksums are those of chunks of CHUNK points, and used only with these.
    Safe to read from several threads.  Raises InputError where the file is gone.
    """

    def __init__(self, scene: "Scene", chunk_points: int = CHUNK):
        self.points, self.chunk_points = scene.points, chunk_points
        self.count = len(scene.points)
        self.chunks = -(-self.count // chunk_points)
        self.chunk_bytes = chunk_points * POINT_BYTES
        self.checksums = scene.checksums if chunk_points == CHUNK else None
        self.path, self._start = _file_of(scene.points)
        self._file = None
        self._seeking = threading.Lock()
        self._forgets = _forgettable(scene.points) if self.path is None else None
        if self.path is not None:
            try:
                self._file = open(self.path, "rb", buffering=0)  # noqa: SIM115  (closed by close)
            except OSError as error:
                raise InputError(f"{self.path}: cannot be read ({error.strerror}); open the scan again") from None

    def read(self, chunk: int, into: np.ndarray) -> np.ndarray:
        """The points of a chunk, (n, 3) uint32, in the front of ``into``, (chunk_points, 3) uint32.

        Raises ChunkError naming the file where it cannot be read, ends too early or is damaged.
        """
        first = chunk * self.chunk_points
        points = into[: min(self.chunk_points, self.count - first)]
        if self._file is None:
            points[:] = self.points[first : first + len(points)]
            if self._forgets is not None:
                self._forgets(first, first + len(points))
            return points
        raw = points.data.cast("B")
        place = self._start + first * POINT_BYTES
        try:
            got = self._read_at(place, raw)
        except OSError as error:
            why = f"{self.path}: cannot be read ({error.strerror}); check the disk and open the scan again"
            raise ChunkError(why, chunk) from None
        if got < len(raw):
            raise self._damaged(chunk, f"it ends at byte {place + got:,}, {len(raw) - got:,} too early")
        if self.checksums is not None and checksum(points) != int(self.checksums[chunk]):
            raise self._damaged(chunk, f"points {first:,} to {first + len(points):,} do not match their checksum")
        return points

    def _read_at(self, place: int, raw: memoryview) -> int:
        """Bytes read; fewer than asked for only at the end of the file."""
        assert self._file is not None
        got = 0
        while got < len(raw):
            if hasattr(os, "preadv"):
                n = os.preadv(self._file.fileno(), [raw[got:]], place + got)
            else:  # Windows: one place in the file for all
                with self._seeking:
                    self._file.seek(place + got)
                    n = self._file.readinto(raw[got:]) or 0
            if n == 0:
                break
            got += n
        return got

    def _damaged(self, chunk: int, what: str) -> ChunkError:
        from viewer.cloud.cache import distrust

        assert self.path is not None
        return ChunkError(f"{self.path}: damaged grid ({what}); {distrust(self.path.parent)}", chunk)

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


def _map_of(points: np.ndarray) -> np.memmap | None:
    """``points`` where they are a whole memory map that shares its file, and no part or copy of one."""
    if isinstance(points, np.memmap) and points.base is points._mmap and points.mode != "c":  # type: ignore
        return points if points.flags.c_contiguous else None
    return None


def _file_of(points: np.ndarray) -> "tuple[Path | None, int]":
    """The file that holds ``points``, and the byte they begin at; None where they are not a file that has a name."""
    from pathlib import Path

    mapped = _map_of(points)
    if mapped is None or mapped.filename is None:
        return None, 0
    return Path(mapped.filename), int(mapped.offset)


def _forgettable(points: np.ndarray) -> Callable[[int, int], None] | None:
    """For a nameless file behind ``points``: what drops the pages of a run from this process; the file keeps them."""
    memory = _map_of(points)
    if memory is None or not hasattr(mmap, "MADV_DONTNEED"):
        return None
    mapped, lead, page = memory._mmap, memory.offset % mmap.ALLOCATIONGRANULARITY, mmap.PAGESIZE  # type: ignore

    def forget(first: int, stop: int) -> None:
        low = -(-(lead + first * POINT_BYTES) // page) * page
        high = (lead + stop * POINT_BYTES) // page * page
        if high > low:
            mapped.madvise(mmap.MADV_DONTNEED, low, high - low)

    return forget


class ChunkReader:
    """Reads requested chunks ahead.  ``wake`` is called, on a thread of the reader, when the first of some has arrived.

    memory: bytes all buffers together may take; they are made when first needed.
    """

    def __init__(self, source: ChunkSource, *, memory: int = READ_AHEAD, threads: int | None = None,
                 wake: Callable[[], None] = lambda: None):
        self.source, self._wake = source, wake
        self._most = max(1, min(memory // source.chunk_bytes, source.chunks))
        self._made = 0
        self._spare: list[np.ndarray] = []  # the last one given back is the next one used: it is in the cache
        self._wanted = np.zeros(source.chunks, bool)  # asked for, not yet handed over
        self._left = 0  # how many of these
        self._queue, self._next = np.empty(0, np.int64), 0
        self._reading: set[int] = set()
        self._ready: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._failures: dict[int, Exception] = {}
        self._closed = False
        self._broken: Exception | None = None  # what ended a thread
        lock = threading.Lock()
        self._jobs, self._news = threading.Condition(lock), threading.Condition(lock)
        count = min(_processors(), _THREADS) if threads is None else threads
        self._threads = [
            threading.Thread(target=self._work, name=f"pointglass reader {n}", daemon=True)
            for n in range(min(count, self._most))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def memory(self) -> int:
        """Bytes of main memory taken by buffers so far."""
        return self._made * self.source.chunk_bytes

    @property
    def arrived(self) -> bool:
        """Whether something is there to be taken."""
        return bool(self._ready) or bool(self._failures)

    @property
    def left(self) -> int:
        """How many of the requested chunks have not been taken yet."""
        return self._left

    def request(self, chunks: np.ndarray) -> None:
        """Asks for ``chunks``, all different, in this order, and for nothing else any more.

        What has been read of them already, or failed, is not read again before it has been handed over.
        """
        with self._jobs:
            self._wanted[:] = False
            self._wanted[chunks] = True
            for chunk in [chunk for chunk in self._ready if not self._wanted[chunk]]:
                self._spare.append(self._ready.pop(chunk)[0])
            for chunk in [chunk for chunk in self._failures if not self._wanted[chunk]]:
                del self._failures[chunk]
            self._queue, self._next = np.array(chunks, np.int64), 0
            self._left = len(self._queue)
            self._jobs.notify_all()

    def arrivals(self, limit: int | None = None, *, wait: bool = False) -> Iterator[tuple[int, np.ndarray]]:
        """(chunk, its points) of what was requested; the points are valid until the next is asked for.

        limit: at most so many.  wait: until all are there; without it, those that are there.
        Raises what reading a chunk raised, once for each; others can still be taken.  Raises what ended a thread of the
        reader, which nothing should.
        """
        given = 0
        while limit is None or given < limit:
            with self._news:
                while not self._ready and not self._failures:
                    if self._broken is not None:
                        raise self._broken
                    if not wait or self._left == 0 or self._closed:
                        return
                    self._news.wait()
                chunk = next(iter(self._failures or self._ready))
                self._wanted[chunk] = False
                self._left -= 1
                if chunk in self._failures:
                    raise self._failures.pop(chunk)
                buffer, points = self._ready.pop(chunk)
            try:
                yield chunk, points
            finally:
                with self._jobs:
                    self._spare.append(buffer)
                    self._jobs.notify()
            given += 1

    def close(self) -> None:
        """Ends the threads and closes the source."""
        with self._jobs:
            self._closed = True
            self._jobs.notify_all()
            self._news.notify_all()
        for thread in self._threads:
            thread.join(_PATIENCE)
        self._ready.clear()
        self._spare.clear()
        if not any(thread.is_alive() for thread in self._threads):  # a closed number could be another file's by then
            self.source.close()

    def _work(self) -> None:
        try:
            self._read_on()
        except Exception as error:  # no memory for a buffer, say: whoever waits must hear of it
            with self._news:
                self._broken = error
                self._news.notify_all()

    def _read_on(self) -> None:
        while (job := self._take()) is not None:
            chunk, buffer = job
            points, failure = buffer, None
            try:
                points = self.source.read(chunk, buffer)
            except Exception as error:  # handed to whoever waits for the chunk
                failure = error
            with self._news:
                self._reading.discard(chunk)
                if failure is None and self._wanted[chunk]:
                    self._ready[chunk] = buffer, points
                else:
                    self._spare.append(buffer)
                    self._jobs.notify()
                if failure is not None and self._wanted[chunk]:
                    self._failures[chunk] = failure
                first = len(self._ready) + len(self._failures) == 1
                self._news.notify_all()
            if first:
                self._wake()

    def _take(self) -> tuple[int, np.ndarray] | None:
        """The next chunk to read and a buffer for it; waits until there are both.  None: closed."""
        with self._jobs:
            while not self._closed:
                while self._next < len(self._queue):
                    chunk = int(self._queue[self._next])
                    dealt_with = chunk in self._ready or chunk in self._reading or chunk in self._failures
                    if self._wanted[chunk] and not dealt_with:
                        break
                    self._next += 1
                else:
                    self._jobs.wait()
                    continue
                if not self._spare and self._made < self._most:
                    self._spare.append(np.empty((self.source.chunk_points, 3), np.uint32))
                    self._made += 1
                if self._spare:
                    self._next += 1
                    self._reading.add(chunk)
                    return chunk, self._spare.pop()
                self._jobs.wait()
        return None


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
