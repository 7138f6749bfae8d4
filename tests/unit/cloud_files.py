"""Makers of small scan files in every format, and the random surfaces they hold.  Metres, any frame."""

import re
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pointglass.viewer.readers.e57.e57_nodes import library

SCANS = Path(__file__).resolve().parents[3] / "shared" / "data" / "scans"
"""Real scans, present on some machines only; tests that use them skip elsewhere."""


def surface(count: int, seed: int = 0, origin=(0.0, 0.0, 0.0), size: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """xyz (count, 3) float64 on a wavy floor of ``size`` at ``origin``, rounded to 1/4096, and rgb (count, 3) uint8."""
    random = np.random.default_rng(seed)
    flat = random.random((count, 2)) * size
    height = 0.2 * np.sin(3 * flat[:, 0]) * np.cos(2 * flat[:, 1])
    xyz = np.round(np.column_stack([flat, height]) * 4096) / 4096 + np.asarray(origin)
    return xyz, random.integers(1, 256, (count, 3), dtype=np.uint8)


def write_las(
    path: Path, xyz, rgb=None, intensity=None, *, scale=1 / 4096, wkt: str | None = None, source=None, classes=None
) -> Path:  # fmt: skip
    """LAS, or LAZ by the suffix.  rgb: (n, 3), written as it is into the 16-bit fields."""
    import laspy

    header = laspy.LasHeader(point_format=3 if rgb is not None else 1, version="1.2")
    header.scales, header.offsets = np.full(3, scale), np.floor(np.nanmin(xyz, axis=0))
    if wkt:
        header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", wkt.encode() + b"\0"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.asarray(xyz).T
    if rgb is not None:
        las.red, las.green, las.blue = np.asarray(rgb, np.uint16).T
    if intensity is not None:
        las.intensity = intensity
    if source is not None:
        las.point_source_id = np.asarray(source, np.uint16)
    if classes is not None:
        las.classification = classes
    las.write(str(path))
    return path


def write_ply(
    path: Path, xyz, rgb=None, *, order="binary_little_endian", kind="double", names=("red", "green", "blue"),
    colour="uchar", extra: bool = False, faces_first: bool = False, vertex_list: bool = False, newline="\n",
) -> Path:  # fmt: skip
    """extra: properties and elements no viewer needs.  vertex_list: a list in the middle of each vertex."""
    code = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}[order]
    kinds = {"double": "f8", "float": "f4", "uchar": "u1", "ushort": "u2"}
    fields = [("x", kind), ("y", kind), ("z", kind)]
    values = [np.asarray(xyz)[:, i] for i in range(3)]
    if extra:
        fields.insert(1, ("confidence", "float"))
        values.insert(1, np.linspace(0, 1, len(xyz)))
    if rgb is not None:
        fields += [(name, colour) for name in names]
        values += [np.asarray(rgb)[:, i] for i in range(3)]
    faces = ["element face 2", "property list uchar int vertex_indices"]
    vertex = [f"element vertex {len(xyz)}"]
    for i, (name, type_name) in enumerate(fields):
        vertex.append(f"property {type_name} {name}")
        if vertex_list and i == 0:
            vertex.append("property list uchar float knots")
    body = [faces, vertex] if faces_first else [vertex, faces] if extra else [vertex]
    head = [
        "ply",
        f"format {order} 1.0",
        "comment made for a test",
        *(line for part in body for line in part),
        "end_header",
    ]
    face_rows = [[3, 0, 1, 2], [4, 0, 1, 2, 3]]
    data = b""
    for part in body:
        if order == "ascii":
            rows = face_rows if part is faces else [list(row) for row in zip(*values, strict=True)]
            if part is vertex and vertex_list:
                rows = [[row[0], i % 3, *[0.5] * (i % 3), *row[1:]] for i, row in enumerate(rows)]
            data += "".join(" ".join(_text(v) for v in row) + newline for row in rows).encode()
        elif part is faces:
            data += b"".join(bytes([row[0]]) + np.array(row[1:], code + "i4").tobytes() for row in face_rows)
        else:
            table = np.empty(len(xyz), [(f"{j} {name}", code + kinds[type_name]) for j, (name, type_name) in enumerate(fields)])
            for column, value in zip(table.dtype.names or (), values, strict=True):
                table[column] = value
            rows, knots = table.tobytes(), table.dtype[0].itemsize  # where the list begins, in the middle of a row
            if vertex_list:
                each = (rows[i : i + table.itemsize] for i in range(0, len(rows), table.itemsize))
                rows = b"".join(row[:knots] + bytes([i % 3]) + bytes(4 * (i % 3)) + row[knots:] for i, row in enumerate(each))
            data += rows
    path.write_bytes(newline.join(head).encode() + newline.encode() + data)
    return path


def _text(value) -> str:
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(int(value))


@dataclass
class E57Scan:
    """xyz: (n, 3) in the scanner's frame.  quaternion: w, x, y, z.  invalid: (n,) 0 valid, 1 or 2 not.  kind: of coordinates,
    double, float or scaled (integers).  beside: other fields, whole numbers."""

    xyz: np.ndarray
    rgb: np.ndarray | None = None
    intensity: np.ndarray | None = None
    quaternion: tuple | None = None
    translation: tuple | None = None
    invalid: np.ndarray | None = None
    spherical: bool = False
    colour_full: int = 255
    limits: bool = True
    name: str | None = None
    kind: str = "double"
    beside: dict = field(default_factory=dict)


