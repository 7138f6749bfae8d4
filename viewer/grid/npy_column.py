"""The columns of a grid on disk, .npy files, whose rows are read when they are indexed.

Nothing is memory-mapped: where another program truncates a mapped file, or its disk goes away, whatever thread touches the map
ends the process (SIGBUS).  A read that fails is an error message.
"""

import contextlib
import io
import math
import os
import re
import threading
import tokenize
import warnings
import weakref
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...model.common.system import read_at
from ..common.errors import InputError
from .grid_header import DamagedGrid, first_line

_NPY_ERRORS = (OSError, ValueError, TypeError, SyntaxError, EOFError, OverflowError, MemoryError, RecursionError, KeyError,
               IndexError, Warning, tokenize.TokenError)  # fmt: skip
"""What a damaged .npy header raises: NumPy evaluates it as a Python literal and makes a type of it."""
_PLAIN_NPY = re.compile(rb"\x93NUMPY\x01\x00\x76\x00\{'descr': '(?P<type>[<|][uif][1248])', 'fortran_order': False, "
                        rb"'shape': \((?P<shape>\d{1,15}, ?(?:\d{1,9}, ?){0,2}\d{0,9})\), \} *\n")
"""The header of 128 bytes that NumPy writes for arrays of numbers, read here in a fifth of the time that NumPy takes: a place
has hundreds of grids of ten arrays.  Other headers are left to NumPy."""
_GAP = 16 << 10
"""Bytes between two wanted rows that are read with them, rather than by a call of their own: 3 us either way, measured."""
_LONGEST = 1 << 48
"""Values along a side of an array, at most; no file holds as many."""
_PIECE = 8 << 20
"""Bytes that are read at once where not all of them are wanted."""


def loaded(path: Path | str) -> np.ndarray:
    """The array in an .npy file, read into memory.  Raises DamagedGrid naming the file where there is none."""
    with _opened(path) as file:
        try:
            if found := _PLAIN_NPY.match(data := bytearray(file.read())):
                shape, dtype = _described(found)
                if len(found[0]) + math.prod(shape) * dtype.itemsize <= len(data):
                    return np.frombuffer(data, dtype, math.prod(shape), len(found[0])).reshape(shape)
        except _NPY_ERRORS as error:
            raise _damage(path, error) from None
    return NpyColumn(path)[:]


def _described(found: re.Match) -> tuple[tuple[int, ...], np.dtype]:
    """Shape and type of a plain header."""
    return tuple([int(side) for side in found["shape"].split(b",") if side.strip()]), np.dtype(found["type"].decode())


