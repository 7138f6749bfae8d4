"""PCD (Point Cloud Library), versions 0.5 to 0.7: ascii, binary and binary_compressed.

All forms are decoded here: Open3D 0.20 ends the process at compressed files with padding fields, returns uninitialised memory
for truncated ascii files and the beginning of damaged numbers, and holds all points at once.  Frame and units: as stored; a
VIEWPOINT gives a warning and is not applied.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.text import counted
from ..column_source import ALL, Columns, ColumnSource
from ..own_folder import MOST_UNPACKED
from ..record_blocks import RecordBlocks, even_blocks
from ..sampling import run_starts
from ..source import CHUNK, Records, surplus_warning
from ..text.text_rows import ROWS, TextRows
from ..text.text_sample import TextRegion, sample_rows
from .lzf import MOST, DamagedLzf, LzfReader
from .pcd_header import Header, read_header

_RGB = (("r", "g", "b"), ("red", "green", "blue"))
_PACKED = ("rgb", "rgba")  # of four bytes: blue, green, red, and alpha or nothing
_INTENSITIES = ("intensity", "intensities", "i", "reflectance", "reflectivity", "remission")
_CLASSES = ("classification", "class", "label")
_BLOCK = 64 << 20
"""Bytes of a binary file that are read at once; a point may have thousands of values."""
_MOST_NAMED = 5  # fields that a warning names


class PcdSource(ColumnSource):
    """One .pcd file.  Raises InputError where the header is not valid, or the file is shorter than it states."""

    def __init__(self, path: Path):
        super().__init__(path, "PCD")
        with path.open("rb") as file:
            self._header = header = read_header(path, file)
        self.count = header.points
        self._points: RecordBlocks | None = None
        self._columns: dict[str, LzfReader] = {}  # of the compressed form: where each begins
        names = {field.name: field for field in header.fields}
        if missing := [axis for axis in "xyz" if axis not in names or names[axis].count != 1]:
            raise InputError(f"PCD without {', '.join(missing)} (its fields: {', '.join(names)}); nothing to show", file=path)
        if self.count == 0:
            raise InputError("holds no points (its header says 0)", file=path, remedy="export it again")
        self._fields: dict[str, str] = {axis: axis for axis in "xyz"}
        self._rgb = next((name for name in _PACKED
                          if name in names and names[name].type[1:] == "4" and names[name].count == 1), None)
        if self._rgb is None:
            rgb = next((rgb for rgb in _RGB if all(name in names and names[name].count == 1 for name in rgb)), ())
            self._fields |= dict(zip("rgb", rgb))
        for column, known in (("i", _INTENSITIES), ("c", _CLASSES)):
            if found := next((name for name in known if name in names and names[name].count == 1), None):
                self._fields[column] = found
        if header.data != "ascii" and all(names[axis].type == "f4" for axis in "xyz"):
            self.precision = 2.0**-24
        several = [field for field in header.fields if field.count > 1 and field.name != "_"]
        if several:
            named = ", ".join(f"{field.name} ({field.count} values)" for field in several[:_MOST_NAMED])
            more = f" and {len(several) - _MOST_NAMED} more" if len(several) > _MOST_NAMED else ""
            text = f"{path.name}: {counted(len(several), 'field')} of several values a point, {named}{more}, "
            self._warn(text + f"{'is' if len(several) == 1 else 'are'} left out")
            self.record_losses.append(self.warnings[-1])
        if header.viewpoint not in (None, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)):
            self._warn(f"{path.name}: its VIEWPOINT is not applied, coordinates are shown as they are stored")
        size = path.stat().st_size - header.offset
        if header.data == "binary" and size < self.count * header.dtype.itemsize:
            raise self._truncated(size // header.dtype.itemsize, self.count)
        if header.data == "binary" and size >= (self.count + 1) * header.dtype.itemsize:
            self._warn(surplus_warning(path, self.count))
        if header.data == "binary_compressed":
            self._check_compressed(header, size)

    def _check_compressed(self, header: Header, size: int) -> None:
        """Checks the two sizes before the compressed bytes against the file and the points."""
        with self.path.open("rb") as file:
            file.seek(header.offset)
            head = np.frombuffer(file.read(8).ljust(8, b"\0"), "<u4")
        packed, whole = int(head[0]), int(head[1])
        if whole != header.points * header.dtype.itemsize or size < 8:
            what = f"{header.points:,} points of {header.dtype.itemsize} bytes do not fill the {whole:,} bytes that follow"
            raise InputError(f"damaged: {what}", file=self.path, remedy="copy or export it again")
        if packed > size - 8:
            what = f"{max(size - 8, 0):,} of {packed:,} bytes of its compressed points are there"
            raise InputError(f"truncated: {what}", file=self.path, remedy="copy or export it again")
        if whole > packed * MOST:
            what = f"{packed:,} compressed bytes cannot hold {whole:,}"
            raise InputError(f"damaged: {what}", file=self.path, remedy="copy or export it again")

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        yield from self._named(wanted, self._blocks())

    def _blocks(self) -> Callable[[list[str]], Iterator[Columns]]:
        form = self._header.data
        return self._ascii if form == "ascii" else self._binary if form == "binary" else self._compressed

    def _record_rows(self) -> Iterator[tuple[int, Columns]]:
        yield from self._named(ALL, self._blocks(), self._further())

    def _further(self) -> list[str]:
        """Fields besides coordinates, colour, intensity and class."""
        used = {*self._fields.values(), self._rgb, "_"}
        return [field.name for field in self._header.fields if field.count == 1 and field.name not in used]

    @property
    def has_quick_records(self) -> bool:
        return self._header.data == "binary" and self._ranges is not None

    def records(self, numbers: np.ndarray) -> Records:
        """See Source: binary points by their place."""
        if self._header.data != "binary":
            return super().records(numbers)
        if self._points is None:
            starts = even_blocks(self._header.points)
            self._points = RecordBlocks(starts, lambda block: self._block(int(starts[block]), int(starts[block + 1])))
        return self._points.take(numbers)

    def _block(self, start: int, stop: int) -> Records:
        dtype = self._header.dtype
        with self.path.open("rb") as file:
            file.seek(self._header.offset + start * dtype.itemsize)
            data = file.read((stop - start) * dtype.itemsize)
        if len(data) < (stop - start) * dtype.itemsize:
            raise self._truncated(start + len(data) // dtype.itemsize, self._header.points)
        rows = np.frombuffer(data, dtype)
        blocks = self._named(ALL, lambda names: iter([{name: self._word(name, rows[name]) for name in names}]), self._further())
        return self._record(*next(blocks))

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]] | None:
        form, size = self._header.data, self._header.points * self._header.dtype.itemsize
        if form == "binary_compressed" and size > MOST_UNPACKED:  # a sample decompresses it at once
            return None
        return self._sampled_rows(form, wanted, points, run)

    def _sampled_rows(self, form: str, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        blocks = self._sampled_compressed
        if form != "binary_compressed":
            blocks = self._sampled_ascii if form == "ascii" else self._sampled_binary
        yield from self._named(wanted, lambda names: blocks(names, points, run))

    def _named(
        self, wanted: str, blocks: Callable[[list[str]], Iterator[Columns]], further: Sequence[str] = ()
    ) -> Iterator[tuple[int, Columns]]:
        """Turns blocks of fields into the wanted columns.  blocks: yields the named fields of some points.  further: fields
        that keep their names."""
        fields = {column: name for column, name in self._fields.items() if column in wanted}
        packed = self._rgb if "r" in wanted else None
        names = [*fields.values(), *([packed] if packed else []), *further]
        for found in blocks(names) if names else ():
            columns = {column: found[name] for column, name in fields.items()}
            if packed is not None:
                words = found[packed]
                columns |= {c: (words >> shift & 0xFF).astype(np.uint8) for c, shift in zip("rgb", (16, 8, 0))}
            yield 0, columns | {name if len(name) > 1 else f"{name}_": found[name] for name in further}

    def _binary(self, names: list[str]) -> Iterator[Columns]:
        """Yields fields by name; packed colours as uint32."""
        header, done = self._header, 0
        with self.path.open("rb") as file:
            file.seek(header.offset)
            while done < header.points:
                n = min(CHUNK, max(1, _BLOCK // header.dtype.itemsize), header.points - done)
                data = file.read(n * header.dtype.itemsize)
                records = np.frombuffer(data, header.dtype, count=len(data) // header.dtype.itemsize)
                done += len(records)
                if len(records) < n:
                    raise self._truncated(done, header.points)
                yield {name: self._word(name, records[name]) for name in names}

    def _sampled_binary(self, names: list[str], points: int, run: int) -> Iterator[Columns]:
        size = self._header.dtype.itemsize
        with self.path.open("rb") as file:
            for start in run_starts(self._header.points, points, run).tolist():
                file.seek(self._header.offset + start * size)
                data = file.read(min(run, self._header.points - start) * size)
                records = np.frombuffer(data, self._header.dtype, count=len(data) // size)
                yield {name: self._word(name, records[name]) for name in names}

    def _word(self, name: str, values: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(values).view("<u4") if name == self._rgb else values

    def _ascii(self, names: list[str]) -> Iterator[Columns]:
        header, done, target = self._header, 0, self._targets(names)
        with self.path.open("rb") as file:
            file.seek(header.offset)
            text = TextRows(self.path, file, lines=header.lines)
            while done < header.points:
                table, other = text.rows(target, min(ROWS, header.points - done))
                done += len(table)
                if len(table):
                    yield {name: self._plain(name, table[:, i]) for i, name in enumerate(names)}
                if other is not None:
                    raise text.unreadable(fields=(other, len(target)))
                if not len(table):
                    raise self._truncated(done, header.points)
            if not text.at_end():
                self._warn(surplus_warning(self.path, self.count))

    def _sampled_ascii(self, names: list[str], points: int, run: int) -> Iterator[Columns]:
        region = TextRegion(self._header.offset, self.path.stat().st_size, self._targets(names))
        for _, table in sample_rows(self.path, [region], points, run):
            yield {name: self._plain(name, table[:, i]) for i, name in enumerate(names)}

    def _targets(self, names: list[str]) -> list[int]:
        """For each value of a line of text the place of its field in ``names``, -1 for other fields."""
        return [names.index(f.name) if f.name in names else -1 for f in self._header.fields for _ in range(f.count)]

    def _plain(self, name: str, values: np.ndarray) -> np.ndarray:
        """Converts numbers read from text to their field's type."""
        kind = next(field.type for field in self._header.fields if field.name == name)
        if name == self._rgb:
            with np.errstate(over="ignore", invalid="ignore"):
                if kind == "f4":  # the four colour bytes, printed as one float
                    return values.astype("<f4").view("<u4")
                return np.clip(np.nan_to_num(values), -(2.0**31), 2.0**32 - 1).astype(np.int64).astype("<u4")
        if kind in ("u1", "u2"):
            return np.clip(np.nan_to_num(values), 0, np.iinfo(kind).max).astype(kind)
        return values

    def _compressed(self, names: list[str]) -> Iterator[Columns]:
        """Yields fields by name.  One reader of the compressed bytes for each of them, since columns lie one after the
        other."""
        header = self._header
        readers, types = self._readers(names), {field.name: np.dtype(f"<{field.type}") for field in header.fields}
        for start in range(0, header.points, CHUNK):
            n = min(CHUNK, header.points - start)
            yield {name: self._word(name, reader.read(n * types[name].itemsize).view(types[name]))
                   for name, reader in readers.items()}

    def _readers(self, names: list[str]) -> dict[str, LzfReader]:
        """A reader at the beginning of each column.  The first call decompresses everything once, which shows any damage."""
        header = self._header
        if not self._columns:
            packed = int(np.fromfile(self.path, "<u4", 1, offset=header.offset)[0])
            reader = LzfReader(np.fromfile(self.path, np.uint8, packed, offset=header.offset + 8))
            try:
                for field in header.fields:
                    self._columns.setdefault(field.name, reader.copy())
                    reader.skip(header.points * field.count * int(field.type[1:]))
            except DamagedLzf:
                self._columns.clear()
                raise InputError("damaged: its compressed points cannot be unpacked", file=self.path,
                                 remedy="copy or export it again") from None  # fmt: skip
        return {name: self._columns[name].copy() for name in names}

    def _sampled_compressed(self, names: list[str], points: int, run: int) -> Iterator[Columns]:
        """Decompresses whole columns, since LZF cannot be read from the middle, and takes runs of them."""
        header = self._header
        columns = {name: values for name, reader in self._readers(names).items()
                   for field in header.fields if field.name == name
                   for values in [self._word(name, reader.read(header.points * int(field.type[1:])).view(f"<{field.type}"))]}
        for start in run_starts(header.points, points, run).tolist():
            yield {name: values[start : start + run] for name, values in columns.items()}
