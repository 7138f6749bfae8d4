"""Potree 1.x: cloud.js and a folder of nodes, .bin (records of points), .las or .laz.

After Potree's loader (github.com/potree/potree, src/loader/POCLoader.js and its BinaryDecoderWorker).  A node is named by its
path from the root, such as r0412: octants, in which 4 is x, 2 is y and 1 is z.  Coordinates of .bin nodes are relative to the
node's corner: uint32 times scale from version 1.4 on, float32 before.  The nodes are listed in .hrc files (five bytes per node,
children and points, breadth first), before version 1.5 in cloud.js.  Frame: the file's.  Units: those of its projection.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ..column_source import Columns
from ..own_folder import own_path, refuse_link_out
from ..scaled_values import scaled
from ..source import CHUNK
from .octree_source import MOST_ELEMENTS, TYPES, OctreeSource, columns_of, damaged, named, read_json, vector, whole

_NODE_FILE = re.compile(r"(r[0-7]*)\.(bin|las|laz|hrc)", re.IGNORECASE)
_HIERARCHY = np.dtype([("children", "u1"), ("points", "<u4")])
_SIZES = {"POSITION_CARTESIAN": ("i4", 3), "COLOR_PACKED": ("u1", 4), "RGBA_PACKED": ("u1", 4), "RGB_PACKED": ("u1", 3),
          "RGBA": ("u1", 4), "RGB": ("u1", 3), "INTENSITY": ("u2", 1), "CLASSIFICATION": ("u1", 1), "NORMAL_FLOATS": ("f4", 3),
          "NORMAL": ("f4", 3), "NORMAL_SPHEREMAPPED": ("u1", 2), "NORMAL_OCT16": ("u1", 2), "FILLER_1B": ("u1", 1)}  # fmt: skip
"""Type and elements of the attributes that older versions give by name only."""
_LEAST_LAS_RECORD = 20
"""Bytes of a point in LAS point format 0, the shortest (LAS 1.4 specification, table 7)."""
_COLOURS, _COLUMNS = ("COLOR_PACKED", "RGBA_PACKED", "RGB_PACKED", "RGBA", "RGB"), {"INTENSITY": "i", "CLASSIFICATION": "c"}


class Potree1Source(OctreeSource):
    """The folder of a cloud.js.  Raises InputError where its parts contradict each other."""

    def __init__(self, path: Path):
        super().__init__(path, "Potree 1")
        meta = read_json(path)
        version = re.fullmatch(r"1\.(\d{1,3})(\.\d+)*", str(meta.get("version")))
        if version is None:
            raise InputError(f"version {str(meta.get('version'))[:20]!a} is not known; Potree 1.0 to 1.8 are read", file=path)
        self._integers = int(version[1]) > 3
        box = meta.get("boundingBox")
        corners = [vector([box.get(key) for key in keys]) if isinstance(box, dict) else None
                   for keys in (("lx", "ly", "lz"), ("ux", "uy", "uz"))]  # fmt: skip
        scale = vector([meta.get("scale")] * 3)
        if corners[0] is None or corners[1] is None or (self._integers and (scale is None or not scale.all())):
            raise self._damaged("its boundingBox and scale are not numbers")
        self._low, self._size, self._scale = corners[0], corners[1] - corners[0], scale
        folder = meta.get("octreeDir")
        self._files = self._listed(own_path(path.parent, folder if isinstance(folder, str) else "data"))
        stated = meta.get("pointAttributes")
        self._suffix = "bin" if isinstance(stated, list) else "laz" if str(stated).upper() == "LAZ" else "las"
        self._dtype = self._records(stated) if isinstance(stated, list) else None
        self._counts = self._checked_nodes(meta)
        if self._dtype is not None:
            self.count = sum(file.stat().st_size // self._dtype.itemsize for _, file in self._points())
            for _, file in self._points():
                if file.stat().st_size % self._dtype.itemsize:
                    what = f"{file.stat().st_size:,} bytes are not a multiple of its {self._dtype.itemsize} a point"
                    raise self._damaged(what, file)
        if self.count == 0 or not any(True for _ in self._points()):
            raise InputError("holds no points", file=path, remedy="copy the whole folder, or convert the scan again")
        self._crs(meta.get("projection"))

    def _listed(self, folder: Path) -> dict[tuple[str, str], Path]:
        """The files of the octree by name of their node and suffix, in any subfolder: these differ between versions."""
        found = {}
        if not folder.is_dir():
            raise InputError("no such folder, it should hold the octree", file=folder, remedy="copy the whole folder again")
        for place, _, names in os.walk(folder):
            for name in names:
                if match := _NODE_FILE.fullmatch(name):
                    refuse_link_out(self.entry.parent, Path(place) / name)
                    found[match[1], match[2].lower()] = Path(place) / name
        return found

    def _points(self) -> Iterator[tuple[str, Path]]:
        """The nodes that hold points and their files, coarse ones first."""
        named = sorted((len(name), name) for name, suffix in self._files if suffix == self._suffix)
        return ((name, self._files[name, self._suffix]) for _, name in named)

    def _records(self, stated: list) -> np.dtype:
        """The record of a point in a .bin node."""
        fields = []
        for entry in stated:
            if isinstance(entry, str) and entry.upper() in _SIZES:
                name, (kind, count) = entry.upper(), _SIZES[entry.upper()]
            elif isinstance(entry, dict) and isinstance(entry.get("name"), str) and str(entry.get("type")) in TYPES:
                name, kind = entry["name"].upper() or "-", TYPES[entry["type"]]
                count = whole(entry.get("elements", entry.get("numElements")), MOST_ELEMENTS) or 0
            else:
                raise self._damaged(f"attribute {len(fields) + 1} is not known, or has no name, type and elements")
            if not count:
                raise self._damaged(f"attribute {name[:30]!a} has no number of elements")
            if name == "POSITION_CARTESIAN":
                kind = "u4" if self._integers else "f4"
            fields.append((name if name not in dict(fields) else f"{name} {len(fields)}", (f"<{kind}", (count,))))
        dtype = np.dtype([(name, *kind) for name, kind in fields])
        if "POSITION_CARTESIAN" not in (dtype.names or ()) or dtype["POSITION_CARTESIAN"].shape != (3,):
            raise self._damaged("has no attribute POSITION_CARTESIAN of three numbers")
        return dtype

    def _checked_nodes(self, meta: dict) -> dict[str, int]:
        """Points of the nodes by name, as far as the hierarchy lists them.  Raises InputError where a listed node has no file:
        a part of the folder was not copied."""
        stated = meta.get("hierarchy")
        if isinstance(stated, list):
            pairs = (entry for entry in stated if isinstance(entry, list) and len(entry) == 2)
            nodes = {str(name): points for name, points in pairs if whole(points) is not None}
        else:
            nodes = self._from_hrc()
        missing = [name for name, points in nodes.items() if points and (name, self._suffix) not in self._files]
        if missing:
            raise InputError(f"truncated: {len(missing):,} of {len(nodes):,} nodes have no file, the first is "
                             f"{missing[0][:40]!a}", file=self.path, remedy="copy the whole folder again")  # fmt: skip
        return nodes

    def _from_hrc(self) -> dict[str, int]:
        """Number of points of each node, from the .hrc files."""
        nodes: dict[str, int] = {}
        for (root, suffix), file in self._files.items():
            if suffix != "hrc":
                continue
            nodes |= {name: points for name, (points, _) in nodes_in(file, root).items()}
        return nodes

    def _nodes(self) -> Iterator[tuple[int, Columns]]:
        for name, file in self._points():
            yield from self._points_of(name, file)

    def _levels(self) -> np.ndarray:
        size = _LEAST_LAS_RECORD if self._dtype is None else self._dtype.itemsize
        counts = {name: self._counts.get(name) or -(-file.stat().st_size // size) for name, file in self._points()}
        return np.array([(len(name) - 1, count) for name, count in counts.items()], np.int64)

    def _node(self, number: int) -> Iterator[tuple[int, Columns]]:
        return self._points_of(*list(self._points())[number])

    def _points_of(self, name: str, file: Path) -> Iterator[tuple[int, Columns]]:
        return self._from_las(file) if self._dtype is None else self._from_records(name, file)

    def _record_nodes(self) -> Iterator[tuple[int, Columns]]:
        for name, file in self._points():
            yield from self._from_las(file, whole=True) if self._dtype is None else self._from_records(name, file)

    def _from_las(self, file: Path, *, whole: bool = False) -> Iterator[tuple[int, Columns]]:
        from ..las.las_source import LasSource

        source = LasSource(file)
        for chunk in source.record_chunks() if whole else source.chunks():
            yield 0, columns_of(chunk)

    def _from_records(self, name: str, path: Path) -> Iterator[tuple[int, Columns]]:
        dtype, corner = self._dtype, self._corner(name)
        assert dtype is not None
        with path.open("rb") as file:
            while data := file.read(CHUNK * dtype.itemsize):
                if len(data) % dtype.itemsize:
                    raise self._damaged(f"its last point has {len(data) % dtype.itemsize} bytes", path)
                records = np.frombuffer(data, dtype)
                scale = self._scale if self._scale is not None and self._integers else 1.0
                xyz = scaled(records["POSITION_CARTESIAN"], scale, corner)
                columns = {axis: xyz[:, i] for i, axis in enumerate("xyz")}
                if colour := next((field for field in _COLOURS if field in (dtype.names or ())), None):
                    columns |= {channel: records[colour][:, i] for i, channel in enumerate("rgb")}
                known = ((field, column) for field, column in _COLUMNS.items() if field in (dtype.names or ()))
                columns |= {column: records[field].reshape(-1) for field, column in known}
                used = {*_COLUMNS, *_COLOURS, "POSITION_CARTESIAN"}
                further = (field for field in dtype.names or () if field not in used and dtype[field].base.kind in "iuf")
                yield 0, columns | {named(field): _flat(records[field]) for field in further}

    def _corner(self, name: str) -> np.ndarray:
        """(3,) lowest corner of a node's box."""
        low, size = self._low.copy(), self._size.copy()
        for octant in name[1:]:
            size = size / 2
            low = low + size * [int(octant) >> 2 & 1, int(octant) >> 1 & 1, int(octant) & 1]
        return low


def nodes_in(file: Path, root: str) -> dict[str, tuple[int, int]]:
    """Points, and a mask of the children, of each node that a .hrc file describes, by name.  root: the first of them."""
    data = file.read_bytes()
    if not data or len(data) % _HIERARCHY.itemsize:
        raise damaged(f"{len(data):,} bytes are not a multiple of {_HIERARCHY.itemsize} a node", file)
    names, nodes = [root], {}
    for at, (children, points) in enumerate(np.frombuffer(data, _HIERARCHY).tolist()):
        if at == len(names):
            raise damaged("holds more nodes than it names", file)
        nodes[names[at]] = points, children
        if len(names) * _HIERARCHY.itemsize < len(data):  # the children of the last level are described by other files
            names += [f"{names[at]}{octant}" for octant in range(8) if children >> octant & 1]
    return nodes


def _flat(values: np.ndarray) -> np.ndarray:
    """(n,) of (n, 1) values; others as they are."""
    return values.reshape(-1) if values.shape[1:] == (1,) else values
