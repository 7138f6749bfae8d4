"""The chunks of all sources, decoded once: the first walk keeps what it read, later walks repeat it.

Decoding takes most of the time of a compressed file, and the grid is built in two passes.  The first MEMORY bytes are kept in
memory, the rest in a file without a name in the folder of the grid.  Where that folder has no room for the chunks besides the
grid's own points, later walks decode the files again.
"""

import shutil
import tempfile
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import fields, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from ....model.common.system import address_space_is_limited
from ...common.errors import InputError
from ...common.progress import progress
from ...readers.source import Chunk, Source

MEMORY = 96 << 20
"""Bytes of chunks kept in memory: 3 million points of a LAZ file.  None where the address space is limited."""
_GRID_BYTES = 17
"""Bytes of a point in the grid, with its running number."""
_SPARE = 256 << 20
"""Bytes of the disk left free, besides those of the grid's points."""
_ARRAYS = tuple(field.name for field in fields(Chunk) if field.name != "invalid")

_Stored = tuple[Chunk, dict[str, tuple[int, np.dtype, tuple[int, ...]]]]
"""A chunk without the arrays that are in the file, and for each of these where it begins, its type and shape."""


class KeptChunks:
    """Walks over the chunks of ``sources``.  Use it in a ``with`` block, since it owns a file.

    folder: for the file; None: the folder for temporary files.
    """

    def __init__(self, sources: Sequence[Source], folder: Path | None = None):
        self.sources = sources
        self._folder = Path(tempfile.gettempdir()) if folder is None else folder
        self._file: IO[bytes] | None = None
        self._kept: dict[int, list[_Stored]] = {}
        self._held = self._written = 0
        self._room = 0 if address_space_is_limited() else MEMORY
        self._refused = [not source.worth_keeping for source in sources]

    def __enter__(self) -> "KeptChunks":
        return self

    def __exit__(self, *_: Any) -> None:
        self._kept = {}
        self.drop_file()

    def drop_file(self) -> bool:
        """Frees the file; later walks decode again what was in it.  Returns whether there was one."""
        file, self._file = self._file, None
        if file is None:
            return False
        file.close()
        for number in [number for number, stored in self._kept.items() if any(places for _, places in stored)]:
            del self._kept[number]
        self._refused = [refused or number not in self._kept for number, refused in enumerate(self._refused)]
        return True

    def walk(self, label: str) -> Iterator[tuple[int, Chunk]]:
        """Yields (number of the source, chunk) over all sources, each read on a thread while the one before it is worked on,
        and shows progress under ``label``.  Arrays of chunks must not be changed.  Raises InputError where a file is damaged or
        cannot be read."""
        counts = [source.count for source in self.sources]
        total = sum(c for c in counts if c is not None) if None not in counts else 0
        done = 0
        with progress(total, label, unit=" points") as meter, ThreadPoolExecutor(1, "keep") as keeper:
            for number, source in enumerate(self.sources):
                stored = self._kept.get(number)
                new: list[_Stored] | None = [] if stored is None and not self._refused[number] else None
                held = self._held
                with closing(_prefetched(source, source.chunks() if stored is None else self._repeated(stored))) as chunks:
                    for chunk in chunks:
                        done += len(chunk.xyz)
                        keeping = keeper.submit(self._keep, new, chunk, max(total, 2 * done)) if new is not None else None
                        yield number, chunk  # it is worked on while it is written
                        if keeping is not None and not keeping.result():
                            self._held, self._refused[number], new = held, True, None
                        meter.update(len(chunk.xyz) + chunk.invalid)
                if new is not None:
                    self._kept[number] = new

    def _keep(self, kept: list[_Stored], chunk: Chunk, points: int) -> bool:
        """Adds a chunk; returns False where there is no room for it.  points: of all files, about."""
        arrays = {name: values for name in _ARRAYS if isinstance(values := getattr(chunk, name), np.ndarray)}
        size = sum(array.nbytes for array in arrays.values())
        if self._held + size <= self._room:
            self._held += size
            kept.append((replace(chunk, **{name: _owned(array) for name, array in arrays.items()}), {}))
            return True
        try:
            if shutil.disk_usage(self._folder).free < size + _GRID_BYTES * points + _SPARE:
                return False
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder, prefix="pointglass-", buffering=0)  # noqa: SIM115
            places = {name: self._write(array) for name, array in arrays.items()}
        except OSError:
            return False
        kept.append((replace(chunk, **dict.fromkeys(arrays)), places))
        return True

    def _write(self, array: np.ndarray) -> tuple[int, np.dtype, tuple[int, ...]]:
        assert self._file is not None
        begin, data = self._written, np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
        self._file.seek(begin)
        while data:
            data = data[self._file.write(data) :]
        self._written += array.nbytes
        return begin, array.dtype, array.shape

    def _repeated(self, stored: list[_Stored]) -> Iterator[Chunk]:
        for chunk, places in stored:
            yield replace(chunk, **{name: self._read(*place) for name, place in places.items()}) if places else chunk

    def _read(self, begin: int, dtype: np.dtype, shape: tuple[int, ...]) -> np.ndarray:
        assert self._file is not None
        array = np.empty(shape, dtype)
        data = array.reshape(-1).view(np.uint8).data
        self._file.seek(begin)
        while data:
            count = self._file.readinto(data)  # type: ignore[attr-defined]  # a raw file has it
            if not count:
                raise OSError("the file of kept points is shorter than it was written")
            data = data[count:]
        return array


def _owned(array: np.ndarray) -> np.ndarray:
    """The array, or a copy where it is a view of a larger one, which would be kept in memory with it."""
    base = array.base
    return array if base is None or (isinstance(base, np.ndarray) and base.nbytes == array.nbytes) else array.copy()


def _prefetched(source: Source, chunks: Iterator[Chunk]) -> Generator[Chunk, None, None]:
    """The chunks, each read on a thread while the one before it is worked on."""
    with ThreadPoolExecutor(1, "read") as reader:
        coming = reader.submit(next, chunks, None)
        try:
            while (chunk := coming.result()) is not None:
                coming = reader.submit(next, chunks, None)
                yield chunk
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", file=source.path) from None