def write_e57(path: Path, scans: list[E57Scan]) -> Path:
    """Every combination the standard allows and pye57's own writer does not."""
    e = library()

    file = e.ImageFile(str(path), "w")
    root = file.root()
    file.extensionsAdd("", e.E57_V1_0_URI)
    for name, node in (
        ("formatName", e.StringNode(file, "ASTM E57 3D Imaging Data File")), ("guid", e.StringNode(file, "{test}")),
        ("versionMajor", e.IntegerNode(file, e.E57_FORMAT_MAJOR)),
        ("versionMinor", e.IntegerNode(file, e.E57_FORMAT_MINOR)),
    ):  # fmt: skip
        root.set(name, node)
    data = e.VectorNode(file, True)
    root.set("data3D", data)
    for number, scan in enumerate(scans):
        node = e.StructureNode(file)
        data.append(node)
        node.set("guid", e.StringNode(file, f"{{scan {number}}}"))
        if scan.name:
            node.set("name", e.StringNode(file, scan.name))
        _write_pose(e, file, node, scan)
        x, y, z = np.asarray(scan.xyz, np.float64).T.copy()
        if scan.spherical:
            r = np.sqrt(x * x + y * y + z * z)
            columns = {
                "sphericalRange": r,
                "sphericalAzimuth": np.arctan2(y, x),
                "sphericalElevation": np.arcsin(z / r),
            }
        else:
            columns = {"cartesianX": x, "cartesianY": y, "cartesianZ": z}
        prototype = e.StructureNode(file)
        for name in columns:
            prototype.set(name, _coordinate(e, file, scan.kind))
        if scan.rgb is not None:
            for name, values in zip(("colorRed", "colorGreen", "colorBlue"), np.asarray(scan.rgb).T, strict=True):
                columns[name] = values.astype(np.float64)
                prototype.set(name, e.IntegerNode(file, 0, 0, scan.colour_full))
            if scan.limits:
                limits = e.StructureNode(file)
                for name in ("Red", "Green", "Blue"):
                    limits.set(f"color{name}Minimum", e.IntegerNode(file, 0))
                    limits.set(f"color{name}Maximum", e.IntegerNode(file, scan.colour_full))
                node.set("colorLimits", limits)
        if scan.intensity is not None:
            columns["intensity"] = np.asarray(scan.intensity, np.float64)
            prototype.set("intensity", e.FloatNode(file, 0.0, e.E57_SINGLE, e.E57_FLOAT_MIN, e.E57_FLOAT_MAX))
            if scan.limits:
                limits = e.StructureNode(file)
                limits.set("intensityMinimum", e.FloatNode(file, 0.0))
                limits.set("intensityMaximum", e.FloatNode(file, 1.0))
                node.set("intensityLimits", limits)
        if scan.invalid is not None:
            name = "sphericalInvalidState" if scan.spherical else "cartesianInvalidState"
            columns[name] = np.asarray(scan.invalid, np.float64)
            prototype.set(name, e.IntegerNode(file, 0, 0, 2))
        for name, values in scan.beside.items():
            columns[name] = np.asarray(values, np.float64)
            prototype.set(name, e.IntegerNode(file, 0, 0, max(int(np.max(values)), 1)))
        points = e.CompressedVectorNode(file, prototype, e.VectorNode(file, True))
        node.set("points", points)
        buffers = e.VectorSourceDestBuffer()
        columns = {name: np.ascontiguousarray(values) for name, values in columns.items()}
        for name, values in columns.items():
            buffers.append(e.SourceDestBuffer(file, name, values, max(len(values), 1), True, True))
        writer = points.writer(buffers)
        if len(x):
            writer.write(len(x))
        writer.close()
    file.close()
    return path


def _coordinate(e, file, kind: str):
    if kind == "scaled":
        return e.ScaledIntegerNode(file, 0, -(2**31), 2**31 - 1, 2.0**-16, 0.0)
    if kind == "float":
        return e.FloatNode(file, 0.0, e.E57_SINGLE, e.E57_FLOAT_MIN, e.E57_FLOAT_MAX)
    return e.FloatNode(file, 0.0, e.E57_DOUBLE, e.E57_DOUBLE_MIN, e.E57_DOUBLE_MAX)


def _write_pose(e, file, node, scan: E57Scan) -> None:
    if scan.quaternion is None and scan.translation is None:
        return
    pose = e.StructureNode(file)
    node.set("pose", pose)
    for name, keys, values in (("rotation", "wxyz", scan.quaternion), ("translation", "xyz", scan.translation)):
        if values is not None:
            part = e.StructureNode(file)
            pose.set(name, part)
            for key, value in zip(keys, values, strict=True):
                part.set(key, e.FloatNode(file, float(value)))


def edited_e57(path: Path, *changes: tuple[bytes, bytes], byte: tuple[int, int] | None = None) -> Path:
    """The file with what patterns find in its XML replaced, or the byte at a place; lengths and checksums fit again."""
    raw = path.read_bytes()
    data = bytearray(b"".join(raw[i : i + 1020] for i in range(0, len(raw), 1024)))
    place, length = struct.unpack_from("<2Q", data, 24)
    begin = place // 1024 * 1020 + place % 1024
    xml = bytes(data[begin : begin + length])
    for pattern, new in changes:
        xml, found = re.subn(pattern, lambda _, new=new: new, xml, flags=re.DOTALL)
        assert found, pattern
    data[begin:] = xml
    data += bytes(-len(data) % 1020)
    struct.pack_into("<3Q", data, 16, len(data) // 1020 * 1024, place, len(xml))
    if byte is not None:
        data[byte[0]] = byte[1]
    pages = [bytes(data[i : i + 1020]) for i in range(0, len(data), 1020)]
    path.write_bytes(b"".join(page + struct.pack(">I", _crc32c(page)) for page in pages))
    return path


def _crc32c(data: bytes) -> int:
    value = 0xFFFFFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ (0x82F63B78 if value & 1 else 0)
    return value ^ 0xFFFFFFFF
