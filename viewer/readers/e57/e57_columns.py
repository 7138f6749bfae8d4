"""The fields of an E57's scans as columns of float64, block by block, decoded here or in a process of their own.

libe57 keeps Python's lock while it decodes, so that nothing else of this process runs then.  A process of its own
(viewer.readers.e57.e57_worker) writes the blocks of large files into memory that both processes have; the next block is decoded
while one is worked on.  The columns have the same bytes.
"""

import contextlib
import logging
import mmap
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....model.common.system import WINDOWS, allocate, file_in_memory
from ...common.errors import InputError
from ...common.workers.messages import receive_bytes, send
from ..source import CHUNK
from .e57_nodes import library

BLOCK = CHUNK // 2
"""Points of a block: a column takes 4 MB.  Twice raises the peak from 177 MB to 300."""
SLOTS = 2
"""Blocks in memory at the same time: one is decoded, one is worked on."""
APART = 6_000_000
"""Points of a file from which on a process of its own decodes it.  With 10.3 million a grid is made in 200 to 209 ms for a
million points, in 199 to 241 without (in turn, at real-time priority); the process takes about 0.2 s to start."""
_PROGRAM = ("import sys; sys.path[:] = {path!r}; import pointglass; "
            "from pointglass.viewer.readers.e57.e57_worker import main; main()")
_log = logging.getLogger(__name__)

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Wanted:
    """Columns of one scan.  number: of the scan in the file.  count: its points.  names: of the fields."""

    number: int
    count: int
    names: tuple[str, ...]


@dataclass(frozen=True)
class Request:
    """What the process is told.  memory: descriptor, or on Windows the name, of memory of ``size`` bytes, SLOTS of equal size;
    columns lie behind each other in a slot."""

    path: Path
    scans: tuple[Wanted, ...]
    memory: int | str
    size: int
    block: int


def column_blocks(file: Any, wanted: Wanted, block: int) -> Iterator[Columns]:
    """Yields blocks of a scan, which are valid until the next is asked for.  Ends early where the file is truncated.

    file: as opened with libe57.  block: points of one at most.
    """
    libe57, capacity = library(), min(block, wanted.count)
    points, arrays = file.root()["data3D"][wanted.number]["points"], {name: np.empty(capacity) for name in wanted.names}
    buffers = libe57.VectorSourceDestBuffer()  # for all blocks: its reader ignores others that it is given later
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(file, name, array, capacity, True, True))
    reader, done = points.reader(buffers), 0
    try:
        while done < wanted.count and (n := reader.read()):
            done += n
            yield {name: array[:n] for name, array in arrays.items()}
    finally:
        if reader.isOpen():
            reader.close()


def slots_in(memory: Any, names: tuple[str, ...], size: int, block: int) -> list[Columns]:
    """Columns of ``block`` points for each slot of memory of ``size`` bytes."""
    return [
        {name: np.frombuffer(memory, np.float64, block, slot * (size // SLOTS) + 8 * block * number)
         for number, name in enumerate(names)}
        for slot in range(SLOTS)
    ]


@contextlib.contextmanager
def _memory(size: int) -> Iterator[tuple[int | str, mmap.mmap]]:
    """Memory that another process can have, and how it is named."""
    if WINDOWS:
        name = f"pointglass-{os.getpid()}-{os.urandom(8).hex()}"
        yield name, mmap.mmap(-1, size, tagname=name)  # type: ignore[call-arg]
        return
    with contextlib.ExitStack() as opened:
        file = file_in_memory("pointglass")
        if file is None:
            file = opened.enter_context(tempfile.TemporaryFile()).fileno()
        else:
            opened.callback(os.close, file)
        try:
            allocate(file, size)
        except OSError as error:
            raise MemoryError(f"no {size:,} bytes of memory for decoded points") from error
        yield file, mmap.mmap(file, size)


def decoded_apart(path: Path, scans: list[Wanted], block: int) -> Generator[tuple[int, Columns], None, None]:
    """Yields the number of the scan and a block of its columns, of scan after scan, decoded in another process.  Arrays are
    valid until the next are asked for.  Ends in a scan that is truncated.  Raises InputError as open_e57 of e57_nodes does, and
    where the process is ended."""
    size = SLOTS * 8 * block * max(len(scan.names) for scan in scans)
    with _memory(size) as (named, memory):
        process = _started(path, named)
        assert process.stdin is not None and process.stdout is not None
        try:
            with contextlib.suppress(OSError):  # it has ended already, which its first answer tells
                send(process.stdin, Request(path, tuple(scans), named, size, block))
            turn = 0
            for scan in scans:
                slots = slots_in(memory, scan.names, size, block)
                done = 0
                while n := _answer(process, path):
                    done += n
                    yield scan.number, {name: values[:n] for name, values in slots[turn].items()}
                    turn = (turn + 1) % SLOTS
                    with contextlib.suppress(OSError):
                        process.stdin.write(b".")
                        process.stdin.flush()
                if done < scan.count:
                    return
        finally:
            _end(process)


def _started(path: Path, named: int | str) -> subprocess.Popen:
    program = _PROGRAM.format(path=[os.path.abspath(place) for place in sys.path])
    apart: dict[str, Any] = (  # in a session of its own: Ctrl-C in the terminal is for this process
        {"creationflags": subprocess.CREATE_NO_WINDOW} if WINDOWS  # type: ignore[attr-defined]
        else {"start_new_session": True, "pass_fds": (named,)})
    try:
        return subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, **apart)
    except OSError as error:
        raise InputError(f"no process can be started that decodes it ({error.strerror or error})", file=path,
                         remedy="close other programs, or allow more processes and open files") from error  # fmt: skip


def _answer(process: subprocess.Popen, path: Path) -> int:
    """Points of the next block, 0 at the end of a scan."""
    assert process.stdout is not None
    data = receive_bytes(process.stdout)
    if data is None:
        code = process.wait()
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        raise InputError(f"the process that decodes it has ended ({how})", file=path,
                         remedy="try again, and close other programs where memory is short")
    answer = pickle.loads(data)
    if isinstance(answer, BaseException):
        raise answer
    return answer


def _end(process: subprocess.Popen) -> None:
    for stream in (process.stdin, process.stdout):
        with contextlib.suppress(OSError):
            if stream is not None:
                stream.close()
    process.kill()
    process.wait()
