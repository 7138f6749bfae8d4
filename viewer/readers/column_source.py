"""What readers of columns of numbers share: rows become chunks of points.

Floating-point numbers do not say what they mean: colours may go to 1, 255 or 65535, intensities to anything.  That is decided
by the range over the whole file, for which it is read once more, these columns only.  Unsigned integers of one or two bytes
are taken as they are.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from viewer.errors import InputError
from viewer.readers.source import Chunk, ScanInfo, Source, stretch

Columns = dict[str, np.ndarray]
"""Columns of rows, (n,) each: x y z coordinates, r g b colour, i intensity, c class, s station."""
ALL = "xyzrgbics"


class ColumnSource(Source):
    """A file of columns.  Subclasses give its rows, by ``_rows``, and may change them into points, by ``_placed``."""

    def __init__(self, path: Path, name: str):
        super().__init__(path, name, scans=[ScanInfo(path.stem)])
        self._found: dict[str, tuple[float, float]] | None = None

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        """Yields (scan, those of the wanted columns that it has), up to CHUNK rows at a time."""
        raise NotImplementedError

    def _placed(self, scan: int, columns: Columns) -> tuple[Columns, np.ndarray, int]:
        """The columns without rows that are no points, their coordinates in the file's frame, and how many are left out."""
        with np.errstate(invalid="ignore"):  # some NaN of damaged files
            return columns, np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64, copy=False), 0

    def chunks(self) -> Iterator[Chunk]:
        """Yields xyz and, as far as there are any, rgb (uint8, uint16 beyond 255), intensity, class and station."""
        for scan, columns in self._rows(ALL):
            columns, xyz, invalid = self._placed(scan, columns)
            rgb = intensity = classes = None
            if "r" in columns:
                rgb = np.stack([columns[name] for name in "rgb"], axis=1)
                rgb = rgb if _is_level(rgb) else colour_levels(rgb, self._range("rgb")[1])
            if "i" in columns:
                plain = _is_level(columns["i"])
                intensity = columns["i"].astype(np.uint16) if plain else intensity_levels(columns["i"], *self._range("i"))
            if "c" in columns:
                classes = np.clip(np.nan_to_num(columns["c"]), 0, 255).astype(np.uint8)
            yield Chunk(xyz, rgb, intensity, scan, invalid, columns.get("s"), classes)

    def _range(self, names: str) -> tuple[float, float]:
        """Lowest and highest finite value of some columns over the file."""
        if self._found is None:
            found = dict.fromkeys("rgbi", (np.inf, -np.inf))
            for _, columns in self._rows("rgbi"):
                for name, values in columns.items():
                    finite = values[np.isfinite(values)]
                    if len(finite):
                        low, high = found[name]
                        found[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
            self._found = found
        return min(self._found[name][0] for name in names), max(self._found[name][1] for name in names)

    def _warn(self, text: str) -> None:
        """Takes note of a warning, once, however often the file is read."""
        if text not in self.warnings:
            self.warnings.append(text)

    def _truncated(self, done: int, count: int, what: str = "") -> InputError:
        return InputError(f"{self.path}: truncated: {done:,} of {count:,} points{what} could be read; copy or export it again")


def _is_level(values: np.ndarray) -> bool:
    """Whether numbers are of a type that says what they mean: unsigned, one or two bytes."""
    return values.dtype.kind == "u" and values.dtype.itemsize <= 2


def colour_levels(values: np.ndarray, largest: float) -> np.ndarray:
    """Colours (n, 3) as uint8, or uint16 where the largest of the file is beyond 255.  To 1: shares of full colour."""
    if largest <= 1:
        return (stretch(values, 0, 1) / 257.0 + 0.5).astype(np.uint8)
    kind = np.uint8 if largest <= 255 else np.uint16
    return np.clip(np.rint(np.nan_to_num(values)), 0, np.iinfo(kind).max).astype(kind)


def intensity_levels(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Intensities (n,) as uint16: as they are where the range low..high of the file fits, else stretched.  To 1: shares."""
    if low >= 0 and 1 < high <= 65535:
        return np.clip(np.rint(np.nan_to_num(values)), 0, 65535).astype(np.uint16)
    return stretch(values, 0, 1) if low >= 0 and high <= 1 else stretch(values, low, high)
