"""PLY, ascii and binary in both byte orders, a block at a time; other elements and properties of the file are skipped.

Rows without lists are read as NumPy records; rows with lists are parsed one by one.  (plyfile would hold the whole file in
memory.)
Frame: the file's.  Units: unknown, since PLY does not state them, except by a comment that begins with ``wkt``, as our exports
have it.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from .. import crs
from ..class_codes import OddClasses, class_codes
from ..column_source import RANGE_RUNS, Columns, Ranges
from ..odd_colours import FULL, clipped, colours_counted
from ..record_blocks import RecordBlocks, even_blocks
from ..sampling import run_starts
from ..source import AS_STORED, CHUNK, Chunk, Records, ScanInfo, Source, stretch, surplus_warning
from ..text.text_numbers import number
from ..text.text_rows import TextRows
from ..text.text_sample import TextRegion, sample_rows
from .ply_header import Element, read_header
from .ply_text import lines_of, parsed, without_lists

_COLOURS = (
    ("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("scalar_red", "scalar_green", "scalar_blue"),
)  # fmt: skip
_INTENSITIES = ("intensity", "scalar_intensity", "reflectance", "scalar_reflectance")
_CLASSES = ("classification", "scalar_classification", "class", "scalar_class")


class PlySource(Source):
    """One .ply file.  Raises InputError where the header is not valid or has no x, y, z."""

    def __init__(self, path: Path):
        super().__init__(path, "PLY", scans=[ScanInfo(path.stem)])
        with path.open("rb") as file:
            self._header = read_header(path, file)
        names = [element.name for element in self._header.elements]
        if "vertex" not in names:
            raise InputError(f"PLY without vertices (elements: {', '.join(names) or 'none'}); nothing to show", file=path)
        after = self._header.elements[names.index("vertex") + 1 :]
        self._last = not any(element.count for element in after)
        self._before = self._header.elements[: names.index("vertex")]
        self._vertex = self._header.elements[names.index("vertex")]
        plain = {p.name.lower(): p for p in self._vertex.properties if not p.length_type}
        self.count = self._vertex.count
        if missing := [axis for axis in "xyz" if axis not in plain]:
            raise InputError(f"PLY vertices without {', '.join(missing)}", file=path, remedy="export it with coordinates")
        if self.count == 0:
            raise InputError("holds no points (its header says 0)", file=path, remedy="export it again")
        if wkt := next((text[4:] for text in self._header.comments if text.startswith("wkt ")), ""):
            self.crs, self.units, self.metres_per_unit = crs.from_wkt(wkt)
            self.crs_text = wkt
        self._rgb = next((names for names in _COLOURS if all(name in plain for name in names)), None)
        self._intensity = next((name for name in _INTENSITIES if name in plain), None)
        self._class = next((name for name in _CLASSES if name in plain), None)
        self.types = {name: p.type for name, p in plain.items()}
        """Types of the vertices' properties without lists, NumPy's without byte order, by lower-case name."""
        if self._header.order and all(self.types[axis] == "f4" for axis in "xyz"):
            self.precision = 2.0**-24
        self._ranges: Ranges | None = None
        self._blocks: RecordBlocks | None = None

    def chunks(self) -> Iterator[Chunk]:
        """Yields xyz, rgb (uint8, or uint16 where the fields are wider), intensity and class."""
        odd = OddClasses()
        for columns in self._counted(self.warnings):
            odd.add(columns.get(self._class or ""))
            yield self._chunk(columns, self._file_ranges)
        if (text := odd.warning(self.path)) and text not in self.warnings:
            self.warnings.append(text)

    def record_chunks(self) -> Iterator[Records]:
        """See Source.  columns: every property besides coordinates and colour; numbers of text as float64."""
        for found in self._counted(self.record_losses):
            yield self._record(found)

    def _counted(self, told: list[str]) -> Iterator[Columns]:
        most = 255 if all(self.types[name] == "u1" for name in self._rgb or ()) else FULL
        rows = colours_counted(((0, found) for found in self._columns()), self._rgb or (), self.path, told, most)
        return (found for _, found in rows)

    def _record(self, found: Columns) -> Records:
        placed = {*"xyz", *(self._rgb or ())}
        names = {self._intensity: "intensity", self._class: "classification"}
        columns = {names.get(name, name): values for name, values in found.items() if name not in placed}
        return Records(*self._placed(found, self._file_ranges), 0, columns)

    @property
    def has_quick_records(self) -> bool:
        measured = self._ranges is not None or all(self.types[name][0] != "f" for name in self._rgb or ())
        return measured and self._seekable

    @property
    def _seekable(self) -> bool:
        return bool(self._header.order) and not any(element.has_lists for element in (self._vertex, *self._before))

    def records(self, numbers: np.ndarray) -> Records:
        """See Source: binary vertices without lists by their place."""
        if not self._seekable:
            return super().records(numbers)
        if self._blocks is None:
            starts = even_blocks(self._vertex.count)
            self._blocks = RecordBlocks(starts, lambda block: self._block(int(starts[block]), int(starts[block + 1])))
        return self._blocks.take(numbers)

    def _block(self, start: int, stop: int) -> Records:
        dtype = self._dtype(self._vertex)
        begin = self._header.data + sum(element.count * self._dtype(element).itemsize for element in self._before)
        with self.path.open("rb") as file:
            file.seek(begin + start * dtype.itemsize)
            data = file.read((stop - start) * dtype.itemsize)
        if len(data) < (stop - start) * dtype.itemsize:
            raise self._truncated(start + len(data) // dtype.itemsize)
        rows = np.frombuffer(data, dtype)
        return self._record({p.name.lower(): rows[f"{i}"] for i, p in enumerate(self._vertex.properties)})

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """See Source; None where lists, whose length varies, are in or before the vertices.  Ranges of floating-point colours
        and intensities are those of the first RANGE_RUNS runs."""
        if self._vertex.has_lists or any(element.has_lists for element in self._before):
            return None
        return self._sampled(points, run)

    def _sampled(self, points: int, run: int) -> Iterator[Chunk]:
        sampled = self._sampled_binary if self._header.order else self._sampled_text
        ranges: Ranges = dict(self._ranges or {})

        def sample_ranges() -> Ranges:
            if not ranges:
                ranges.update(self._ranges_of(islice(sampled(points, run), RANGE_RUNS)))
            return ranges

        for columns in sampled(points, run):
            yield self._chunk(columns, sample_ranges)

    def _chunk(self, columns: Columns, ranges: Callable[[], Ranges]) -> Chunk:
        xyz, rgb = self._placed(columns, ranges)
        level = None if self._intensity is None else self._level(columns[self._intensity], ranges)
        classes = None if self._class is None else class_codes(columns[self._class])
        return Chunk(xyz, rgb, level, classification=classes)

    def _placed(self, columns: Columns, ranges: Callable[[], Ranges]) -> tuple[np.ndarray, np.ndarray | None]:
        """Coordinates and colours."""
        with np.errstate(invalid="ignore"):  # damaged files contain signalling NaN
            xyz = np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64)
        return xyz, None if self._rgb is None else np.stack([self._channel(columns, n, ranges) for n in self._rgb], axis=1)

    def _channel(self, columns: Columns, name: str, ranges: Callable[[], Ranges]) -> np.ndarray:
        kind, values = self.types[name], columns[name]
        if kind[0] != "f":
            return clipped(values, np.uint8 if kind == "u1" else np.uint16)
        largest = max(ranges()[n][1] for n in self._rgb or ())
        full = 1.0 if largest <= 1 else 255.0 if largest <= 255 else 65535.0
        return (stretch(values, 0, full) / 257.0 + 0.5).astype(np.uint8)

    def _level(self, values: np.ndarray, ranges: Callable[[], Ranges]) -> np.ndarray:
        kind = self.types[self._intensity or ""]
        if kind in ("u1", "u2"):
            return clipped(values, np.uint16)
        return stretch(values, *ranges()[self._intensity or ""])

    @property
    def intensity_ends(self) -> tuple[float, float]:
        low, high = (self._ranges or {}).get(self._intensity or "", AS_STORED)
        return (low, high) if low <= high else AS_STORED

    def _file_ranges(self) -> Ranges:
        """Ranges of colour and intensity over the whole file, read at first need."""
        if self._ranges is None:
            self._ranges = self._ranges_of(self._columns())
        return self._ranges

    def _ranges_of(self, blocks: Iterable[Columns]) -> Ranges:
        names = [*(self._rgb or ()), *((self._intensity,) if self._intensity else ())]
        found: Ranges = dict.fromkeys(names, (np.inf, -np.inf))
        for columns in blocks:
            for name, (low, high) in found.items():
                finite = columns[name][np.isfinite(columns[name])]
                if len(finite):
                    found[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
        return found

    def _columns(self) -> Iterator[Columns]:
        """Yields the vertices' plain properties by lower-case name, up to CHUNK rows at a time."""
        with self.path.open("rb") as file:
            file.seek(self._header.data)
            yield from self._text(file) if not self._header.order else self._binary(file)

    # ---- binary

    def _dtype(self, element: Element) -> np.dtype:
        plain = [p for p in element.properties if not p.length_type]
        return np.dtype([(f"{i}", self._header.order + p.type) for i, p in enumerate(plain)])

    def _binary(self, file: BinaryIO) -> Iterator[Columns]:
        size = self.path.stat().st_size
        for element in self._before:
            if element.has_lists:
                for row in range(element.count):
                    if self._walk(file, element, size) is None:
                        raise self._truncated(0, f"in element {element.name}, row {row:,}")
            else:
                file.seek(min(file.tell() + element.count * self._dtype(element).itemsize, size))
        dtype = self._dtype(self._vertex)
        names = [p.name.lower() for p in self._vertex.properties if not p.length_type]
        if not self._vertex.has_lists and (size - file.tell()) // dtype.itemsize < self._vertex.count:
            raise self._truncated(max(0, (size - file.tell()) // dtype.itemsize))
        done = 0
        while done < self._vertex.count:
            n = min(CHUNK, self._vertex.count - done)
            if self._vertex.has_lists:
                rows = []
                while len(rows) < n and (row := self._walk(file, self._vertex, size)) is not None:
                    rows.append(row)
                data = b"".join(rows)
            else:
                data = file.read(n * dtype.itemsize)
            records = np.frombuffer(data, dtype, count=len(data) // dtype.itemsize)
            done += len(records)
            if len(records) < n:
                raise self._truncated(done)
            yield {name: records[f"{i}"] for i, name in enumerate(names)}
        self._end(size - file.tell() >= dtype.itemsize)

    def _sampled_binary(self, points: int, run: int) -> Iterator[Columns]:
        dtype, count = self._dtype(self._vertex), self._vertex.count
        begin = self._header.data + sum(element.count * self._dtype(element).itemsize for element in self._before)
        if (readable := max(0, self.path.stat().st_size - begin) // dtype.itemsize) < count:
            raise self._truncated(readable)
        names = [p.name.lower() for p in self._vertex.properties]
        with self.path.open("rb") as file:
            for start in run_starts(count, points, run).tolist():
                file.seek(begin + start * dtype.itemsize)
                records = np.frombuffer(file.read(min(run, count - start) * dtype.itemsize), dtype)
                yield {name: records[f"{i}"] for i, name in enumerate(names)}

    def _end(self, more: bool) -> None:
        """Adds a warning, once, about points after those that the header counts.  more: bytes are left that may be a point."""
        if more and self._last and (text := surplus_warning(self.path, self.count)) not in self.warnings:
            self.warnings.append(text)

    def _walk(self, file: BinaryIO, element: Element, size: int) -> bytes | None:
        """The bytes of one row without its lists; None at the end of the file, which has ``size`` bytes."""
        kept = []
        for p in element.properties:
            data = file.read(int((p.length_type or p.type)[1]))
            if len(data) < int((p.length_type or p.type)[1]):
                return None
            if p.length_type:
                length = int(np.frombuffer(data, self._header.order + p.length_type)[0])
                if not 0 <= length <= size:
                    return None
                file.seek(length * int(p.type[1]), 1)
            else:
                kept.append(data)
        return b"".join(kept)

    # ---- text

    def _text(self, file: BinaryIO) -> Iterator[Columns]:
        skip = sum(element.count for element in self._before)
        names = [p.name.lower() for p in self._vertex.properties if not p.length_type]
        done = 0
        blocks = lines_of(self.path, file)
        for lines in blocks:
            skipped = min(skip, len(lines))
            skip -= skipped
            beyond = len(lines) > skipped + self._vertex.count - done
            lines = lines[skipped : skipped + self._vertex.count - done]
            for start in range(0, len(lines), CHUNK):
                rows = lines[start : start + CHUNK]
                if self._vertex.has_lists:
                    rows = [without_lists(row, self._vertex.properties) for row in rows]
                if (table := parsed(rows, len(names))) is None:
                    raise self._unreadable(rows, len(names), done)
                done += len(table)
                yield {name: table[:, i] for i, name in enumerate(names)}
            if done >= self._vertex.count:
                self._end(beyond or any(blocks))
                return
        raise self._truncated(done)

    def _sampled_text(self, points: int, run: int) -> Iterator[Columns]:
        with self.path.open("rb") as file:
            file.seek(self._header.data)
            text = TextRows(self.path, file)
            text.skip(sum(element.count for element in self._before))
            begin, end = text.position, self.path.stat().st_size
            if not self._last:  # rows of other elements follow
                if (found := text.skip(self._vertex.count)) < self._vertex.count:
                    raise self._truncated(found)
                end = text.position
        names = [p.name.lower() for p in self._vertex.properties]
        for _, table in sample_rows(self.path, [TextRegion(begin, end, list(range(len(names))))], points, run):
            yield {name: table[:, i] for i, name in enumerate(names)}

    def _unreadable(self, rows: list[str], columns: int, done: int) -> InputError:
        """The error about the row that is not numbers, or about the last row of a truncated file."""
        for place, row in enumerate(rows, done + 1):
            words = row.split()[:columns]
            if len(words) == columns and all(number(word) is not None for word in words):
                continue
            if len(words) < columns and place == done + len(rows) <= (self.count or 0):
                return self._truncated(place - 1)
            shown = "".join(c if c.isascii() and c.isprintable() else "?" for c in row[:40])
            return InputError(f"vertex {place:,} is not {columns} numbers: {shown!r}", file=self.path, remedy="export it again")
        return InputError("its vertices cannot be read as numbers", file=self.path, remedy="export it again")

    def _truncated(self, done: int, where: str = "") -> InputError:
        place = f" ({where})" if where else ""
        return InputError(f"truncated: {done:,} of {self.count:,} points could be read{place}", file=self.path,
                          remedy="copy or export it again")
