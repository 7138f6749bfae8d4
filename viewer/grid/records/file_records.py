"""What the files say of points of a scene: exact positions, and every attribute by its name.

The packed grid is an index for drawing; what is shown of single points, measured and handed out is read back from the files
through the running numbers that the grid keeps (viewer.grid.records.point_records).  Where that is impossible (a file is gone
or has changed, the grid was made by an earlier version) the values are the grid's, and ``PointValues.note`` says so, with their
precision.  Frame: file coordinates.  Memory: the result, blocks of decoded records (viewer.readers.record_blocks), and where
most of a scan is read a small piece of a file, one column of it where one is asked for, and a quarter byte a point.  Safe from
any thread.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...preprocess.scan_description import RecordOrigin
from ...readers.source import AS_STORED, Records, Source
from ..scene import Scene, attributes_of, colours, let_go, packed, positions, scan_numbers
from .gathered_columns import GatheredColumns
from .point_records import IN_MEMORY, identity_of
from .record_lookup import Lookup, SortedNumbers, lookup_of

_FEW = 100_000
"""Points up to which blocks are read one by one; beyond, and where they are more than one in _SHARE of the scan, the files are
read once from their beginnings.  Measured in seconds of a processor, blocks and from the beginning: 100,000 of a million points
0.06 and 0.20 (LAS), 0.04 and 0.10 (PLY), 0.97 and 0.31 (XYZ, which is read again for each _PICKED points); 200,000 points 0.11
and 0.25, 0.08 and 0.12, 1.4 and 0.34.  So text gains from a lower limit, binary formats from a higher one."""
_SHARE = 8
_BATCH = 1 << 20  # points of the grid's own arrays that are worked on at a time
_CHECKED = 64  # records of a chunk, about, whose positions are compared with the grid's
_PICKED = 1 << 15  # records that are read at a time where not all are wanted
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class PointValues:
    """Values of n points.

    xyz: (n, 3) float64 file coordinates.  rgb: (n, 3) uint8 or uint16 as in the file, or None.  station: (n,) int64, number of
    the scan, without a limit.  source: (n,) int64, number of the file, -1 where it is unknown.
    columns: name -> (n,) or (n, k) array in the file's own type and scale, float64 with NaN where some files lack it:
        "intensity", "classification", "gps_time", ... (viewer.readers.source.Records).
    exact: whether all values are those of the files.  note: else one sentence that says why, and how precise they are.
    """

    xyz: np.ndarray
    rgb: np.ndarray | None
    station: np.ndarray
    source: np.ndarray
    columns: dict[str, np.ndarray]
    note: str | None = None

    @property
    def exact(self) -> bool:
        return self.note is None


class FileRecords:
    """Reads values of points of one scene.  Scenes with the same points share the opened files."""

    def __init__(self, scene: Scene):
        self._scene, self._records = scene, scene.records
        self._origin = origin = scene.meta.records or RecordOrigin()
        self._files, self._columns = origin.files or (), origin.columns

    # ---- what is asked for

    def of(self, index: Any) -> PointValues:
        """All values of points of the grid, as far as memory allows: meant for up to some millions of points.

        index: slice, or (n,) whole numbers from 0, in any order.
        """
        found, missing = self._gathered(index, None)
        columns = found.finished()
        xyz, rgb = columns.pop("xyz"), columns.pop("rgb", None)
        return PointValues(xyz, rgb, self.stations(index), self._sources(index, missing), columns, found.note)

    def column(self, index: Any, name: str) -> tuple[np.ndarray | None, str | None]:
        """One column of the points, or None where no file has it, and the note as in PointValues.

        name: "xyz", "rgb" or a name as in ``PointValues.columns``.
        """
        found, _ = self._gathered(index, name)
        return found.finished().get(name), found.note

    def names(self, index: Any) -> list[str]:
        """The names of the columns of points, by the first of them in each file."""
        first = np.zeros(min(_length(index, self._scene.count), 1), np.int64)
        if self._records is not None:
            source = np.concatenate([self._records.places(self._records.numbers(part))[0].astype(np.int32)
                                     for part in _parts(index, self._scene.count)] or [np.zeros(0, np.int32)])  # fmt: skip
            _, first = np.unique(source, return_index=True)
        values = self.of(_places(index, first, self._scene.count))
        return [*([] if values.rgb is None else ["rgb"]), *values.columns]

    def stations(self, index: Any) -> np.ndarray:
        """(n,) int64: number of each point's scan, a place in ``Scene.meta.scans``; without the grid's limit of 255."""
        found = [np.zeros(0, np.int64)]
        for part in _parts(index, self._scene.count):
            true = self._stations_of_records(part)
            if true is None:
                true = scan_numbers(packed(self._scene, part)).astype(np.int64)
            elif self._scene.marked is not None:
                places = _places(part, np.arange(len(true)), self._scene.count)
                true = np.where(self._scene.marked.holds(places), self._scene.marked.station, true)
            found.append(true)
        return np.concatenate(found)

    def is_quick(self, index: int) -> bool:
        """Whether the record of a point can be read without reading the file from its beginning."""
        try:
            number = None if self._records is None else self._records.numbers(np.array([index]))
            source = None if number is None or self._records is None else self._source(int(self._records.places(number)[0][0]))
        except InputError:
            return True  # the grid's values will be taken
        return not isinstance(source, Source) or source.has_quick_records

    # ---- the grid's own values

    def precision(self) -> str:
        """How precise the grid's values are, for a note."""
        layout = self._scene.attributes
        rounded = "" if layout.step == 1 else f", intensities to {layout.step / 2:.3g}"
        return f"coordinates are rounded to {self._scene.step / 2:.2g} units{rounded}"

    def _of_grid(self, index: np.ndarray) -> dict[str, np.ndarray]:
        words = packed(self._scene, index)
        found = {"xyz": positions(self._scene, words, index), "rgb": colours(words)}
        known = attributes_of(self._scene, index)
        intensity, layout = known.intensity, self._scene.attributes
        if intensity is not None and layout.ends not in (None, AS_STORED):
            intensity = np.asarray(layout.in_file(intensity.astype(np.float64)))  # type: ignore[arg-type]
        columns = {"intensity": intensity, "classification": known.classification}
        return found | {name: values for name, values in columns.items() if values is not None}

    # ---- the files'

    def _stations_of_records(self, index: Any) -> np.ndarray | None:
        if self._records is None or self._records.scans is None:
            return None
        try:
            return self._records.scan_of(self._records.numbers(index))
        except InputError as error:
            _log.warning("%s", error)
            return None

    def _sources(self, index: Any, missing: np.ndarray) -> np.ndarray:
        """(n,) int64.  missing: the rows that were not read from their file."""
        count = _length(index, self._scene.count)
        if self._records is None or len(missing) == count:
            return np.full(count, -1, np.int64)
        found = self._records.places(self._records.numbers(index))[0]
        found[missing] = -1
        return found

    def _gathered(self, index: Any, name: str | None) -> tuple[GatheredColumns, np.ndarray]:
        """The wanted column, or all, and the rows (m,) that were not read from their file.  Those are the grid's."""
        count = _length(index, self._scene.count)
        found, why = GatheredColumns(count, name), []
        try:
            if self._records is None:
                raise InputError("this grid was made by an earlier version, without record numbers",
                                 remedy="convert the scan again")
            missing = self._from_files(index, count, found, why)
        except InputError as error:
            why.append(str(error))
            missing = np.arange(count)
        if len(missing):
            found.forget(missing)
            self._fill_from_grid(index, found, missing)
            others = f" (and {len(why) - 1} more)" if len(why) > 1 else ""
            found.note = f"{why[0]}{others}; values of the grid are shown: {self.precision()}"
            _log.warning("%s", found.note)
        return found, missing

    def _fill_from_grid(self, index: Any, found: GatheredColumns, missing: np.ndarray) -> None:
        for start in range(0, len(missing), _BATCH):
            rows = missing[start : start + _BATCH]
            places = _places(index, rows, self._scene.count)
            found.take(rows, self._of_grid(places))

    def _from_files(self, index: Any, count: int, found: GatheredColumns, why: list[str]) -> np.ndarray:
        """Fills ``found`` with records, and returns the rows that could not be read.  why: receives the reasons."""
        assert self._records is not None
        missing = [np.zeros(0, np.int64)]
        if count == 0:
            return missing[0]
        first = self._records.first
        wide = count > max(_FEW, int(first[-1]) // _SHARE)
        lookup = lookup_of(self._records, index, count) if wide else SortedNumbers(self._records.numbers(index))
        for number in range(len(first) - 1):
            start, stop = int(first[number]), int(first[number + 1])
            if start == stop or (not wide and not len(lookup.rows(start, stop)[0])):
                continue
            opened = self._source(number)
            try:
                if isinstance(opened, str):
                    raise InputError(opened)
                for records, at, rows in (_streamed if wide else _picked)(opened, start, stop, lookup, found):
                    few = slice(None, None, max(1, len(rows) // _CHECKED))
                    self._check(opened, records.xyz[at[few]], _places(index, rows[few], self._scene.count))
                    found.take_records(rows, records, at)
            except (InputError, OSError) as error:
                why.append(str(error))
                missing.append(lookup.rows(start, stop)[1])
        return np.concatenate(missing)

    def _check(self, source: Source, xyz: np.ndarray, places: np.ndarray) -> None:
        """Raises InputError where records do not lie where the grid has their points."""
        expected = positions(self._scene, packed(self._scene, places), places)
        let_go(self._scene.points)
        with np.errstate(invalid="ignore"):
            near = np.abs(xyz - expected) <= self._scene.step + 1e-12 * np.abs(expected)
        if not near.all():
            raise InputError("its points are not those that the grid was built from", file=source.path,
                             remedy="open the scan again")

    def _source(self, number: int) -> "Source | str":
        """The opened file, or why it cannot be read."""
        assert self._records is not None
        with self._records.lock:
            if number < len(self._files) and self._files[number] != IN_MEMORY:
                file, *state = self._files[number]
                try:
                    if list(identity_of(Path(file))[1:]) != state:
                        return f"{file}: has changed since the grid was built; open the scan again"
                except OSError as error:
                    return f"{file}: cannot be read ({error.strerror or error})"
            if number not in self._records.opened:
                self._records.opened[number] = self._made(number)
            return self._records.opened[number]

    def _made(self, number: int) -> "Source | str":
        if number < len(self._scene.live):
            return self._scene.live[number]
        if number >= len(self._files):
            return "the points were not read from files"
        from ...readers.formats import open_source
        from ...readers.moved_source import MovedSource

        try:
            source, transform = open_source(Path(self._files[number][0]), self._columns), self._origin.move_of(number)
            return source if transform is None else MovedSource(source, transform)
        except InputError as error:
            return str(error)


_Pieces = Iterator[tuple[Records, np.ndarray, np.ndarray]]
"""Records, which of them are wanted (m,), and the row of the result of each (m,)."""


def _streamed(source: Source, start: int, stop: int, lookup: Lookup, found: GatheredColumns) -> _Pieces:
    """Reads a source from its beginning.  start, stop: its running numbers over all sources."""
    at = start
    for records in source.record_chunks() if found.wanted is None else source.column_chunks(found.wanted):
        for begin in range(0, len(records.xyz), _PICKED):  # small pieces, so that copies of them are small
            end = min(begin + _PICKED, len(records.xyz))
            taken, rows = lookup.rows(at + begin, at + end)
            if len(rows):
                yield records, taken + begin, rows
        at += len(records.xyz)
    if at != stop:
        raise InputError(f"has {at - start:,} points, {stop - start:,} when its grid was built", file=source.path,
                         remedy="open it again")


def _picked(source: Source, start: int, stop: int, lookup: Lookup, _: GatheredColumns) -> _Pieces:
    """Reads single records of a source."""
    at, rows = lookup.rows(start, stop)
    for first in range(0, len(at), _PICKED):
        numbers, which = np.unique(at[first : first + _PICKED], return_inverse=True)
        yield source.records(numbers), which, rows[first : first + _PICKED]


def _length(index: Any, count: int) -> int:
    return len(range(*index.indices(count))) if isinstance(index, slice) else len(index)


def _places(index: Any, rows: np.ndarray, count: int) -> np.ndarray:
    """(m,) the points of the grid that the rows (m,) of ``index`` stand for."""
    if not isinstance(index, slice):
        return np.asarray(index)[rows]
    chosen = range(*index.indices(count))
    return chosen.start + chosen.step * np.asarray(rows, np.int64)


def _parts(index: Any, count: int) -> Iterator[Any]:
    """``index`` in pieces of _BATCH points."""
    if not isinstance(index, slice):
        yield from (index[start : start + _BATCH] for start in range(0, len(index), _BATCH))
        return
    chosen = range(*index.indices(count))
    for start in range(0, len(chosen), _BATCH):
        part = chosen[start : start + _BATCH]
        yield slice(part.start, None if part.stop < 0 else part.stop, part.step)
