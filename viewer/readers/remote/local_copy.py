"""A copy of a file at an address, of which some blocks are there: filled in any order, resumed after an interruption.

Beside the copy lie its state (JSON: the address without secrets, length, tag, whether it is complete) and one bit for each
block.  A copy whose file changed on the server begins anew; readers never see a mixture.
"""

import contextlib
import json
import os
import shutil
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ...common.errors import InputError
from ...common.progress import progress
from .parallel_requests import answers
from .remote_object import RemoteObject

BLOCK = 1 << 14
"""Bytes of a block: so small that header and hierarchy of an octree are read without much beside them."""
PIECE = 1 << 20
"""Bytes of a request, at most: those under way are waited for after Ctrl-C, on a line of 1 MB/s for six seconds."""
SPARE = 256 << 20
"""Bytes that stay free on the disk."""
_KEPT_S = 2.0
"""Seconds between notes of which blocks are there."""


class LocalCopy:
    """path: of the copy, as long as the file, with zeros where nothing was read yet."""

    def __init__(self, folder: Path, name: str, remote: RemoteObject):
        self.path, self.remote = folder / name, remote
        self._state, self._bits = folder / "state.json", folder / "blocks"
        folder.mkdir(parents=True, exist_ok=True)
        state = read_state(folder)
        same = state is not None and state["size"] == remote.size and state["tag"] == remote.tag
        blocks = -(-remote.size // BLOCK)
        self._there = np.zeros(blocks, bool)
        if same and state is not None and self.path.is_file() and self.path.stat().st_size == remote.size:
            if state["complete"]:
                self._there[:] = True
            else:
                with contextlib.suppress(OSError):
                    bits = np.frombuffer(self._bits.read_bytes(), np.uint8)
                    if len(bits) == -(-blocks // 8):
                        self._there = np.unpackbits(bits, count=blocks).astype(bool)
        else:
            self._new()
        if remote.head:
            self.fetch([(0, len(remote.head))])

    @property
    def complete(self) -> bool:
        return bool(self._there.all())

    @property
    def share(self) -> float:
        """Share of the file that is there."""
        return float(self._there.mean())

    def fetch(self, ranges: Iterable[tuple[int, int]], label: str | None = None) -> None:
        """Reads what is not there of ranges of bytes, first and last, the last left out.  label: of the progress; None: no
        progress.  What came is kept, whatever ends the work.

        Raises ChangedFileError; InputError where the file cannot be read or the disk is full; Cancelled.
        """
        pieces = self._pieces(ranges)
        wanted = sum(last - first for first, last in pieces)
        if not pieces:
            return
        if wanted + SPARE > (free := shutil.disk_usage(self.path.parent).free):
            raise InputError(f"{free / 1e9:,.1f} GB are free, and {wanted / 1e9:,.1f} GB of {self.path.name} are to be read",
                             file=self.path.parent, remedy="make room, or set POINTGLASS_CACHE to a folder with more")
        shown = progress(max(wanted >> 20, 1), label, " MB") if label else contextlib.nullcontext()
        try:
            with shown as meter, self._opened() as file:
                self._in_threads(pieces, file, meter)
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=self.path,
                             remedy="make room, or set POINTGLASS_CACHE to another folder") from None
        finally:
            self._note()

    def empty(self) -> None:
        """Gives up what is there."""
        self._there[:] = False
        self._new()

    def fetch_all(self, label: str) -> None:
        """Reads all that is not there."""
        if not (self.remote.ranges or self.complete):
            self._stream(label)
        self.fetch([(0, self.remote.size)], label)
        os.utime(self.path, (self.remote.modified, self.remote.modified))  # the grid made of it is found again by it

    def _in_threads(self, pieces: list[tuple[int, int]], file: int, meter: Any) -> None:
        done, shown, noted = 0, 0, time.monotonic()
        for answer in answers(pieces, lambda piece: self.remote.read(*piece)):
            if answer is not None:
                (first, last), data = answer
                _write(file, data, first)
                self._there[first // BLOCK : -(-last // BLOCK)] = True
                done += last - first
            if meter is not None:  # also where nothing came: a window cancels here
                meter.update((done >> 20) - shown)
                meter.say(self.remote.waiting)
                shown = done >> 20
            if time.monotonic() > noted + _KEPT_S:
                os.fsync(file)  # before it is noted to be there
                self._note()
                noted = time.monotonic()

    def _stream(self, label: str) -> None:
        """The whole file in one request, from a server that gives no parts."""
        done = shown = 0
        with progress(max(self.remote.size >> 20, 1), label, " MB") as meter, self._opened() as file:
            for piece in self.remote.pieces(PIECE):
                _write(file, piece, done)
                done += len(piece)
                meter.update((done >> 20) - shown)
                shown = done >> 20
        if done != self.remote.size:
            raise InputError(f"{self.remote.address.text}: {done:,} of {self.remote.size:,} bytes came", remedy="try again")
        self._there[:] = True
        self._note()

    def _pieces(self, ranges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        """The blocks of ranges that are missing, neighbours together up to PIECE, in the order of the ranges."""
        taken, pieces = self._there.copy(), []
        for first, last in _merged(ranges):
            low, high = max(first, 0) // BLOCK, -(-min(last, self.remote.size) // BLOCK)
            missing = np.flatnonzero(~taken[low:high]) + low
            taken[low:high] = True
            for run in np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1):
                if len(run):
                    end = min((int(run[-1]) + 1) * BLOCK, self.remote.size)
                    pieces += [(at, min(at + PIECE, end)) for at in range(int(run[0]) * BLOCK, end, PIECE)]
        return pieces

    def _new(self) -> None:
        """An empty copy in place of any other: another file, so that nobody who reads the old one sees it change."""
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        self._note()
        with self.path.open("wb") as file:
            file.truncate(self.remote.size)

    @contextlib.contextmanager
    def _opened(self):
        file = os.open(self.path, os.O_RDWR | getattr(os, "O_BINARY", 0))
        try:
            yield file
        finally:
            with contextlib.suppress(OSError):
                os.fsync(file)  # before it is noted to be there
            os.close(file)

    def _note(self) -> None:
        state = {"address": self.remote.address.text, "name": self.path.name, "size": self.remote.size, "tag": self.remote.tag,
                 "complete": self.complete}
        bits = np.packbits(self._there).tobytes()
        with contextlib.suppress(OSError):  # of a full disk: what is not noted is read again
            write_atomic(self._bits, lambda beside: beside.write_bytes(bits))
            write_atomic(self._state, lambda beside: beside.write_text(json.dumps(state)))


def read_state(folder: Path) -> dict[str, Any] | None:
    """The state of the copy in a folder; None where there is none that can be read."""
    try:
        state = json.loads((folder / "state.json").read_text())
        return state if isinstance(state["size"], int) and isinstance(state["complete"], bool) and state["tag"] else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _merged(ranges: Iterable[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Ranges, of which those that follow each other closely are one, so that they are one request."""
    begin = end = 0
    for first, last in ranges:
        if begin <= first <= end + BLOCK:
            end = max(end, last)
            continue
        if end > begin:
            yield begin, end
        begin, end = first, last
    yield begin, end


def _write(file: int, data: bytes, place: int) -> None:
    left = memoryview(data)
    while left:
        if hasattr(os, "pwrite"):
            written = os.pwrite(file, left, place)
        else:  # Windows; one thread writes
            os.lseek(file, place, os.SEEK_SET)
            written = os.write(file, left)
        left, place = left[written:], place + written
