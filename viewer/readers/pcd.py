"""PCD (Point Cloud Library), versions 0.5 to 0.7: ascii, binary and binary_compressed.

The compressed form is decoded by Open3D, once the header's sizes agree with the file's: it is stored by columns and has to be
decompressed completely in any case.  The other two forms are read here, because Open3D 0.20 returns uninitialised memory for
truncated ascii files and the beginning of damaged numbers, holds all points of binary files at once, and refuses coordinates of
different types.  Frame and units: as stored; a VIEWPOINT gives a warning and is not applied.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..errors import InputError
from .column_source import Columns, ColumnSource
from .pcd_header import Header, read_header
from .sampling import run_starts
from .source import CHUNK, surplus_warning
from .text_rows import ROWS, TextRows
from .text_sample import TextRegion, sample_rows

_RGB = (("r", "g", "b"), ("red", "green", "blue"))
_PACKED = ("rgb", "rgba")  # of four bytes: blue, green, red, and alpha or nothing
_INTENSITIES = ("intensity", "intensities", "i", "reflectance", "reflectivity", "remission")
_CLASSES = ("classification", "class", "label")


class PcdSource(ColumnSource):
    """One .pcd file.  Raises InputError where the header is not valid, or the file is shorter than it states."""

    def __init__(self, path: Path):
        super().__init__(path, "PCD")
        with path.open("rb") as file:
            self._header = header = read_header(path, file)
        self.count = header.points
        self._columns: np.ndarray | None = None
        names = {field.name: field for field in header.fields}
        if missing := [axis for axis in "xyz" if axis not in names or names[axis].count != 1]:
            raise InputError(f"{path}: PCD without {', '.join(missing)} (its fields: {', '.join(names)}); nothing to show")
        if self.count == 0:
            raise InputError(f"{path}: holds no points (its header says 0); export it again")
        self._fields: dict[str, str] = {axis: axis for axis in "xyz"}
        self._rgb = next((name for name in _PACKED if name in names and names[name].type[1:] == "4"), None)
        if self._rgb is None:
            rgb = next((rgb for rgb in _RGB if all(name in names for name in rgb)), ())
            self._fields |= dict(zip("rgb", rgb))
        for column, known in (("i", _INTENSITIES), ("c", _CLASSES)):
            if found := next((name for name in known if name in names and names[name].count == 1), None):
                self._fields[column] = found
        if header.data != "ascii" and all(names[axis].type == "f4" for axis in "xyz"):
            self.precision = 2.0**-24
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
            raise InputError(f"{self.path}: damaged: {what}; copy or export it again")
        if packed > size - 8:
            what = f"{max(size - 8, 0):,} of {packed:,} bytes of its compressed points are there"
            raise InputError(f"{self.path}: truncated: {what}; copy or export it again")

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        form = self._header.data
        blocks = self._ascii if form == "ascii" else self._binary if form == "binary" else self._compressed
        yield from self._named(wanted, blocks)

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        form = self._header.data
        blocks = self._sampled_compressed
        if form != "binary_compressed":
            blocks = self._sampled_ascii if form == "ascii" else self._sampled_binary
        yield from self._named(wanted, lambda names: blocks(names, points, run))

    def _named(self, wanted: str, blocks: Callable[[list[str]], Iterator[Columns]]) -> Iterator[tuple[int, Columns]]:
        """Turns blocks of fields into the wanted columns.  blocks: yields the named fields of some points."""
        fields = {column: name for column, name in self._fields.items() if column in wanted}
        packed = self._rgb if "r" in wanted else None
        names = [*fields.values(), *([packed] if packed else [])]
        for found in blocks(names) if names else ():
            columns = {column: found[name] for column, name in fields.items()}
            if packed is not None:
                words = found[packed]
                columns |= {c: (words >> shift & 0xFF).astype(np.uint8) for c, shift in zip("rgb", (16, 8, 0))}
            yield 0, columns

    def _binary(self, names: list[str]) -> Iterator[Columns]:
        """Yields fields by name; packed colours as uint32."""
        header, done = self._header, 0
        with self.path.open("rb") as file:
            file.seek(header.offset)
            while done < header.points:
                n = min(CHUNK, header.points - done)
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
        types = {field.type for field in self._header.fields if field.name in "xyz"}
        if len(types) > 1:
            raise InputError(f"{self.path}: its compressed coordinates are of different types, which Open3D does not read; "
                             "save it as binary")  # fmt: skip
        points = _decoded(self.path)
        found = {name: values.numpy() for name, values in points.items()}
        xyz = found.get("positions")
        if xyz is None or len(xyz) != self._header.points:
            raise InputError(f"{self.path}: damaged: its compressed points cannot be unpacked; copy or export it again")
        for start in range(0, len(xyz), CHUNK):
            rows = slice(start, start + CHUNK)
            columns = {axis: xyz[rows, i] for i, axis in enumerate("xyz")}
            if "colors" in found:
                r, g, b = (found["colors"][rows, i].astype("<u4") for i in range(3))
                columns |= {self._rgb or "rgb": r << 16 | g << 8 | b}
            yield {name: columns[name] if name in columns else found[name][rows].reshape(-1) for name in names}

    def _sampled_compressed(self, names: list[str], points: int, run: int) -> Iterator[Columns]:
        """Decompresses everything, since LZF cannot be read from the middle, and takes runs of it."""
        header, data = self._header, self._decompressed()
        columns, place = {}, 0
        for field in header.fields:  # one column after the other
            if field.name in names and field.name != "_":
                values = np.frombuffer(data, f"<{field.type}", header.points, place)
                columns[field.name] = self._word(field.name, values)
            place += header.points * field.count * int(field.type[1])
        for start in run_starts(header.points, points, run).tolist():
            yield {name: values[start : start + run] for name, values in columns.items()}

    def _decompressed(self) -> np.ndarray:
        """All columns one after the other, uint8; kept for the second reading of a sample."""
        if self._columns is None:
            from .lzf import decompress

            header = self._header
            packed, size = np.fromfile(self.path, "<u4", 2, offset=header.offset).tolist()
            columns = np.empty(size, np.uint8)
            if decompress(np.fromfile(self.path, np.uint8, packed, offset=header.offset + 8), columns) != size:
                raise InputError(f"{self.path}: damaged: its compressed points cannot be unpacked; copy or export it again")
            self._columns = columns
        return self._columns


def _decoded(path: Path):
    """Open3D's columns of a file, empty where it cannot read it.  Its own messages are suppressed."""
    try:
        import open3d
    except ImportError as error:
        raise InputError(f"{path}: compressed PCD is read by Open3D, which cannot be loaded ({error}); install open3d, or save "
                         "it as binary") from None  # fmt: skip
    try:
        with open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error):
            return dict(open3d.t.io.read_point_cloud(path, format="pcd").point.items())
    except (RuntimeError, UnicodeError) as error:
        line = (str(error).strip().splitlines() or [""])[0][:120]
        raise InputError(f"{path}: damaged: Open3D cannot unpack it ({line}); copy or export it again") from None
