"""What readers of columns of numbers share: rows become chunks of points.

Floating-point columns do not state their range: colours may end at 1, 255 or 65535, intensities anywhere.  The range of the
values in the whole file decides; the file is read once more for it, those columns only.  A sample takes the range of its own
first runs instead.  Unsigned integers of one or two bytes are taken as they are.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from ..common.errors import InputError
from .class_codes import OddClasses, class_codes
from .odd_colours import colours_counted
from .source import AS_STORED, Chunk, Records, ScanInfo, Source, stretch

Columns = dict[str, np.ndarray]
"""Columns of rows, (n,) each: x y z coordinates, r g b colour, i intensity, c class, s station."""
Ranges = dict[str, tuple[float, float]]
"""Lowest and highest finite value of columns."""
ALL = "xyzrgbics"
_NAMES = {"i": "intensity", "c": "classification", "s": "point_source_id"}
"""Names in ``Records`` of columns that have one letter here."""
RANGE_RUNS = 64
"""Runs of a sample whose values give the range of its colours and intensities.  Of further
values a share of 2 / (n + 1) lies outside the range of n independent ones: 3 % if each run has one value throughout."""


class ColumnSource(Source):
    """A file of columns.

    Subclasses implement ``_rows`` and, where the format can seek, ``_sample_rows``; also ``_placed`` where rows are not yet
    points in the file's frame.
    """

    def __init__(self, path: Path, name: str):
        super().__init__(path, name, scans=[ScanInfo(path.stem)])
        self._ranges: Ranges | None = None

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        """Yields (scan, the wanted columns that the file has), up to CHUNK rows at a time."""
        raise NotImplementedError

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]] | None:
        """Yields rows as ``_rows`` does, but only the runs of a sample (``Source.sample``); None where that is impossible."""
        return None

    def _placed(self, scan: int, columns: Columns) -> tuple[Columns, np.ndarray, int]:
        """Turns rows into points: the columns of the valid rows, their coordinates (n, 3) float64 in the file's frame, and the
        number of rows left out."""
        with np.errstate(invalid="ignore"):  # damaged files contain signalling NaN
            return columns, np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64, copy=False), 0

    def chunks(self) -> Iterator[Chunk]:
        """Yields xyz and, where the file has them, rgb (uint8, or uint16 beyond 255), intensity, class and station."""
        odd = OddClasses()
        for scan, columns in colours_counted(self._rows(ALL), "rgb", self.path, self.warnings):
            odd.add(columns.get("c"))
            yield self._chunk(scan, columns, self._file_ranges)
        if text := odd.warning(self.path):
            self._warn(text)

    def take_ranges(self, other: "ColumnSource") -> None:
        """Ranges of colours and intensities that the types of columns do not tell are those of ``other``, another part of the
        same scan: the same value has the same colour in both."""
        self._file_ranges = other._file_ranges

    def record_chunks(self) -> Iterator[Records]:
        """See Source.  Intensities, classes and ids as the file has them."""
        for scan, columns in colours_counted(self._record_rows(), "rgb", self.path, self.record_losses):
            yield self._record(scan, columns)

    def _record(self, scan: int, columns: Columns) -> Records:
        """Whole records of rows."""
        chunk = self._chunk(scan, columns, self._file_ranges)
        kept, _, _ = self._placed(scan, columns)
        named = {_NAMES.get(name, name): values for name, values in kept.items() if name not in set("xyzrgb")}
        return Records(chunk.xyz, chunk.rgb, chunk.scan, named)

    def _record_rows(self) -> Iterator[tuple[int, Columns]]:
        """Yields rows as ``_rows`` does, with all columns of the file; further ones by names of more than one letter."""
        return self._rows(ALL)

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """See Source.  Ranges of floating-point colours and intensities are those of the first RANGE_RUNS runs."""
        rows = self._sample_rows(ALL, points, run)
        return None if rows is None else self._sampled(rows, points, run)

    def _sampled(self, rows: Iterator[tuple[int, Columns]], points: int, run: int) -> Iterator[Chunk]:
        ranges: Ranges = self._ranges or {}

        def sample_ranges() -> Ranges:
            if not ranges:
                ranges.update(ranges_of(islice(self._sample_rows("rgbi", points, run) or (), RANGE_RUNS)))
            return ranges

        for scan, columns in rows:
            yield self._chunk(scan, columns, sample_ranges)

    def _chunk(self, scan: int, columns: Columns, ranges: Callable[[], Ranges]) -> Chunk:
        """ranges: called only where the types of the columns do not tell their range."""
        columns, xyz, invalid = self._placed(scan, columns)
        rgb = intensity = classes = None
        if columns.keys() >= set("rgb"):
            rgb = np.stack([columns[name] for name in "rgb"], axis=1)
            rgb = rgb if _is_level(rgb) else colour_levels(rgb, max(ranges()[name][1] for name in "rgb"))
        if "i" in columns:
            plain = _is_level(columns["i"])
            intensity = columns["i"].astype(np.uint16) if plain else intensity_levels(columns["i"], *ranges()["i"])
        if "c" in columns:
            classes = class_codes(columns["c"])
        return Chunk(xyz, rgb, intensity, scan, invalid, columns.get("s"), classes)

    @property
    def intensity_ends(self) -> tuple[float, float]:
        return AS_STORED if self._ranges is None else level_ends(*self._ranges["i"])

    def _file_ranges(self) -> Ranges:
        """The ranges over the whole file, read at first need."""
        if self._ranges is None:
            self._ranges = ranges_of(self._rows("rgbi"))
        return self._ranges

    def _warn(self, text: str) -> None:
        """Adds a warning once, however often the file is read."""
        if text not in self.warnings:
            self.warnings.append(text)

    def _truncated(self, done: int, count: int, what: str = "") -> InputError:
        return InputError(f"truncated: {done:,} of {count:,} points{what} could be read", file=self.path,
                          remedy="copy or export it again")


def ranges_of(rows: Iterator[tuple[int, Columns]]) -> Ranges:
    found: Ranges = dict.fromkeys("rgbi", (np.inf, -np.inf))
    for _, columns in rows:
        for name, values in columns.items():
            finite = values[np.isfinite(values)]
            if len(finite):
                low, high = found[name]
                found[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
    return found


def _is_level(values: np.ndarray) -> bool:
    """Whether the type of the numbers states their range: unsigned, one or two bytes."""
    return values.dtype.kind == "u" and values.dtype.itemsize <= 2


def colour_levels(values: np.ndarray, largest: float) -> np.ndarray:
    """Colours (n, 3) as uint8, or as uint16 where ``largest``, that of the whole file, exceeds 255.  Up to 1: shares of full
    colour."""
    if largest <= 1:
        return (stretch(values, 0, 1) / 257.0 + 0.5).astype(np.uint8)
    kind = np.uint8 if largest <= 255 else np.uint16
    return np.clip(np.rint(np.nan_to_num(values)), 0, np.iinfo(kind).max).astype(kind)


def intensity_levels(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Intensities (n,) as uint16: unchanged where the range low..high of the file fits, else stretched.  Up to 1: shares."""
    ends = level_ends(low, high)
    if ends == AS_STORED:
        return np.clip(np.rint(np.nan_to_num(values)), 0, 65535).astype(np.uint16)
    return stretch(values, *ends)


def level_ends(low: float, high: float) -> tuple[float, float]:
    """The intensities that become 0 and 65535, for a file whose intensities go from low to high."""
    if not low <= high or (low >= 0 and 1 < high <= 65535):
        return AS_STORED
    return (0.0, 1.0) if low >= 0 and high <= 1 else (low, high)