class IndexedRows:
    """A column that is not an array in memory: its rows are read where they are indexed, by a slice, whole numbers or a mask.

    shape, dtype: of the whole; rows are the first axis.  Every result is a new array.
    """

    def __init__(self, shape: tuple[int, ...], dtype: np.dtype):
        self.shape, self.dtype, self.ndim = shape, dtype, len(shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> np.ndarray:
        if isinstance(index, tuple):
            return self[index[0]][(slice(None), *index[1:])]
        if isinstance(index, slice):
            return self._sliced(*index.indices(len(self)))
        numbers = np.asarray(index)
        if numbers.dtype == bool:
            numbers = np.flatnonzero(numbers)
        wanted = np.where(numbers < 0, numbers + len(self), numbers).reshape(-1).astype(np.int64)
        if len(wanted) and not 0 <= wanted.min() <= wanted.max() < len(self):
            raise IndexError(f"points {wanted.min()} to {wanted.max()} of {len(self)}")
        found = self._some(wanted)
        return found[0] if numbers.ndim == 0 else found

    def _sliced(self, start: int, stop: int, step: int) -> np.ndarray:
        return self._run(start, max(start, stop)) if step == 1 else self._some(np.arange(start, stop, step))

    def _run(self, start: int, stop: int) -> np.ndarray:
        """The rows from ``start`` to ``stop``."""
        raise NotImplementedError

    def _some(self, numbers: np.ndarray) -> np.ndarray:
        """The rows (n,) int64, each from 0 to the length, in any order."""
        raise NotImplementedError


class NpyColumn(IndexedRows):
    """A column of a grid, read from its file.  From any thread.

    late: the file is opened whenever rows are read, as a place has more grids than a process may have open files.  Otherwise it
    stays open until the column is dropped, so that a grid that takes its name meanwhile is not read in its place.
    filename: of the file.  offset: the byte at which its rows begin.
    Raises DamagedGrid naming the file where there is no such array.  Reading rows raises InputError where the file cannot be
    read, or has become another or shorter one.
    """

    def __init__(self, path: Path | str, *, late: bool = False):
        self.filename = os.fspath(path)
        file = _opened(path)
        try:
            shape, dtype, self.offset = _layout(path, file)
        except DamagedGrid:
            file.close()
            raise
        super().__init__(shape, dtype)
        self._row = math.prod(shape[1:]) * dtype.itemsize
        self._seeking = threading.Lock()
        self._file = None if late else file
        if late:
            file.close()
        else:
            weakref.finalize(self, file.close)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        found = self[:]
        return found if dtype is None else found.astype(dtype, copy=False)

    def _run(self, start: int, stop: int) -> np.ndarray:
        with self._reading() as file:
            return self._rows(file, start, stop)

    def _some(self, numbers: np.ndarray) -> np.ndarray:
        if len(numbers) == 0:
            return np.empty((0, *self.shape[1:]), self.dtype)
        away, order = np.diff(numbers), None
        if len(away) and away.min() < 0:
            order = np.argsort(numbers, kind="stable")
            numbers = numbers[order]
            away = np.diff(numbers)
        piece = max(_PIECE // self._row, 1)
        cut = (away > max(_GAP // self._row, 1)) | (np.diff(numbers // piece) > 0)
        edges = [0, *(np.flatnonzero(cut) + 1).tolist(), len(numbers)]
        found = np.empty((len(numbers), *self.shape[1:]), self.dtype)
        with self._reading() as file:
            for low, high in pairwise(edges):
                first = int(numbers[low])
                rows = self._rows(file, first, int(numbers[high - 1]) + 1)
                found[low:high] = rows if high - low == 1 else rows[numbers[low:high] - first]
        if order is None:
            return found
        sorted_rows, found = found, np.empty_like(found)
        found[order] = sorted_rows
        return found

    @contextlib.contextmanager
    def _reading(self):
        """The open file, whose errors are worded.  Raises InputError."""
        try:
            if self._file is not None:
                yield self._file
                return
            with _opened(self.filename) as file:
                if _layout(self.filename, file) != (self.shape, self.dtype, self.offset):
                    raise InputError("has changed since it was opened", file=self.filename, remedy="open the scan again")
                yield file
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror or error})", file=self.filename,
                             remedy="check the disk and open the scan again") from None
        except DamagedGrid as error:
            raise InputError(f"has changed since it was opened ({error})", file=self.filename,
                             remedy="open the scan again, which builds its grid anew") from None

    def _rows(self, file: io.FileIO, start: int, stop: int) -> np.ndarray:
        found = np.empty((stop - start, *self.shape[1:]), self.dtype)
        raw, place, got = found.reshape(-1).view(np.uint8).data, self.offset + start * self._row, 0
        while got < len(raw):
            read = read_at(file, raw[got:], place + got, self._seeking)
            if read == 0:
                raise InputError("was truncated while it was open", file=self.filename,
                                 remedy="open the scan again, which builds its grid anew")
            got += read
        return found


def column_of(path: Path | str) -> NpyColumn:
    """The column of a file that was there when its grid was opened.  Raises InputError where it is not any more."""
    try:
        return NpyColumn(path)
    except DamagedGrid as error:
        raise InputError(f"has changed since it was opened ({error})", file=path,
                         remedy="open the scan again, which builds its grid anew") from None


def start_of(path: Path | str) -> int:
    """The byte at which the rows of an .npy file begin.  Raises InputError."""
    return column_of(path).offset


def _opened(path: Path | str) -> io.FileIO:
    """Raises DamagedGrid naming the file where there is none."""
    if not os.path.isfile(path):  # opening a pipe would block
        raise DamagedGrid(f"{os.path.basename(path)} is no file")
    try:
        return open(path, "rb", buffering=0)  # its caller closes it
    except OSError as error:
        raise _damage(path, error) from None


def _layout(path: Path | str, file: io.FileIO) -> tuple[tuple[int, ...], np.dtype, int]:
    """Shape, type and first byte of the array in an open .npy file that is complete and in C order.  Raises DamagedGrid."""
    try:
        if found := _PLAIN_NPY.match(file.read(128)):
            shape, dtype, start = *_described(found), len(found[0])
        else:
            shape, dtype, start = _read_header(path, file)
        if start + math.prod(shape) * dtype.itemsize > os.fstat(file.fileno()).st_size:
            raise DamagedGrid(f"{os.path.basename(path)} is truncated")
        return shape, dtype, start
    except _NPY_ERRORS as error:
        raise _damage(path, error) from None


def _read_header(path: Path | str, file: io.FileIO) -> tuple[tuple[int, ...], np.dtype, int]:
    """The same by NumPy."""
    file.seek(0)
    with warnings.catch_warnings(action="error"):  # NumPy warns of headers that Python 2 wrote, and of huge shapes
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(file)
    if fortran and len(shape) > 1:
        raise DamagedGrid(f"{os.path.basename(path)}: its rows lie in another order")
    if not all(type(side) is int and 0 <= side <= _LONGEST for side in shape):  # True is a number, and 0 times 10**30 is little
        raise DamagedGrid(f"{os.path.basename(path)}: a shape of {shape}")
    if dtype.hasobject or not dtype.itemsize or not shape:
        raise DamagedGrid(f"{os.path.basename(path)}: its values are no numbers")
    return shape, dtype, file.tell()


def _damage(path: Path | str, error: Exception) -> DamagedGrid:
    return DamagedGrid(f"{os.path.basename(path)}: {first_line(error)}")
