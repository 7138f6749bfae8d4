"""The points of a LAZ file, decoded in other processes (laz_worker), which a damaged file may end.

Processes are kept for the next request, of any file: one takes about 50 ms to start.  Safe from any thread.
"""

import atexit
import json
import os
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from threading import Lock

import numpy as np

from ....model.common.system import after_fork_in_child, widen_pipe
from . import laz_worker

ALL = 0xFFFFFFFF
"""Every field of a point; the bits are those of lazrs (DecompressionSelection)."""
_PIPE = 1 << 20  # bytes that a process may write before they are read
_SOON = 50_000  # points that are decoded in the time that a process takes to start, at a million a second
_MOST_CHUNKS = 4096  # of a request, so that it stays short; chosen by hand

_idle: list[subprocess.Popen] = []
_lock = Lock()


class LazError(ValueError):
    """A chunk cannot be decoded; the message says why."""


@dataclass(frozen=True, eq=False)
class LazPoints:
    """record: data of the record that describes the compression.  length: bytes of a point.  points, held, place: (C,) int64,
    points and bytes of each chunk, and the byte at which it begins."""

    path: Path
    record: bytes
    length: int
    points: np.ndarray
    held: np.ndarray
    place: np.ndarray

    def blocks(self, most: int, fields: int = ALL) -> Iterator[bytearray]:
        """Yields the records of all points in order, up to ``most`` at a time; the next are decoded meanwhile.  Raises LazError
        where a chunk is damaged.  fields: what is decoded; others repeat those of an earlier point."""
        waiting: list[int] = []
        with _process() as process:
            try:
                for request, count in self._requests(most, fields):
                    if waiting:
                        found = _answer(process, waiting.pop() * self.length)
                        _ask(process, request)
                        waiting.append(count)
                        yield found
                    else:
                        _ask(process, request)
                        waiting.append(count)
                if waiting:
                    yield _answer(process, waiting.pop() * self.length)
            except GeneratorExit:  # no more is wanted: the process is kept where its answer comes sooner than a new one starts
                if sum(waiting) > _SOON:
                    raise
                for count in waiting:
                    with suppress(LazError):
                        _answer(process, count * self.length)

    def _requests(self, most: int, fields: int) -> Iterator[tuple[dict, int]]:
        """Yields requests, and the number of points of each: of whole chunks, or of parts of a large one."""
        first, chunks = 0, len(self.points)
        while first < chunks:
            last, count = first, 0
            while last < chunks and last - first < _MOST_CHUNKS and count + self.points[last] <= most:
                count += int(self.points[last])
                last += 1
            if count:
                yield self._request(first, last, fields), count
            elif last == first:
                for skip in range(0, int(self.points[first]), most):
                    count = min(most, int(self.points[first]) - skip)
                    yield self._request(first, first + 1, fields) | {"skip": skip, "count": count}, count
                last += 1
            first = last

    def _request(self, first: int, last: int, fields: int = ALL) -> dict:
        chunks = np.stack([self.place[first:last], self.held[first:last], self.points[first:last]], 1)
        return self._asked(chunks[chunks[:, 2] > 0].tolist(), fields)

    def _asked(self, chunks: list[list[int]], fields: int = ALL) -> dict:
        path = os.fsencode(os.path.abspath(self.path))
        return {"path": path.hex(), "record": self.record.hex(), "fields": fields, "chunks": chunks}

    def read(self, start: int, stop: int) -> bytearray:
        """The records of points start to stop, as many as there are.  Raises LazError where they cannot be decoded."""
        edges = np.append(0, self.points.cumsum())
        found = bytearray()
        with _process() as process:
            for chunk in range(int(np.searchsorted(edges, start, "right")) - 1, len(self.points)):
                low, high = max(start, int(edges[chunk])), min(stop, int(edges[chunk + 1]))
                if low >= high:
                    if edges[chunk] >= stop:
                        break
                    continue
                request = self._request(chunk, chunk + 1)
                if high - low < self.points[chunk]:
                    request |= {"skip": low - int(edges[chunk]), "count": high - low}
                _ask(process, request)
                found += _answer(process, (high - low) * self.length)
        return found

    def chunk(self, place: int, held: int, points: int) -> bytearray:
        """The records of the chunk of ``held`` bytes at byte ``place``, which the table of chunks may not know."""
        with _process() as process:
            _ask(process, self._asked([[place, held, points]]))
            return _answer(process, points * self.length)


@contextmanager
def _process() -> Iterator[subprocess.Popen]:
    """A process that decodes: one that is idle, or a new one."""
    with _lock:
        process = _idle.pop() if _idle else None
    if process is None or process.poll() is not None:
        process = _started()
    try:
        yield process
    except LazError:
        if process.poll() is None:
            with _lock:
                _idle.append(process)
        raise
    except BaseException:  # an answer may be on its way
        _end(process)
        raise
    else:
        with _lock:
            _idle.append(process)


def _started() -> subprocess.Popen:
    found = find_spec("lazrs")
    if found is None or found.origin is None:
        raise LazError("lazrs is not installed")
    command = [sys.executable, "-I", "-S", laz_worker.__file__, str(Path(found.origin).parents[1])]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, bufsize=0)
    if process.stdout is not None:
        widen_pipe(process.stdout.fileno(), _PIPE)
    return process


def _ask(process: subprocess.Popen, request: dict) -> None:
    assert process.stdin is not None
    data = memoryview(json.dumps(request).encode() + b"\n")
    try:
        while data:
            data = data[process.stdin.write(data) :]
    except OSError:  # a broken pipe, which Windows calls an invalid argument
        raise _ended(process) from None


def _answer(process: subprocess.Popen, size: int) -> bytearray:
    """The records of the request before, ``size`` bytes."""
    (length,) = struct.unpack("<q", _received(process, 8))
    if length >= 0:
        if length != size:
            _end(process)
            raise LazError(f"{length:,} of {size:,} bytes were decoded")
        return _received(process, length)
    why = _received(process, -length).decode("utf-8", "replace")
    if why == "MemoryError":
        raise MemoryError("the process that decodes LAZ has too little memory")
    raise LazError(why)


def _received(process: subprocess.Popen, size: int) -> bytearray:
    assert process.stdout is not None
    found = bytearray(size)
    left = memoryview(found)
    while left:
        count = process.stdout.readinto(left)  # type: ignore[attr-defined]  # a raw file
        if not count:
            raise _ended(process)
        left = left[count:]
    return found


def _ended(process: subprocess.Popen) -> LazError:
    """What is said of a process that ended by itself."""
    code = process.wait()
    name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    if code == -signal.SIGSEGV:
        return LazError("a chunk ends the decoder (SIGSEGV)")
    raise MemoryError(f"the process that decodes LAZ ended ({name})")  # the system ends it, or Rust does, where memory is short


def _end(process: subprocess.Popen) -> None:
    process.kill()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()
    process.wait()


def _end_all() -> None:
    with _lock:
        while _idle:
            _end(_idle.pop())


def _forget() -> None:
    """In a fork: its parent goes on using the processes."""
    global _lock
    _lock = Lock()
    for process in _idle:
        process.returncode = 0  # is not waited for
    _idle.clear()


atexit.register(_end_all)
after_fork_in_child(_forget)
