"""Potree 2: metadata.json, hierarchy.bin and octree.bin, encoded DEFAULT (records of points) or BROTLI (columns, compressed).

After Potree's loader (github.com/potree/potree, src/modules/loader/2.0).  A node of the hierarchy has 22 bytes: type (0 inner,
1 leaf, 2 proxy, described by another run of the hierarchy), children, points, place and length in octree.bin, or of the run.
Coordinates are int32 times scale plus offset.  BROTLI interleaves the bits of their low and of their high halves (Morton
order), and likewise those of colours.  Frame: the file's.  Units: those of its projection.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ..column_source import Columns, Ranges, ranges_of
from ..own_folder import LEAST_UNPACKED, MOST_RATIO, MOST_UNPACKED, own_path
from ..scaled_values import scaled
from ..source import CHUNK, Chunk
from .octree_source import MOST_ELEMENTS, PIECE, TYPES, OctreeSource, read_json, vector, whole
from .octree_source import named as record_name

_NODE = np.dtype([("type", "u1"), ("children", "u1"), ("points", "<u4"), ("place", "<i8"), ("bytes", "<i8")])
_PROXY = 2
_RGB, _POSITION = ("rgb", "rgba"), ("position", "position_cartesian")
_MORTON_BYTES = {"position": 16, "rgb": 8}  # per point, of attributes with interleaved bits
_COLUMNS = {"intensity": "i", "classification": "c", "point source id": "s"}
_SLACK = 1024  # bytes by which compressed data may exceed the plain data: brotli needs 5 in 16 MiB


class Potree2Source(OctreeSource):
    """The folder of a metadata.json.  Raises InputError where its parts contradict each other."""

    def __init__(self, path: Path):
        super().__init__(path, "Potree 2")
        meta = read_json(path)
        self._encoding = str(meta.get("encoding", "DEFAULT")).upper()
        if self._encoding not in ("DEFAULT", "UNCOMPRESSED", "BROTLI"):
            raise InputError(f"encoding {self._encoding[:20]!a} is not known", file=path,
                             remedy="convert it with DEFAULT or BROTLI")
        scale, offset = vector(meta.get("scale")), vector(meta.get("offset"))
        if scale is None or offset is None or not scale.all():
            raise self._damaged("its scale and offset are not three numbers each")
        self._scale, self._offset = scale, offset
        self._attributes = self._attributes_of(meta.get("attributes"))
        self._dtype = np.dtype([(f"{i}", *kind) for i, (_, *kind) in enumerate(self._attributes)])
        self._octree = own_path(path.parent, "octree.bin")
        self._places, self._cells = self._hierarchy(own_path(path.parent, "hierarchy.bin"), meta.get("hierarchy"))
        self.count = int(self._places["points"].sum(dtype=np.int64))
        if self.count == 0:
            raise InputError("holds no points", file=path, remedy="convert the scan again")
        stated = whole(meta.get("points"))
        if stated is not None and stated > self.count:
            self._warn(f"{self.path.name}: states {stated:,} points, its octree holds {self.count:,}")
        self._crs(meta.get("projection"))

    def _attributes_of(self, stated: object) -> list[tuple]:
        """(name, type, shape) of each attribute, in order."""
        found = []
        for entry in stated if isinstance(stated, list) else []:
            name = entry.get("name") if isinstance(entry, dict) else None
            kind = TYPES.get(str(entry.get("type"))) if isinstance(entry, dict) else None
            count = whole(entry.get("numElements"), MOST_ELEMENTS) if isinstance(entry, dict) else None
            if not isinstance(name, str) or kind is None or not count:
                raise self._damaged(f"attribute {len(found) + 1} has no name, known type and number of elements")
            name = name.lower()
            name = "position" if name in _POSITION else "rgb" if name in _RGB else name
            found.append((name, f"<{kind}", (count,) if count > 1 or name == "position" else ()))
        named = {name: (kind, shape) for name, kind, shape in found}
        if named.get("position") != ("<i4", (3,)):
            raise self._damaged("has no attribute position of three int32")
        if "rgb" in named and (named["rgb"][0] not in ("<u1", "<u2") or named["rgb"][1] not in ((3,), (4,))):
            raise self._damaged("its attribute rgb is not three uint8 or uint16")
        return found

    def _hierarchy(self, path: Path, stated: object) -> tuple[np.ndarray, np.ndarray]:
        """The nodes that hold points, each once, in the order of octree.bin, and their levels and places as of _cells_of."""
        first = whole(stated.get("firstChunkSize")) if isinstance(stated, dict) else None
        try:
            data, size = path.read_bytes(), self._octree.stat().st_size
        except OSError as error:
            name = error.filename or path
            raise InputError(f"cannot be read: {error.strerror}", file=name, remedy="copy the whole folder again") from None
        runs, seen, found, cells = [(0, first or 0, np.zeros(4, np.int64))], set(), [], []
        while runs:
            place, length, top = runs.pop()
            if length <= 0 or length % _NODE.itemsize or not 0 <= place <= len(data) - length or place in seen:
                raise self._damaged(f"its run of {length:,} bytes at {place:,} cannot be in {len(data):,} bytes", path)
            seen.add(place)
            nodes = np.frombuffer(data, _NODE, length // _NODE.itemsize, place)
            proxies = nodes["type"] == _PROXY
            below = _cells_of(np.where(proxies, np.uint8(0), nodes["children"]), top)
            runs += zip(nodes["place"][proxies].tolist(), nodes["bytes"][proxies].tolist(), below[proxies], strict=True)
            held = ~proxies & (nodes["bytes"] != 0) & (nodes["points"] != 0)
            found.append(nodes[held])
            cells.append(below[held])
        nodes, below = np.concatenate(found), np.concatenate(cells)
        order = np.argsort(nodes["place"], kind="stable")
        nodes, below = nodes[order], below[order]
        ends = nodes["place"] + nodes["bytes"]
        if len(nodes) and (nodes["place"].min() < 0 or nodes["bytes"].min() < 0 or ends.min() < 0 or ends.max() > size):
            lost = int(nodes["points"][(ends > size) | (ends < 0)].sum(dtype=np.int64))
            raise InputError(f"truncated or damaged: nodes with {lost:,} points lie beyond its {size:,} bytes",
                             file=self._octree, remedy="copy or convert the scan again")  # fmt: skip
        lengths = nodes["points"].astype(np.int64) * self._dtype.itemsize
        if self._encoding == "BROTLI":
            stored = nodes["points"].astype(np.int64) * sum(width for _, width in self._widths())
            wrong = nodes["bytes"] > stored + stored // 64 + _SLACK
            wrong |= (stored > MOST_UNPACKED) | (stored > np.maximum(LEAST_UNPACKED, nodes["bytes"] * MOST_RATIO))
        else:
            wrong = nodes["bytes"] != lengths
        if wrong.any():
            node = nodes[wrong][0]
            what = f"{node['points']:,} points of {self._dtype.itemsize} bytes"
            raise self._damaged(f"a node of {what} cannot have {node['bytes']:,} bytes", path)
        return nodes, below

    def node_runs(self) -> np.ndarray:
        """(n, 7) int64 of each node: its level, its points, the first and last byte in octree.bin, the last left out, and its
        place x, y, z among the cubes of its level."""
        first = self._places["place"]
        runs = np.stack([self._cells[:, 0], self._places["points"], first, first + self._places["bytes"]], axis=1)
        return np.hstack([runs.astype(np.int64), self._cells[:, 1:]])

    def node_chunks(self, number: int) -> Iterator[Chunk]:
        """The points of one node.  number: the row of ``node_runs``.  Ranges of colours and intensities that their types do not
        tell are those of the root."""

        def root_ranges() -> Ranges:
            if self._ranges is None:
                self._ranges = ranges_of(self._node(int(self._cells[:, 0].argmin())))
            return self._ranges

        for scan, columns in self._node(number):
            yield self._chunk(scan, columns, root_ranges)

    def _widths(self) -> list[tuple[str, int]]:
        """Name and bytes per point of the attributes in BROTLI encoding."""
        sizes = [self._dtype[i].itemsize for i in range(len(self._attributes))]
        return [(name, _MORTON_BYTES.get(name, size)) for (name, *_), size in zip(self._attributes, sizes)]

    def _nodes(self) -> Iterator[tuple[int, Columns]]:
        with self._octree.open("rb") as file:
            for node in self._places:
                yield from self._points_of(file, node)

    def _levels(self) -> np.ndarray:
        return np.stack([self._cells[:, 0], self._places["points"]], axis=1).astype(np.int64)

    def _node(self, number: int) -> Iterator[tuple[int, Columns]]:
        with self._octree.open("rb") as file:
            yield from self._points_of(file, self._places[number])

    def _points_of(self, file: BinaryIO, node: np.ndarray) -> Iterator[tuple[int, Columns]]:
        """node: of type _NODE."""
        place, length, count = int(node["place"]), int(node["bytes"]), int(node["points"])
        if self._encoding == "BROTLI":
            yield 0, self._interleaved(self._unpacked(self._read(file, place, length), count), count)
            return
        step = max(1, min(CHUNK, PIECE // self._dtype.itemsize)) * self._dtype.itemsize
        for start in range(0, length, step):
            records = np.frombuffer(self._read(file, place + start, min(step, length - start)), self._dtype)
            named = {name: records[f"{i}"] for i, (name, *_) in enumerate(self._attributes)}
            yield 0, self._columns(named)

    def _read(self, file: BinaryIO, place: int, length: int) -> bytes:
        file.seek(place)
        data = file.read(length)
        if len(data) < length:
            raise InputError(f"truncated at byte {place + len(data):,}", file=self._octree,
                             remedy="copy or convert the scan again")
        return data

    def _unpacked(self, data: bytes, count: int) -> bytes:
        """Unpacks the columns of a node.  Raises InputError where their length is not exactly that of its points."""
        try:
            import brotli
        except ImportError:
            raise InputError("its points are compressed with brotli", file=self.entry,
                             remedy="pip install brotli, or convert it with encoding DEFAULT") from None  # fmt: skip
        expected, parts, have = count * sum(width for _, width in self._widths()), [], 0
        unpack = brotli.Decompressor()
        try:
            part = unpack.process(data, output_buffer_limit=expected + 1)
            while part:  # not more than expected, so that damaged data cannot exhaust memory
                parts.append(part)
                have += len(part)
                if have > expected:
                    break
                part = unpack.process(b"", output_buffer_limit=expected + 1 - have)
        except brotli.error:
            have = -1
        if have != expected:
            raise self._damaged(f"a node of {count:,} points does not unpack to its {expected:,} bytes", self._octree)
        return b"".join(parts)

    def _interleaved(self, data: bytes, count: int) -> Columns:
        named, at = {}, 0
        for (name, kind, shape), (_, width) in zip(self._attributes, self._widths()):
            if name == "position":
                high, low = np.frombuffer(data, "<u8", 2 * count, at).reshape(-1, 2).T
                halves = [_third_bits(high >> axis) << 16 | _third_bits(low >> axis) for axis in range(3)]
                named[name] = np.stack(halves, axis=1).astype("<u4").view("<i4")
            elif name == "rgb":
                bits = np.frombuffer(data, "<u8", count, at)
                named[name] = np.stack([_third_bits(bits >> axis) for axis in range(3)], axis=1).astype("<u2")
            else:
                values = np.frombuffer(data, kind, count * (shape[0] if shape else 1), at)
                named[name] = values.reshape(count, *shape)
            at += width * count
        return self._columns(named)

    def _columns(self, named: dict[str, np.ndarray]) -> Columns:
        columns = {axis: scaled(named["position"][:, i], self._scale[i], self._offset[i]) for i, axis in enumerate("xyz")}
        if "rgb" in named:
            columns |= {channel: named["rgb"][:, i] for i, channel in enumerate("rgb")}
        columns |= {_COLUMNS[name]: named[name] for name in named if name in _COLUMNS and named[name].ndim == 1}
        further = (name for name in named if name not in (*_COLUMNS, "position", "rgb"))
        return columns | {record_name(name): named[name] for name in further if named[name].dtype.kind in "iuf"}


def _cells_of(children: np.ndarray, top: np.ndarray) -> np.ndarray:
    """(n, 4) int64: level of each node of a run, and its place x, y, z among the cubes of its level.  children: (n,) uint8
    masks, nodes in breadth-first order; octants, in which 4 is x, 2 is y and 1 is z.  top: (4,) those of the first."""
    masks = np.unpackbits(children[:, None], axis=1, bitorder="little")
    found, begin, end = np.zeros((len(children), 4), np.int64), 0, 1
    found[:1] = top
    while begin < len(children):
        parents, octants = np.nonzero(masks[begin:end])
        last = min(end + len(parents), len(children))
        parents, octants = parents[: last - end] + begin, octants[: last - end]
        found[end:last, 0] = found[parents, 0] + 1
        found[end:last, 1:] = 2 * found[parents, 1:] + (octants[:, None] >> np.array([2, 1, 0]) & 1)
        if last == end < len(children):  # nodes without a parent: damaged
            found[end], last = found[begin] + (1, 0, 0, 0), end + 1
        begin, end = end, last
    return found


def _third_bits(values: np.ndarray) -> np.ndarray:
    """(n,) uint64: bits 0, 3, 6, ..., 45 of values, compacted: one axis of a Morton code of three times 16 bits."""
    values = values & np.uint64(0x0000_2492_4924_9249 | 1 << 45)
    for shift, mask in ((2, 0x30C3_0C30_C30C_30C3), (4, 0xF00F_00F0_0F00_F00F), (8, 0x00FF_0000_FF00_00FF),
                        (16, 0xFFFF_0000_0000_FFFF), (32, 0xFFFF)):  # fmt: skip
        values = (values | values >> np.uint64(shift)) & np.uint64(mask)
    return values
