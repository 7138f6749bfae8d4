"""Columns of values gathered piece by piece from records of several files, whose columns differ.

A column keeps the type of the files while they agree; where some points have no value, it becomes float64 with NaN there.
"""

import numpy as np

from ...readers.source import Records


class GatheredColumns:
    """Columns of ``count`` points, each of which is taken once.  wanted: the name of one; None: all.  note: as in
    viewer.grid.records.file_records.PointValues."""

    def __init__(self, count: int, wanted: str | None = None):
        self._count, self.wanted = count, wanted
        self._values: dict[str, np.ndarray] = {}
        self._without: dict[str, list[np.ndarray]] = {}  # rows that were taken without a value, instead of a mark a point
        self._taken: list[np.ndarray] = []
        self.note: str | None = None

    def take_records(self, rows: np.ndarray, records: Records, at: np.ndarray) -> None:
        """Takes the records ``at`` (m,) for the points ``rows`` (m,)."""
        given = {"xyz": records.xyz, **({} if records.rgb is None else {"rgb": records.rgb}), **records.columns}
        self.take(rows, {name: values[at] for name, values in given.items() if self.wanted in (None, name)})

    def take(self, rows: np.ndarray, given: dict[str, np.ndarray]) -> None:
        """Takes values (m,) or (m, k) by the names of their columns for the points ``rows`` (m,)."""
        for name in self._without.keys() | given.keys() if self.wanted is None else (self.wanted,):
            without = self._without.setdefault(name, list(self._taken))
            if name not in given or not self._put(name, rows, np.asarray(given[name])):
                without.append(rows)
        if self.wanted is None:
            self._taken.append(rows)

    def _put(self, name: str, rows: np.ndarray, values: np.ndarray) -> bool:
        values = values.astype(values.dtype.newbyteorder("="), copy=False)
        held = self._values.get(name)
        if held is None:
            held = self._values[name] = np.zeros((self._count, *values.shape[1:]), values.dtype)
        if held.shape[1:] != values.shape[1:]:  # a field of the same name that holds something else
            return False
        if held.dtype != values.dtype:
            held = self._values[name] = held.astype(np.result_type(held, values))
        held[rows] = values
        return True

    def forget(self, rows: np.ndarray) -> None:
        """Treats the points ``rows`` as not yet taken."""
        for taken in (self._taken, *self._without.values()):
            taken[:] = [some[~np.isin(some, rows)] for some in taken]

    def finished(self) -> dict[str, np.ndarray]:
        """The columns; NaN where a point has no value."""
        found = {}
        for name, values in self._values.items():
            without = np.concatenate([np.zeros(0, np.int64), *self._without[name]])
            if len(without) < self._count:
                if len(without):
                    values = values.astype(np.float64)
                    values[without] = np.nan
                found[name] = values
        return found
