"""Entwine Point Tiles: ept.json, a hierarchy of JSON files, and nodes that are laszip, binary or zstandard.

After the specification (github.com/connormanning/entwine, doc/entwine-point-tile.md).  Coordinates are values times scale plus
offset by the schema; laszip nodes are complete LAZ files.  Frame: the file's.  Units: those of its reference system.
"""

import gzip
import re
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ..column_source import Columns
from ..own_folder import MOST_UNPACKED, may_unpack, own_path, refuse_link_out
from ..scaled_values import scaled
from .octree_source import TYPES, OctreeSource, as_object, columns_of, damaged, named, pieces, read_json, vector, whole

DATA, HIERARCHY = "ept-data", "ept-hierarchy"
SUFFIXES = {"laszip": "laz", "binary": "bin", "zstandard": "zst"}
_NODE = re.compile(r"\d{1,3}-\d{1,19}-\d{1,19}-\d{1,19}")
_ELSEWHERE = -1  # in place of a number of points: another file of the hierarchy describes the node
_LEAST_LARGE, _GZIP = 16 << 20, 50
"""Bytes that any part of the hierarchy may unpack to, and times its size for larger ones: over ten times what gzip does to the
names and counts of 42,000 random nodes (2.9, and 4.3 where all counts are equal)."""
_COLUMNS = {"x": "X", "y": "Y", "z": "Z", "r": "Red", "g": "Green", "b": "Blue", "i": "Intensity", "c": "Classification",
            "s": "PointSourceId"}  # fmt: skip
_KINDS = {"signed": "i", "unsigned": "u", "float": "f", "floating": "f"}


_WINDOW = 1 << 27  # bytes of zstandard's window, at most: the default limit of its command line


def _type_of(kind: str, size: int | None) -> str | None:
    """NumPy's type of a dimension; bytes where it is not a number of a known size; None where the size is unknown."""
    plain = f"{_KINDS[kind]}{size}" if kind in _KINDS and size else TYPES.get(kind, "")
    if plain in TYPES.values() and size in (None, int(plain[1:])):
        return plain
    return f"V{size}" if size and kind not in (*TYPES, *_KINDS) else None


def read_hierarchy(entry: Path, meta: dict, need: Callable[[list[str]], None] = lambda names: None) -> dict[str, int]:
    """Number of points by node, from all files of the hierarchy.  entry: the ept.json, meta: what it holds.  need: called with
    the names of files, relative to its folder, before they are read.  Raises InputError where they contradict each other."""
    kind = str(meta.get("hierarchyType", "json"))
    if kind not in ("json", "gzip"):
        raise InputError(f"hierarchyType {kind[:20]!a} is not known; EPT is json, gzip", file=entry)
    suffix = "json.gz" if kind == "gzip" else "json"
    waiting, found, read = ["0-0-0-0"], {}, set()
    need([f"{HIERARCHY}/{waiting[0]}.{suffix}"])
    while waiting:
        root = waiting.pop()
        path = own_path(entry.parent, f"{HIERARCHY}/{root}.{suffix}")
        nodes, known = _unzipped(path) if kind == "gzip" else read_json(path), len(waiting)
        read.add(root)
        for name, count in nodes.items():
            if _NODE.fullmatch(name) is None or not (count == _ELSEWHERE or whole(count) is not None):
                raise damaged(f"node {name[:40]!a} has {str(count)[:20]!a} points", path)
            if count != _ELSEWHERE:
                found[name] = count
            elif name not in read:
                waiting.append(name)
            elif name not in found:
                raise damaged(f"node {name!a} is described by its own file", path)
        need([f"{HIERARCHY}/{name}.{suffix}" for name in waiting[known:]])
    return {name: count for name, count in found.items() if count}


def _unzipped(path: Path) -> dict:
    try:
        most = min(MOST_UNPACKED, max(_LEAST_LARGE, path.stat().st_size * _GZIP))
        with gzip.open(path) as file:
            data = file.read(most + 1)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise damaged("its gzip data cannot be unpacked", path) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path,
                         remedy="copy the whole folder again") from None
    if len(data) > most:
        raise damaged("it is too long for a part of a hierarchy", path)
    return as_object(path, data)


