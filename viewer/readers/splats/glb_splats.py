"""Binary glTF with KHR_gaussian_splatting: its description, checked against the file, and where its splats lie in it.

Only splats as plain accessors of the file's own buffer are read; compressed ones, sparse ones and those of other files are
refused in a line that says so.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from .glb_head import EXTENSION

_DEEPEST = 64
"""Levels of nodes: deeper ones lead in a circle."""
_MOST_NODES = 1 << 16
"""Nodes, each as often as others lead to it."""
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_READ = {"POSITION": (3,), "COLOR_0": (3, 4), "OPACITY": (1,), "SH_DEGREE_0_COEF_0": (3,)}
"""Attributes that are read, without the extension's name -> numbers of a splat."""
AGAIN = "export it again"


@dataclass(frozen=True)
class Column:
    """One attribute of splats in the file.  at: of the first value, bytes.  count: of splats.  stride: from one splat to the
    next, bytes.  kind: of NumPy.  width: numbers of a splat.  normalized: whole numbers stand for 0..1 or -1..1."""

    at: int
    count: int
    stride: int
    kind: str
    width: int
    normalized: bool

    def read(self, data: np.ndarray, start: int, stop: int) -> np.ndarray:
        """(stop - start, width) float64.  data: the bytes of the file."""
        size = np.dtype(self.kind).itemsize
        rows = np.lib.stride_tricks.as_strided(data[self.at + start * self.stride :], (stop - start, self.width * size),
                                               (self.stride, 1))
        with np.errstate(invalid="ignore"):  # damaged files contain signalling NaN
            found = np.ascontiguousarray(rows).view(self.kind).astype(np.float64)
        return found / np.iinfo(self.kind).max if self.normalized else found


@dataclass(frozen=True, eq=False)
class SplatPart:
    """Splats of one primitive.  columns: by their name without the extension's.  to_world: (4, 4), of their node."""

    count: int
    columns: dict[str, Column]
    to_world: np.ndarray


def splat_parts(path: Path, found: dict[str, Any], begin: int) -> list[SplatPart]:
    """The splats of all nodes.  found, begin: as of glb_head.description.  Raises InputError where they are not as the
    extension says, do not lie in the file, or are of a kind that is not read."""
    try:
        with np.errstate(all="ignore"):
            return _parts(path, found, begin)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError):
        raise InputError("damaged: its description of splats is not as glTF has it", file=path, remedy=AGAIN) from None


def _parts(path: Path, found: dict[str, Any], begin: int) -> list[SplatPart]:
    size = path.stat().st_size
    nodes, meshes = found.get("nodes", []), found.get("meshes", [])
    scene = found.get("scenes", [{}])[found.get("scene", 0)]
    waiting = [(number, np.eye(4), 0) for number in scene.get("nodes", range(len(nodes)))]
    parts: list[SplatPart] = []
    visited = 0
    while waiting:
        number, above, depth = waiting.pop()
        visited += 1
        node = nodes[number]
        to_world = above @ _matrix(node)
        if depth > _DEEPEST or visited > _MOST_NODES or not np.isfinite(to_world).all():
            raise ValueError
        waiting += [(child, to_world, depth + 1) for child in node.get("children", [])]
        for primitive in meshes[node["mesh"]]["primitives"] if "mesh" in node else []:
            extension = primitive.get("extensions", {}).get(EXTENSION)
            if extension is None:
                continue
            if packed := [name for name in extension.get("extensions", {}) if "compression" in name]:
                raise InputError(f"its splats are compressed ({packed[0]:.60}), which is not read", file=path,
                                 remedy="save them as SPZ or PLY")
            named = {name.removeprefix(f"{EXTENSION}:"): index for name, index in primitive["attributes"].items()}
            count = int(found["accessors"][named["POSITION"]]["count"])
            columns = {name: _column(path, found, index, begin, size) for name, index in named.items() if name in _READ}
            if any(column.count != count or column.width not in _READ[name] for name, column in columns.items()):
                raise ValueError
            parts.append(SplatPart(count, columns, to_world))
    return parts


def _column(path: Path, found: dict[str, Any], index: int, begin: int, size: int) -> Column:
    accessor = found["accessors"][index]
    view = found["bufferViews"][accessor["bufferView"]]
    if "sparse" in accessor or view["buffer"] != 0 or "uri" in found["buffers"][0] or view.get("extensions"):
        raise InputError("its splats are sparse, compressed or in another file, which is not read", file=path,
                         remedy="save them as plain GLB, SPZ or PLY")
    kind, width, count = _TYPES[accessor["componentType"]], _WIDTHS[accessor["type"]], int(accessor["count"])
    step = np.dtype(kind).itemsize * width
    stride, at = int(view.get("byteStride", step)), int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
    if count < 1 or at < 0 or stride < step:
        raise ValueError
    if (end := begin + at + (count - 1) * stride + step) > size:
        raise InputError(f"truncated: its splats need {end:,} bytes, it has {size:,}", file=path,
                         remedy="copy or export it again")
    return Column(begin + at, count, stride, kind, width, bool(accessor.get("normalized")) and kind != "<f4")


def _matrix(node: dict[str, Any]) -> np.ndarray:
    """(4, 4) from a node's coordinates to those of the node above."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    out = np.eye(4)
    out[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), np.float64)
    out[:3, 3] = np.array(node.get("translation", (0, 0, 0)), np.float64)
    return out
