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
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ....model.common.system import after_fork_in_child, widen_pipe
from ...common.errors import InputError
from . import laz_worker

ALL = 0xFFFFFFFF
"""Every field of a point; the bits are those of lazrs (SELECTIVE_DECOMPRESS_*).  X, Y and the numbers of returns have none."""
FIELDS = {"xyz": 1, "classification": 2, "intensity": 8, "scan_angle": 16, "user_data": 32, "point_source_id": 64,
          "gps_time": 128, "rgb": 256, "return_number": 0, "number_of_returns": 0}  # fmt: skip
"""Bits of single fields.  Measured: ``convert`` of 1.5 million points of format 8 takes 7.6 s of processor time with the fields
that it uses, 9.2 s with all."""
_PIPE = 1 << 20  # bytes that a process may write before they are read
_SOON = 50_000  # points that are decoded in the time that a process takes to start, at a million a second
_MOST_CHUNKS = 4096  # of a request, so that it stays short: three numbers a chunk, about 120 KB of JSON

_FAULTS = (*(-getattr(signal, name, 0) for name in ("SIGSEGV", "SIGBUS")), 0xC0000005, 0xC00000FD)
"""Exit codes of a process that read beyond its tables or filled its stack; the last two are those of Windows."""

_all: set[subprocess.Popen] = set()
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

    def blocks(self, most: int, fields: int = ALL, *, reused: bool = False) -> Generator[bytearray | np.ndarray, None, None]:
        """Yields the records of all points in order, up to ``most`` at a time; the next are decoded meanwhile.  Raises LazError
        where a chunk is damaged.  fields: what is decoded of point formats 6 to 10, which store each field apart; the others
        repeat those of an earlier point, or mean nothing.  reused: each block is gone when the next is asked for; this takes
        a tenth less time, since the system clears new memory."""
        waiting: list[int] = []
        room = _Room() if reused else None
        with _process(self.path) as process:
            try:
                for request, count in self._requests(most, fields):
                    if waiting:
                        found = _answer(process, waiting.pop() * self.length, room)
                        _ask(process, request)
                        waiting.append(count)
                        yield found
                    else:
                        _ask(process, request)
                        waiting.append(count)
                if waiting:
                    yield _answer(process, waiting.pop() * self.length, room)
            except GeneratorExit:  # no more is wanted: the process is kept where its answer comes sooner than a new one starts
                if sum(waiting) > _SOON or process.poll() is not None:
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
        with _process(self.path) as process:
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
        with _process(self.path) as process:
            _ask(process, self._asked([[place, held, points]]))
            return _answer(process, points * self.length)


@contextmanager
def _process(path: Path) -> Iterator[subprocess.Popen]:
    """A process that decodes: one that is idle, or a new one.  Raises InputError where none can be started to read ``path``."""
    with _lock:
        process = _idle.pop() if _idle else None
    if process is not None and process.poll() is not None:
        _end(process)
        process = None
    if process is None:
        process = _started(path)
    try:
        yield process
    except LazError:
        _keep(process)
        raise
    except BaseException:  # an answer may be on its way
        _end(process)
        raise
    else:
        _keep(process)


def _keep(process: subprocess.Popen) -> None:
    if process.poll() is not None:
        _end(process)
        return
    with _lock:
        _idle.append(process)


def _started(path: Path) -> subprocess.Popen:
    found = find_spec("lazrs")
    if found is None or found.origin is None:
        raise LazError("lazrs is not installed")
    command = [sys.executable, "-I", "-S", laz_worker.__file__, str(Path(found.origin).parents[1])]
    pipe, hidden = subprocess.PIPE, getattr(subprocess, "CREATE_NO_WINDOW", 0)  # of Windows
    try:  # in a session of its own: Ctrl-C in the terminal is for this process
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, bufsize=0,
                                   start_new_session=True, creationflags=hidden)  # fmt: skip
    except OSError as error:
        raise InputError(f"no process can be started that decodes it ({error.strerror or error})", file=path,
                         remedy="close other programs, or allow more processes and open files") from error  # fmt: skip
    with _lock:
        _all.add(process)
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


class _Room:
    """Memory for one block of records after the other."""

    def __init__(self) -> None:
        self._memory = np.empty(0, np.uint8)

    def of(self, size: int) -> np.ndarray:
        if size > len(self._memory):
            self._memory = np.empty(size, np.uint8)
        return self._memory[:size]


def _answer(process: subprocess.Popen, size: int, room: _Room | None = None) -> Any:
    """The records of the request before, ``size`` bytes: a bytearray, or an array in ``room``."""
    if process.stdout is not None and process.stdout.closed:
        raise LazError("this process was forked while the file was read")
    (length,) = struct.unpack("<q", _received(process, bytearray(8)))
    if length >= 0:
        if length != size:
            _end(process)
            raise LazError(f"{length:,} of {size:,} bytes were decoded")
        return _received(process, bytearray(length) if room is None else room.of(length))
    why = _received(process, bytearray(-length)).decode("utf-8", "replace")
    if why == "MemoryError":
        raise MemoryError("the process that decodes LAZ has too little memory")
    raise LazError(why)


def _received(process: subprocess.Popen, found: Any) -> Any:
    """``found``, filled with what the process says."""
    assert process.stdout is not None
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
    if code in _FAULTS:
        return LazError(f"a chunk ends the decoder ({name})")
    raise MemoryError(f"the process that decodes LAZ ended ({name})")  # the system ends it, or Rust does, where memory is short


def _end(process: subprocess.Popen) -> None:
    process.kill()
    _close(process)
    process.wait()
    with _lock:
        _all.discard(process)


def _close(process: subprocess.Popen) -> None:
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()


def _end_all() -> None:
    while True:
        with _lock:
            if not _idle:
                return
            process = _idle.pop()
        _end(process)


def _forget() -> None:
    """In a fork: its parent goes on using the processes, which end where no copy of their pipes is open."""
    global _lock
    _lock = Lock()
    for process in _all:
        process.returncode = 0  # is neither waited for nor killed
        _close(process)
    _all.clear()
    _idle.clear()


atexit.register(_end_all)
after_fork_in_child(_forget)