class EptSource(OctreeSource):
    """The folder of an ept.json.  Raises InputError where its parts contradict each other."""

    def __init__(self, path: Path):
        super().__init__(path, "EPT")
        meta = read_json(path)
        self._data = str(meta.get("dataType"))
        if self._data not in SUFFIXES:
            raise InputError(f"dataType {self._data[:20]!a} is not known; EPT is {', '.join(SUFFIXES)}", file=path)
        self._schema, self._dtype = {}, np.dtype([])
        if self._data != "laszip":
            self._read_schema(meta.get("schema"))
        own_path(self.path, DATA)
        self._counts = read_hierarchy(self.entry, meta)
        self.count = sum(self._counts.values())
        if self.count == 0:
            raise InputError("holds no points", file=path, remedy="convert the scan again")
        for node in self._counts:
            self._check(node)
        stated = whole(meta.get("points"))
        if stated is not None and stated != self.count:
            self._warn(f"{self.path.name}: states {stated:,} points, its octree holds {self.count:,}")
        stated = meta.get("srs")
        srs = stated if isinstance(stated, dict) else {}
        self._crs(srs.get("wkt"))
        if self.crs is None and srs.get("authority") and srs.get("horizontal"):
            heights = f"+{srs['vertical']}" if srs.get("vertical") else ""
            self._crs(f"{srs['authority']}:{srs['horizontal']}{heights}"[:80])

    def _read_schema(self, stated: object) -> None:
        """Reads the dimensions of a point, with the scale and offset of the coordinates."""
        fields = []
        for entry in stated if isinstance(stated, list) else []:
            entry = entry if isinstance(entry, dict) else {}
            name, kind, size = entry.get("name"), str(entry.get("type")), whole(entry.get("size"), 4096)
            plain = _type_of(kind, size)
            ends = vector([entry.get("scale", 1), entry.get("offset", 0)], 2)
            if not isinstance(name, str) or not name or plain is None or ends is None or not ends[0] or name in self._schema:
                raise self._damaged(f"dimension {len(fields) + 1} of its schema has no name, known type and size of its own")
            self._schema[name] = (float(ends[0]), float(ends[1]))
            fields.append((name, f"<{plain}" if plain[0] != "V" else plain))
        self._dtype = np.dtype(fields)
        for axis in "XYZ":
            if axis not in self._schema or self._dtype[axis].kind not in "iuf":
                raise self._damaged("its schema has no X, Y and Z")

    def _file(self, node: str) -> Path:
        return self.path / DATA / f"{node}.{SUFFIXES[self._data]}"

    def _check(self, node: str) -> None:
        """Raises InputError where the file of a node is missing, or its length differs from that of its points."""
        file, count = self._file(node), self._counts[node]
        refuse_link_out(self.entry.parent, file)
        try:
            size = file.stat().st_size
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", file=file, remedy="copy the whole folder again") from None
        if self._data == "binary" and size != count * self._dtype.itemsize:
            have = min(size // self._dtype.itemsize, count)
            raise InputError(f"truncated or damaged: {have:,} of {count:,} points could be read", file=file,
                             remedy="copy it again")
        if self._data == "zstandard" and not may_unpack(size, count * self._dtype.itemsize):
            raise self._damaged(f"its {size:,} bytes cannot hold {count:,} points", file)

    def _nodes(self) -> Iterator[tuple[int, Columns]]:
        for node, count in self._counts.items():
            yield from self._points_of(node, count)

    def _levels(self) -> np.ndarray:
        return np.array([(int(node.partition("-")[0]), count) for node, count in self._counts.items()], np.int64)

    def _node(self, number: int) -> Iterator[tuple[int, Columns]]:
        return self._points_of(*list(self._counts.items())[number])

    def _points_of(self, node: str, count: int) -> Iterator[tuple[int, Columns]]:
        if self._data == "laszip":
            yield from self._from_las(node, count)
            return
        done = 0
        with self._file(node).open("rb") as file:
            for records in pieces(file, self._dtype) if self._data == "binary" else self._unpacked(node, file):
                done += len(records)
                if done <= count:
                    yield 0, self._columns(records)
                else:
                    break
        if done != count:
            raise self._damaged(f"does not hold the {count:,} points that the hierarchy says", self._file(node))

    def _record_nodes(self) -> Iterator[tuple[int, Columns]]:
        if self._data != "laszip":
            yield from self._nodes()
            return
        for node, count in self._counts.items():
            yield from self._from_las(node, count, whole=True)

    def _from_las(self, node: str, count: int, *, whole: bool = False) -> Iterator[tuple[int, Columns]]:
        from ..las.las_source import LasSource

        source = LasSource(self._file(node))
        if source.count != count:
            raise self._damaged(f"holds {source.count:,} points where the hierarchy says {count:,}", self._file(node))
        for chunk in source.record_chunks() if whole else source.chunks():
            yield 0, columns_of(chunk)

    def _unpacked(self, node: str, file: BinaryIO) -> Iterator[np.ndarray]:
        """The records of a node, unpacked in steps."""
        try:
            import zstandard
        except ImportError:
            raise InputError("its points are compressed with zstandard", file=self.entry,
                             remedy="pip install zstandard, or convert it to laszip") from None  # fmt: skip
        try:
            yield from pieces(zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(file), self._dtype)
        except zstandard.ZstdError:
            raise self._damaged("its compressed points cannot be unpacked", self._file(node)) from None

    def _columns(self, records: np.ndarray) -> Columns:
        names = {column: name for column, name in _COLUMNS.items() if name in self._schema}
        if not {"r", "g", "b"} <= set(names):
            names = {column: name for column, name in names.items() if column not in "rgb"}
        columns = {}
        for column, name in names.items():
            plain = column not in "xyz"
            columns[column] = records[name] if plain else scaled(records[name], *self._schema[name])
        used = {*names.values(), "Red", "Green", "Blue"}
        for name in self._schema:
            if name not in used and self._dtype[name].kind in "iuf":
                plain = self._schema[name] == (1.0, 0.0)
                columns[named(name)] = records[name] if plain else scaled(records[name], *self._schema[name])
        return {column: values for column, values in columns.items() if values.dtype.kind in "iuf"}
