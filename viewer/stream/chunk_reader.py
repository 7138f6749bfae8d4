"""Prefetches chunks of packed points: threads read them into a bounded set of buffers, in the requested order.  No OpenGL
here."""

import threading
from collections.abc import Callable, Iterator

import numpy as np

from ...model.common.process.processors import usable_processors
from ..picture.settings import MEMORY
from .chunk_source import ChunkSource
from .joined_chunks import JoinedChunks

READ_AHEAD = MEMORY.read_ahead
"""Bytes of main memory for the buffers of a reader, by default."""
_THREADS = 4
"""At most: one reads and checks 1.5 GB/s (studio.laz in the system's cache, a processor's time), so that four reach 6 of the
7.9 GB/s that a disk on four lanes of PCIe 4.0 can have; half would not reach the 3.9 of PCIe 3.0."""
_PATIENCE = 5.0  # seconds that closing waits for a read that hangs: a chunk, 768 KiB, takes less even at 160 kB/s


class ChunkReader:
    """Prefetches requested chunks.  wake: called on a thread of the reader when a chunk arrives and none was there before.

    memory: bytes of all buffers together; they are allocated when first needed.
    """

    def __init__(self, source: ChunkSource | JoinedChunks, *, memory: int = READ_AHEAD, threads: int | None = None,
                 wake: Callable[[], None] = lambda: None):
        self.source, self._wake = source, wake
        self._most = max(1, min(memory // source.chunk_bytes, source.chunks))
        self._made = 0
        self._spare: list[np.ndarray] = []  # a stack: the buffer returned last is still in the cache
        self._wanted = np.zeros(source.chunks, bool)  # requested and not yet taken
        self._left = 0  # number of these
        self._queue, self._next = np.empty(0, np.int64), 0
        self._reading: set[int] = set()
        self._ready: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._failures: dict[int, Exception] = {}
        self._closed = False
        self._broken: Exception | None = None  # the error that ended a thread
        lock = threading.Lock()
        self._jobs, self._news = threading.Condition(lock), threading.Condition(lock)
        count = min(usable_processors(), _THREADS) if threads is None else threads
        self._threads = [
            threading.Thread(target=self._work, name=f"pointglass reader {n}", daemon=True)
            for n in range(min(count, self._most))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def memory(self) -> int:
        """Bytes of main memory allocated for buffers."""
        return self._made * self.source.chunk_bytes

    @property
    def arrived(self) -> bool:
        """Whether a chunk or an error can be taken."""
        return bool(self._ready) or bool(self._failures)

    @property
    def left(self) -> int:
        """Number of requested chunks that have not been taken yet."""
        return self._left

    def request(self, chunks: np.ndarray) -> None:
        """Requests ``chunks``, all different, in this order, and cancels all earlier requests.

        Chunks that have been read already, or failed, are not read again before they are taken.
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
        """Yields (chunk, its points) of the requested chunks; the points are valid until the next one is yielded.

        limit: of chunks.  wait: wait until all have arrived; otherwise those that are there.
        Raises the error of reading a chunk, once for each chunk; others can still be taken.  Raises the error that ended a
        thread of the reader, should there be one.
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
        if not any(thread.is_alive() for thread in self._threads):  # else one could read another file of the same number
            self.source.close()

    def _work(self) -> None:
        try:
            self._read_on()
        except Exception as error:  # any, such as MemoryError: it is raised again on the thread that waits
            with self._news:
                self._broken = error
                self._news.notify_all()

    def _read_on(self) -> None:
        while (job := self._take()) is not None:
            chunk, buffer = job
            points, failure = buffer, None
            try:
                points = self.source.read(chunk, buffer)
            except Exception as error:  # any: it is raised again on the thread that takes the chunk
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
                    handled = chunk in self._ready or chunk in self._reading or chunk in self._failures
                    if self._wanted[chunk] and not handled:
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
