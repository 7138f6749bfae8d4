"""ESRI ASCII grids (.asc): a header and heights, row after row from the north, read as one point at the centre of each cell.

The header: ncols, nrows, xllcorner or xllcenter, yllcorner or yllcenter, cellsize (or dx and dy), nodata_value.  A line break
may stand anywhere between numbers.  Frame and units: those of the file NAME.prj beside it, else unknown.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ...common.text import whole_number
from .. import crs
from ..source import CHUNK, Chunk, ScanInfo, Source
from .text_numbers import number, token_text
from .utf16 import open_text, size_of

_HEADER = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:ncols|nrows|xll(?:corner|center|centre)|yll(?:corner|center|centre)|cellsize)\s",
                     re.IGNORECASE)  # fmt: skip
_OTHER_GRIDS = {b"DSAA": "Surfer ASCII grid", b"DSBB": "Surfer grid", b"north:": "GRASS ASCII grid"}
_WORD = re.compile(r"[A-Za-z_]+")
_MOST_LINES = 12  # of a header; it has five to seven
_NODATA = -9999.0  # where the header does not state it (ESRI's default)
_BLOCK = 1 << 22
"""Bytes of text that are read at a time; their words take 13 times as much while they are parsed.  A grid of a million cells:
half or twice changes the CPU time by no more than its noise."""
_LEAST_BYTES = 2  # of a value and the blank behind it


def is_grid_text(head: bytes) -> bool:
    """Whether a file begins like an ESRI ASCII grid."""
    return _HEADER.match(head) is not None


def other_grid(head: bytes) -> str | None:
    """The name of another kind of grid in text, which a file begins like; None where it is none."""
    return next((name for begin, name in _OTHER_GRIDS.items() if head.lstrip().startswith(begin)), None)


class EsriGridSource(Source):
    """One grid of heights.  Raises InputError where the header is not complete or the file too short for it."""

    def __init__(self, path: Path):
        super().__init__(path, "ESRI grid", scans=[ScanInfo(path.stem)])
        with open_text(path) as file:
            header = self._header(file)
            self._begin, size = file.tell(), size_of(file)
        self._columns, self._rows = (self._whole(header, name) for name in ("ncols", "nrows"))
        width = self._real(header, "cellsize") if "cellsize" in header else self._real(header, "dx")
        height = self._real(header, "cellsize") if "cellsize" in header else self._real(header, "dy")
        if not (width > 0 and height > 0):
            raise InputError(f"its cells have a size of {width:g} x {height:g}", file=path, remedy="export the grid again")
        self._size = np.array([width, height])
        corner = [self._corner(header, axis, size) for axis, size in zip("xy", (width, height), strict=True)]
        self._first = np.array([corner[0], corner[1] + (self._rows - 1) * height])  # the centre of the north-western cell
        self._nodata = self._real(header, "nodata_value") if "nodata_value" in header else _NODATA
        self.count = self._columns * self._rows
        if self.count == 0:
            raise InputError(f"a grid of {self._columns} x {self._rows} cells holds no points", file=path,
                             remedy="export it again")
        if (room := (size - self._begin + 1) // _LEAST_BYTES) < self.count:
            raise self._truncated(room)
        beside = next((file for file in (path.with_suffix(".prj"), path.with_suffix(".PRJ")) if file.is_file()), None)
        if beside is not None:
            text = beside.read_bytes()[:100_000].decode("latin-1")
            self.crs, self.units, self.metres_per_unit = crs.from_text(text)
            self.warnings += crs.height_warning(path.name, self.units, self.metres_per_unit, crs.height_unit(text))

    def _header(self, file: BinaryIO) -> dict[str, str]:
        found: dict[str, str] = {}
        for _ in range(_MOST_LINES):
            place = file.tell()
            words = file.readline(1000).decode("latin-1").removeprefix("\xef\xbb\xbf").split()
            if len(words) == 2 and _WORD.fullmatch(words[0]) and number(words[0]) is None:
                found[words[0].lower().replace("centre", "center")] = words[1].replace(",", ".")
            elif words:
                file.seek(place)
                break
        return found

    def _whole(self, header: dict[str, str], name: str) -> int:
        value = whole_number(header.get(name, ""))
        if value is None:
            raise InputError(f"an ESRI grid whose header has no usable {name}", file=self.path, remedy="export it again")
        return value

    def _real(self, header: dict[str, str], name: str) -> float:
        value = number(header.get(name, ""))
        if value is None or (not np.isfinite(value) and name != "nodata_value"):
            raise InputError(f"an ESRI grid whose header has no usable {name}", file=self.path, remedy="export it again")
        return value

    def _corner(self, header: dict[str, str], axis: str, size: float) -> float:
        """The centre of the first cell along an axis."""
        if f"{axis}llcenter" in header:
            return self._real(header, f"{axis}llcenter")
        return self._real(header, f"{axis}llcorner") + size / 2

    def chunks(self) -> Iterator[Chunk]:
        """Yields the centres of the cells that have a height."""
        done = 0
        for heights in self._heights():
            cells = np.arange(done, done + len(heights))
            done += len(heights)
            known = heights != self._nodata if np.isfinite(self._nodata) else np.isfinite(heights)
            at = np.stack([cells % self._columns, -(cells // self._columns)], axis=1)[known]
            yield Chunk(np.c_[self._first + at * self._size, heights[known]], invalid=int((~known).sum()))
        if done < (self.count or 0):
            raise self._truncated(done)

    def _heights(self) -> Iterator[np.ndarray]:
        """Yields the values in the order of the file, up to CHUNK at a time, not more than there are cells."""
        left, rest = self.count or 0, b""
        with open_text(self.path) as file:
            file.seek(self._begin)
            while left:
                block = file.read(_BLOCK)
                if not block and not rest:
                    return
                text = rest + block
                end = max(text.rfind(mark) for mark in (b" ", b"\n", b"\t", b"\r")) + 1 if block else len(text)
                if len(text) - end > 100:
                    raise InputError(f"byte {file.tell():,}: not a number of a grid", file=self.path, remedy="export it again")
                rest = text[end:]
                tokens = text[:end].split()[:left]
                left -= len(tokens)
                for start in range(0, len(tokens), CHUNK):
                    yield self._parsed(tokens[start : start + CHUNK])

    def _parsed(self, tokens: list[bytes]) -> np.ndarray:
        try:
            return np.array(tokens).astype(np.float64)
        except ValueError:  # decimal commas, other spellings of NaN
            values = [number(token_text(token), "," if b"," in token else ".") for token in tokens]
        if None in values:
            shown = token_text(tokens[values.index(None)])[:20]
            raise InputError(f"holds {shown!a} where heights of its grid are expected", file=self.path,
                             remedy="export it again")
        return np.array(values, np.float64)

    def _truncated(self, done: int) -> InputError:
        what = f"{done:,} of {self.count:,} heights of {self._columns:,} x {self._rows:,} cells could be read"
        return InputError(f"the grid is truncated: {what}", file=self.path, remedy="copy or export it again")
