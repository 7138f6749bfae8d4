"""Columns of values gathered piece by piece from records of several files, whose columns differ.

A column keeps the type of the files while they agree; where some points have no value, it becomes float64 with NaN there.
"""

import numpy as np

from ...readers.source import Records


class GatheredColumns:
    """Columns of ``count`` points.  wanted: their names; None: all.  note: as in
    viewer.grid.records.file_records.PointValues."""

    def __init__(self, count: int, wanted: set[str] | None = None):
        self._count, self._wanted = count, wanted
        self._values: dict[str, np.ndarray] = {}
        self._known: dict[str, np.ndarray] = {}
        self.note: str | None = None

    def wants_only(self, name: str) -> bool:
        return self._wanted == {name}

    def put_records(self, rows: np.ndarray, records: Records, at: np.ndarray) -> None:
        """Takes the records ``at`` (m,) for the points ``rows`` (m,)."""
        given = {"xyz": records.xyz, **({} if records.rgb is None else {"rgb": records.rgb}), **records.columns}
        for name, values in given.items():
            if self._wanted is None or name in self._wanted:
                self.put(name, rows, values[at])

    def put(self, name: str, rows: np.ndarray, values: np.ndarray) -> None:
        """Takes values (m,) or (m, k) of a column for the points ``rows`` (m,)."""
        if self._wanted is not None and name not in self._wanted:
            return
        values = np.asarray(values)
        values = values.astype(values.dtype.newbyteorder("="), copy=False)
        held = self._values.get(name)
        if held is None:
            held = self._values[name] = np.zeros((self._count, *values.shape[1:]), values.dtype)
            self._known[name] = np.zeros(self._count, bool)
        if held.shape[1:] != values.shape[1:]:  # a field of the same name that holds something else
            return
        if held.dtype != values.dtype:
            held = self._values[name] = held.astype(np.result_type(held, values))
        held[rows] = values
        self._known[name][rows] = True

    def forget(self, rows: np.ndarray) -> None:
        """Treats the points ``rows`` as not yet read."""
        for known in self._known.values():
            known[rows] = False

    def finished(self) -> dict[str, np.ndarray]:
        """The columns; NaN where a point has no value."""
        found = {}
        for name, values in self._values.items():
            known = self._known[name]
            if not known.any():
                continue
            if not known.all():
                values = values.astype(np.float64)
                values[~known] = np.nan
            found[name] = values
        return found
