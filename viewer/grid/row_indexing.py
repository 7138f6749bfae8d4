"""Indexing of a column with a row for each point that is not an array in memory: its rows are read where they are indexed."""

from typing import Any

import numpy as np


class IndexedRows:
    """What may be done with an array of the column: index its rows, by a slice, whole numbers or a mask of bool.

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
