"""Sets of measured points, by the files that hold them: what is selected, kept as a region, or classified anew; and
levels of the points of a scene, by which a comparison colours them.

A set names records: the k-th point that a file gives when it is read from its beginning (Source.chunks).  It says the same of
the grid, of an export and of a single point, and stays with the points where their scan is moved.  A file is known by its name
and the number of its records: a set does not apply to a file that has another number now.
"""

import base64
import binascii
import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..common.errors import InputError
from .json_values import OwnJson

FileKey = tuple[str, int]
"""Name of a file and the number of its records."""
_LARGEST = 1 << 28
"""Bytes of the lengths of one file's runs: 17 million runs, one for each 3 points of a scan of 100 million."""

LEFT_OUT = 255
"""Level of points that are not drawn."""
MOST_LEVELS = 120
"""Levels there may be: each takes two codes of viewer.grid.records.point_marks, one of them for selected points."""


@dataclass(frozen=True)
class FileRuns:
    """The records of one file that are in a set.  records: of the file.  runs: compressed uint64, little-endian: how many
    records are outside, then inside, then outside, and so on; the rest is outside."""

    name: str
    records: int
    runs: bytes

    @property
    def lengths(self) -> np.ndarray:
        """(k,) int64, k even.  Raises InputError where the runs are damaged."""
        unpacker = zlib.decompressobj()
        try:
            raw = unpacker.decompress(self.runs, _LARGEST)
            complete = unpacker.eof
        except zlib.error:
            raw, complete = b"", False
        if complete and len(raw) % 16 == 0:
            found = np.frombuffer(raw, "<u8")
            whole = not len(found) or (found.max() <= self.records and found.astype(np.float64).sum() <= self.records)
            if whole and (found[1:] > 0).all():
                return found.astype(np.int64)
        raise InputError(f"the set of points of {self.name} is damaged")

    @cached_property
    def count(self) -> int:
        """Records inside."""
        return int(self.lengths[1::2].sum())

    @staticmethod
    def of(key: FileKey, mask: np.ndarray) -> "FileRuns":
        """mask: (records,) bool."""
        edges = np.flatnonzero(mask[1:] != mask[:-1]) + 1
        ends = np.concatenate([[0], *([[0]] if len(mask) and mask[0] else []), edges])
        if len(mask) and mask[-1]:
            ends = np.append(ends, len(mask))
        made = FileRuns(*key, zlib.compress(np.diff(ends).astype("<u8").tobytes(), 1))
        return made

    def fill(self, mask: np.ndarray) -> None:
        """Sets the records inside in ``mask``, (records,) bool of False."""
        lengths = self.lengths
        mask[: int(lengths.sum())] = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)


@dataclass(frozen=True)
class PointSet(OwnJson):
    """files: those with records inside, in the order of the scans."""

    files: tuple[FileRuns, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.files)

    @cached_property
    def count(self) -> int:
        """Points in the set."""
        return sum(each.count for each in self.files)

    def mask(self, files: Iterable[FileKey]) -> np.ndarray:
        """(R,) bool by running number over ``files``; those that the set does not know have none inside."""
        keys = tuple(files)
        found = np.zeros(sum(records for _, records in keys), bool)
        seen: Counter[FileKey] = Counter()
        mine: dict[tuple[FileKey, int], FileRuns] = {}
        for each in self.files:
            key = each.name, each.records
            mine[key, seen[key]] = each
            seen[key] += 1
        seen.clear()
        first = 0
        for key in keys:
            each = mine.get((key, seen[key]))
            seen[key] += 1
            if each is not None:
                each.fill(found[first : first + key[1]])
            first += key[1]
        return found

    def unknown(self, files: Iterable[FileKey]) -> int:
        """Points in the set of which no file of ``files`` is."""
        left = Counter(files)
        lost = 0
        for each in self.files:
            key = each.name, each.records
            lost += 0 if left[key] > 0 else each.count
            left[key] -= 1
        return lost

    @staticmethod
    def of(mask: np.ndarray, files: Iterable[FileKey]) -> "PointSet":
        """mask: (R,) bool by running number over ``files``."""
        found, first = [], 0
        for key in files:
            part = mask[first : first + key[1]]
            first += key[1]
            # a file of which nothing is inside keeps its place where another of its name and size follows
            found.append((FileRuns.of(key, part), bool(part.any())))
        twins = Counter((runs.name, runs.records) for runs, _ in found)
        return PointSet(tuple(runs for runs, some in found if some or (twins[runs.name, runs.records] > 1 and mask.any())))

    def to_json(self) -> Any:
        return [{"file": each.name, "records": each.records, "runs": base64.b64encode(each.runs).decode("ascii")}
                for each in self.files]

    @classmethod
    def from_json(cls, data: Any, where: str) -> Self:
        if not isinstance(data, list):
            raise InputError(f"{where}: expected a list of files")
        found = []
        for number, item in enumerate(data):
            place = f"{where}[{number}]"
            if not isinstance(item, dict) or set(item) != {"file", "records", "runs"}:
                raise InputError(f"{place}: expected file, records and runs")
            name, records, runs = item["file"], item["records"], item["runs"]
            if not isinstance(name, str) or type(records) is not int or not 0 < records < 1 << 40 or not isinstance(runs, str):
                raise InputError(f"{place}: expected a name, a number of records above 0 and a text")
            try:
                made = FileRuns(name, records, base64.b64decode(runs, validate=True))
                _ = made.lengths
            except (binascii.Error, ValueError):
                raise InputError(f"{place}.runs: is not base64") from None
            except InputError as error:
                raise InputError(f"{place}.runs: {error}") from None
            found.append(made)
        return cls(tuple(found))


NO_POINTS = PointSet()


@dataclass(frozen=True, eq=False)
class PointLevels:
    """levels: (N,) uint8 by number in the scene, below MOST_LEVELS, or LEFT_OUT.  colours: (MOST_LEVELS, 3) uint8 of each
    level; None: points keep their own colours.  Equal only to itself."""

    levels: np.ndarray
    colours: np.ndarray | None

    @cached_property
    def uncoloured(self) -> "PointLevels":
        """The same points are left out; the others have their own colours."""
        return self if self.colours is None else PointLevels(self.levels, None)

    @cached_property
    def drops_any(self) -> bool:
        """Whether some point is not drawn."""
        return bool((self.levels == LEFT_OUT).any())
