"""Binary PLY of coloured vertices, perhaps with triangles: as a scan of its points, or of points scattered over its surface."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from model.data.dataset import FAR, DataError, Scan

PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "float64": "f8",
}


@dataclass(frozen=True)
class PlyHeader:
    """Where a binary PLY's vertices and triangles lie.  faces: how many, 0 where there are none or other elements between."""

    start: int
    vertex: np.dtype
    vertices: int
    face: np.dtype | None
    faces: int

    @staticmethod
    def read(path: Path) -> "PlyHeader":
        """Raises DataError where it is no binary PLY of coloured vertices, or shorter than its header says."""
        order, elements = None, []
        with path.open("rb") as file:
            for number in range(200):
                line = file.readline(4096)
                words = line.decode("latin-1").split()
                if (number == 0) != (words == ["ply"]) or not line.endswith(b"\n"):
                    raise DataError(f"{path}: not a PLY file; download it again")
                if words[:1] == ["format"]:
                    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(" ".join(words[1:2]))
                elif words[:1] == ["element"]:
                    if len(words) != 3 or not words[2].isdecimal():
                        raise DataError(f"{path}: header line {' '.join(words)!r} not understood; download it again")
                    elements.append((words[1], int(words[2]), []))
                elif words[:1] == ["property"] and elements:
                    elements[-1][2].append(words[1:])
                elif words == ["end_header"]:
                    break
            start = file.tell()
        if order is None or not elements or elements[0][0] != "vertex":
            raise DataError(f"{path}: expected a binary PLY that begins with vertices; download it again")
        try:
            vertex = np.dtype([(name, order + PLY_TYPES[kind]) for kind, name in elements[0][2]])
        except (KeyError, ValueError):
            raise DataError(f"{path}: vertex properties not understood: {elements[0][2]}") from None
        if missing := [n for n in ("x", "y", "z", "red", "green", "blue") if n not in (vertex.names or ())]:
            raise DataError(f"{path}: its vertices have no {', '.join(missing)}")
        face, faces, size = None, 0, path.stat().st_size - start
        if len(elements) > 1 and elements[1][0] == "face" and [p[0] for p in elements[1][2]] == ["list"]:
            try:
                _, length, kind, _ = elements[1][2][0]
                face = np.dtype([("n", order + PLY_TYPES[length]), ("v", order + PLY_TYPES[kind], 3)])
            except (KeyError, ValueError):
                raise DataError(f"{path}: face properties not understood: {elements[1][2]}") from None
            faces = elements[1][1]
        needed = elements[0][1] * vertex.itemsize + (faces * face.itemsize if face else 0)
        if size < needed or not elements[0][1]:
            raise DataError(f"{path}: truncated or empty: {size:,} of {needed:,} bytes; download it again")
        return PlyHeader(start, vertex, elements[0][1], face, faces)


def _vertices(path: Path, header: PlyHeader) -> tuple[np.ndarray, np.ndarray]:
    rows = np.memmap(path, header.vertex, "r", header.start, (header.vertices,))
    with np.errstate(invalid="ignore"):  # some NaN of damaged files
        xyz = np.stack([rows[axis].astype(np.float64) for axis in "xyz"], 1)
    rgb = np.stack([rows[name] for name in ("red", "green", "blue")], 1)
    if rgb.dtype.kind == "f" and rgb.size and rgb.max() <= 1:
        rgb = rgb * 255
    return xyz, np.clip(np.nan_to_num(np.rint(rgb)), 0, 255).astype(np.uint8)


def read_points(path: Path, header: PlyHeader, hidden: Path) -> Scan:
    """All points of a PLY but those that are no places or whose indices ``hidden`` lists (where that file is)."""
    xyz, rgb = _vertices(path, header)
    keep = np.asarray((np.abs(xyz) < FAR).all(axis=1))
    if hidden.is_file():
        try:
            keep[np.array(hidden.read_text().split(), np.int64)] = False
        except (ValueError, IndexError) as error:
            raise DataError(f"{hidden}: not a list of point indices ({error}); download it again") from None
    return Scan(xyz[keep], rgb[keep], np.zeros(int(keep.sum()), np.uint8))


def scatter(path: Path, header: PlyHeader, count: int) -> Scan:
    """Points scattered evenly over the triangles of a PLY, seeded, colours between their corners'."""
    if header.face is None or not header.faces:
        raise DataError(f"{path}: has no triangles to scatter points on")
    xyz, rgb = _vertices(path, header)
    start = header.start + header.vertices * header.vertex.itemsize
    faces = np.memmap(path, header.face, "r", start, (header.faces,))
    corners = faces["v"].astype(np.int64)
    if (faces["n"] != 3).any() or corners.min() < 0 or corners.max() >= header.vertices:
        raise DataError(f"{path}: faces that are no triangles of its vertices; download it again")
    a, b, c = (xyz[corners[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rng = np.random.default_rng(0)
    pick = rng.choice(len(area), count, p=area / area.sum())
    s, t = rng.random((2, count, 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    mixed = [v[corners[pick, 0]] * (1 - s - t) + v[corners[pick, 1]] * s + v[corners[pick, 2]] * t for v in (xyz, rgb)]
    return Scan(mixed[0], np.rint(mixed[1]).astype(np.uint8), np.zeros(count, np.uint8))
