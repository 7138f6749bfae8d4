"""Reads the chunks of a scene and checks their checksums.

A chunk is a run of ``CHUNK`` points of ``Scene.points``; the first chunks are the coarse layers.  Points in a file are read
with pread and never through a memory map: resident memory does not grow with the points read, and a file that is truncated
while it is open gives an error message and not a bus error.
"""

import mmap
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...model.common.system import read_at
from ..common.errors import InputError
from ..grid.cache import mark_damaged
from ..grid.checksum import checksum
from ..grid.npy_column import NpyColumn
from ..grid.scene import CHUNK

if TYPE_CHECKING:
    from pathlib import Path

    from ..grid.scene import Scene

POINT_BYTES = 12
"""Of a packed point: three uint32."""


class ChunkError(InputError):
    """A chunk cannot be read.  chunk: its number."""

    def __init__(self, message: str, chunk: int):
        super().__init__(message)
        self.chunk = chunk


class ChunkFile:
    """Reads points from a grid's file.  start: the byte at which its points begin.  Use it in a ``with`` block, or close it.

    Raises InputError where the file does not exist any more.
    """

    def __init__(self, path: "Path", start: int):
        self.path, self._start = path, start
        self._seeking = threading.Lock()
        try:
            self._file = open(path, "rb", buffering=0)  # noqa: SIM115  (closed by close)
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror})", file=path, remedy="open the scan again") from None

    def __enter__(self) -> "ChunkFile":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def read(self, first: int, into: np.ndarray, chunk: int, expected: int | None = None) -> None:
        """Fills ``into``, (n, 3) uint32, with the points from number ``first`` on.

        chunk: which the error names.  expected: the checksum of the points; None: they are not checked.
        Raises ChunkError naming the file where it cannot be read, is truncated or damaged.
        """
        raw = into.data.cast("B")
        place = self._start + first * POINT_BYTES
        try:
            got = self._read_at(place, raw)
        except OSError as error:
            why = f"{self.path}: cannot be read ({error.strerror}); check the disk and open the scan again"
            raise ChunkError(why, chunk) from None
        if got < len(raw):
            raise self._damaged(chunk, f"it ends at byte {place + got:,}, {len(raw) - got:,} too early")
        if expected is not None and checksum(into) != expected:
            raise self._damaged(chunk, f"points {first:,} to {first + len(into):,} do not match their checksum")

    def _read_at(self, place: int, raw: memoryview) -> int:
        """Returns the bytes read; fewer than requested only at the end of the file."""
        got = 0
        while got < len(raw):
            n = read_at(self._file, raw[got:], place + got, self._seeking)
            if n == 0:
                break
            got += n
        return got

    def _damaged(self, chunk: int, what: str) -> ChunkError:
        return ChunkError(f"{self.path}: damaged grid ({what}); {mark_damaged(self.path.parent)}", chunk)

    def close(self) -> None:
        """Closes the file."""
        self._file.close()


class ChunkSource:
    """Reads the chunks of a scene from its file, or from its array.

    chunk_points: points of a chunk; checksums exist for chunks of CHUNK points and are checked for these only.
    May be used from several threads.  Raises InputError where the file does not exist any more.
    """

    def __init__(self, scene: "Scene", chunk_points: int = CHUNK):
        self.points, self.chunk_points = scene.points, chunk_points
        self._marked = scene.marked
        self.count = len(scene.points)
        self.chunks = -(-self.count // chunk_points)
        self.chunk_bytes = chunk_points * POINT_BYTES
        self.checksums = scene.checksums if chunk_points == CHUNK else None
        self.path, start = _file_of(scene.points)
        self._forgets = _forgettable(scene.points) if self.path is None else None
        self._file = None if self.path is None else ChunkFile(self.path, start)

    def read(self, chunk: int, into: np.ndarray) -> np.ndarray:
        """Reads a chunk's points, (n, 3) uint32, into the first rows of ``into``, (chunk_points, 3) uint32, and returns these.

        Raises ChunkError naming the file where it cannot be read, is truncated or damaged.
        """
        points = self._read(chunk, into)
        if self._marked is not None:
            self._marked.mark_run(points, chunk * self.chunk_points)
        return points

    def _read(self, chunk: int, into: np.ndarray) -> np.ndarray:
        """The points as they are stored, checked."""
        first = chunk * self.chunk_points
        points = into[: min(self.chunk_points, self.count - first)]
        if self._file is None:
            points[:] = self.points[first : first + len(points)]
            if self._forgets is not None:
                self._forgets(first, first + len(points))
            return points
        self._file.read(first, points, chunk, None if self.checksums is None else int(self.checksums[chunk]))
        return points

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


def _map_of(points: np.ndarray) -> np.memmap | None:
    """``points`` if they are a complete memory map that shares its file, else None."""
    if isinstance(points, np.memmap) and points.base is points._mmap and points.mode != "c":  # type: ignore
        return points if points.flags.c_contiguous else None
    return None


def _file_of(points: np.ndarray) -> "tuple[Path | None, int]":
    """The file that holds ``points``, and the byte at which they begin; None where they are not in a file with a name."""
    from pathlib import Path

    if isinstance(points, NpyColumn):
        return Path(points.filename), points.offset
    mapped = _map_of(points)
    if mapped is None or mapped.filename is None:
        return None, 0
    return Path(mapped.filename), int(mapped.offset)


def _forgettable(points: np.ndarray) -> Callable[[int, int], None] | None:
    """For ``points`` in a file without a name: a function that drops the pages of a run from this process's memory; the file
    keeps them."""
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
