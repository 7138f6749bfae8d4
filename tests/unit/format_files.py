"""Makers of small files in the formats of viewer.readers.formats, beside those of cloud_files: every variant, answers known."""

import gzip
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from cloud_files import surface, write_las

FAR = (8_000_000.0, -4_000_000.0, 200.0)
"""Map coordinates: farther from zero than float32 can hold a millimetre."""


@dataclass
class Points:
    """xyz: (n, 3) float64, multiples of 1/4096.  rgb: (n, 3) uint8.  intensity: (n,) uint16.  classes: (n,) uint8."""

    xyz: np.ndarray
    rgb: np.ndarray
    intensity: np.ndarray
    classes: np.ndarray


def some(count: int = 400, seed: int = 0, origin=FAR) -> Points:
    """Points of a wavy floor with everything a point may have."""
    xyz, rgb = surface(count, seed, origin)
    random = np.random.default_rng(seed + 100)
    return Points(xyz, rgb, random.integers(0, 65536, count).astype(np.uint16), random.integers(0, 20, count).astype(np.uint8))


def text_rows(columns, delimiter: str = " ") -> str:
    """Lines of columns: (n,) or (n, k) arrays; floats with the digits that give them back."""
    parts = [part[:, None] if part.ndim == 1 else part for part in map(np.asarray, columns)]
    rows = zip(*(part[:, i].tolist() for part in parts for i in range(part.shape[1])))
    return "".join(delimiter.join(map(repr, row)) + "\n" for row in rows)


def write_pcd(path: Path, points: Points, data: str, *, packed: str | None = "F", real: str = "f8",
              viewpoint=(0, 0, 0, 1, 0, 0, 0), pad: bool = False, rgb_name: str = "rgb") -> Path:  # fmt: skip
    """packed: type of the four colour bytes, F, U or I; None: fields r, g, b.  pad: unused bytes and a histogram between."""
    r, g, b = points.rgb.astype(np.uint32).T
    fields = [(axis, real, 1, points.xyz[:, i].astype(real)) for i, axis in enumerate("xyz")]
    if pad:
        fields += [("_", "u1", 4, None), ("histogram", "f4", 3, np.ones((len(r), 3), "f4"))]
    if packed:
        alpha = 0 if packed == "F" else 255 << 24  # as numbers, F with full alpha would be NaN
        words = (r << 16 | g << 8 | b | np.uint32(alpha & 0xFFFFFFFF)).astype("<u4")
        kind = {"F": "f4", "U": "u4", "I": "i4"}[packed]
        fields.append((rgb_name, kind, 1, words.view(f"<{kind}")))
    else:
        fields += [(name, "u1", 1, points.rgb[:, i]) for i, name in enumerate("rgb")]
    fields += [("intensity", "u2", 1, points.intensity), ("label", "u1", 1, points.classes)]
    n = len(points.xyz)
    head = "\n".join([
        "# .PCD v0.7 - made for a test", "VERSION 0.7", f"FIELDS {' '.join(f[0] for f in fields)}",
        f"SIZE {' '.join(f[1][1] for f in fields)}", f"TYPE {' '.join(f[1][0].upper() for f in fields)}",
        f"COUNT {' '.join(str(f[2]) for f in fields)}", f"WIDTH {n // 2}", "HEIGHT 2",
        f"VIEWPOINT {' '.join(map(str, viewpoint))}", f"POINTS {n}", f"DATA {data}\n",
    ])  # fmt: skip
    arrays = [np.zeros((n, f[2]), f[1]) if f[3] is None else np.asarray(f[3]).reshape(n, f[2]) for f in fields]
    if data == "ascii":
        def shown(value):
            return f"{value:.9g}" if value.dtype == np.float32 else repr(value.item())
        body = "".join(" ".join(shown(v) for a in arrays for v in a[row]) + "\n" for row in range(n)).encode()
    elif data == "binary":
        body = b"".join(a[row].astype(a.dtype.newbyteorder("<")).tobytes() for row in range(n) for a in arrays)
    else:
        plain = b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)
        packed_bytes = b"".join(bytes([len(run) - 1]) + run for i in range(0, len(plain), 32) if (run := plain[i : i + 32]))
        body = struct.pack("<II", len(packed_bytes), len(plain)) + packed_bytes  # LZF of literal runs
    path.write_bytes(head.encode() + body)
    return path


@dataclass
class PtxScan:
    """points: in the scanner's frame; ``empty`` directions without a return are mixed in.  rotation: (3, 3), local -> world."""

    points: Points
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    translation: tuple = (0.0, 0.0, 0.0)
    empty: int = 0


def write_ptx(path: Path, scans: list[PtxScan], *, colour: bool = True) -> Path:
    text = ""
    for scan in scans:
        p, n = scan.points, len(scan.points.xyz)
        text += f"{n + scan.empty}\n1\n{' '.join(map(repr, scan.translation))}\n"
        text += "".join(" ".join(map(repr, row)) + "\n" for row in scan.rotation.T.tolist())
        text += "".join(" ".join(map(repr, row)) + " 0\n" for row in scan.rotation.T.tolist())
        text += " ".join(map(repr, scan.translation)) + " 1\n"
        rows = text_rows([p.xyz, p.intensity / 65535.0, *([p.rgb] if colour else [])]).splitlines(True)
        nothing = "0 0 0 0.5 0 0 0\n" if colour else "0 0 0 0.5\n"
        text += "".join(rows[: n // 2]) + nothing * scan.empty + "".join(rows[n // 2 :])
    path.write_text(text)
    return path


def in_octants(xyz: np.ndarray, low: np.ndarray, size: float, deepest: int, name: str = "r") -> dict[str, np.ndarray]:
    """Rows by node of an octree whose levels add up: each node keeps a fifth of what reaches it.  Octant 4x + 2y + z."""
    def split(rows, corner, side, node):
        if not len(rows):
            return
        keep = rows if len(node) > deepest else rows[::5]
        found[node] = keep
        rest = np.setdiff1d(rows, keep)
        octant = ((xyz[rest] >= corner + side / 2) @ [4, 2, 1]).astype(int)
        for i in range(8):
            split(rest[octant == i], corner + side / 2 * np.array([i >> 2 & 1, i >> 1 & 1, i & 1]), side / 2, f"{node}{i}")

    found: dict[str, np.ndarray] = {}
    split(np.arange(len(xyz)), low, size, name)
    return found


def write_potree1(folder: Path, points: Points, *, version: str = "1.8", form: str = "bin", step: int = 2) -> Path:
    """version: 1.3 has float coordinates, up to 1.4 the hierarchy is in cloud.js.  form: bin, las or laz."""
    low, size, scale = np.floor(points.xyz.min(axis=0)), 8.0, 1 / 4096
    nodes = in_octants(points.xyz, low, size, 3)
    minor = int(version.split(".")[1])
    (folder / "data" / "r").mkdir(parents=True)
    for name, rows in nodes.items():
        place = folder / "data" / "r" if minor >= 5 else folder / "data"
        if minor >= 5 and len(name) > step:
            place = place / name[1 : 1 + step]
            place.mkdir(exist_ok=True)
        if form != "bin":
            wide = points.rgb[rows].astype(np.uint16) * 257
            write_las(place / f"{name}.{form}", points.xyz[rows], wide, points.intensity[rows])
            continue
        corner, side = low.copy(), size
        for octant in map(int, name[1:]):
            side /= 2
            corner += side * np.array([octant >> 2 & 1, octant >> 1 & 1, octant & 1])
        local = points.xyz[rows] - corner
        xyz = np.rint(local / scale).astype("<u4") if minor > 3 else local.astype("<f4")
        table = np.zeros(len(rows), [("xyz", xyz.dtype, 3), ("rgba", "u1", 4), ("i", "<u2"), ("c", "u1")])
        table["xyz"], table["rgba"][:, :3] = xyz, points.rgb[rows]
        table["i"], table["c"] = points.intensity[rows], points.classes[rows]
        (place / f"{name}.bin").write_bytes(table.tobytes())
    if minor >= 5:
        _write_hrc(folder / "data" / "r", nodes, step)
    names = ["POSITION_CARTESIAN", "COLOR_PACKED", "INTENSITY", "CLASSIFICATION"]
    kinds = [("int32", 3), ("uint8", 4), ("uint16", 1), ("uint8", 1)]
    new = {"COLOR_PACKED": "RGBA", "INTENSITY": "intensity", "CLASSIFICATION": "classification"}
    described = [{"name": new.get(n, n), "type": kind, "elements": count} for n, (kind, count) in zip(names, kinds)]
    described = described if minor >= 8 else names
    box = dict(zip(("lx", "ly", "lz", "ux", "uy", "uz"), [*low, *(low + size)]))
    meta = {
        "version": version, "octreeDir": "data", "boundingBox": box,
        "pointAttributes": described if form == "bin" else form.upper(), "scale": scale, "hierarchyStepSize": step,
        "projection": "+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs",
    }  # fmt: skip
    if minor < 5:
        meta["hierarchy"] = [[name, len(rows)] for name, rows in nodes.items()]
    (folder / "cloud.js").write_text(json.dumps(meta))
    return folder


def _write_hrc(folder: Path, nodes: dict[str, np.ndarray], step: int) -> None:
    for root in [name for name in nodes if (len(name) - 1) % step == 0]:
        mine = sorted((n for n in nodes if n.startswith(root) and len(n) - len(root) <= step), key=lambda n: (len(n), n))
        data = b"".join(struct.pack("<BI", sum(1 << i for i in range(8) if f"{n}{i}" in nodes), len(nodes[n])) for n in mine)
        place = folder / root[1 : 1 + step] if len(root) > step else folder
        place.mkdir(exist_ok=True)
        (place / f"{root}.hrc").write_bytes(data)


def _spread(values: np.ndarray) -> np.ndarray:
    """(n,) bits 0 to 15 of values, moved to bits 0, 3, ..., 45, bit by bit."""
    return np.sum([((values.astype(np.uint64) >> np.uint64(k)) & np.uint64(1)) << np.uint64(3 * k) for k in range(16)], axis=0)


def _morton(values: np.ndarray) -> np.ndarray:
    return np.sum([_spread(values[:, axis]) << np.uint64(axis) for axis in range(3)], axis=0)


def write_potree2(folder: Path, points: Points, *, encoding: str = "DEFAULT", step: int = 2, right: float = 0.0) -> Path:
    """right: by how much the offset lies beyond the lowest corner: stored coordinates are negative then."""
    low, scale = np.floor(points.xyz.min(axis=0)), 1 / 4096
    nodes = in_octants(points.xyz, low, 8.0, 3)
    folder.mkdir(parents=True)
    octree, places = b"", {}
    for name, rows in nodes.items():
        xyz = np.rint((points.xyz[rows] - low - right) / scale).astype("<i4")
        rgb = points.rgb[rows].astype("<u2") * np.uint16(257)
        table = np.zeros(len(rows), [("xyz", "<i4", 3), ("i", "<u2"), ("c", "u1"), ("rgb", "<u2", 3)])
        table["xyz"], table["i"], table["c"], table["rgb"] = xyz, points.intensity[rows], points.classes[rows], rgb
        data = table.tobytes()
        if encoding == "BROTLI":
            import brotli

            whole = xyz.astype(np.uint32)
            columns = [np.stack([_morton(whole >> 16), _morton(whole & 0xFFFF)], axis=1), points.intensity[rows],
                       points.classes[rows], _morton(rgb)]  # fmt: skip
            data = brotli.compress(b"".join(np.ascontiguousarray(column).tobytes() for column in columns), quality=5)
        places[name] = (len(octree), len(data))
        octree += data
    (folder / "octree.bin").write_bytes(octree)

    def run(root):  # one run of the hierarchy: breadth first, nodes ``step`` levels below are told of elsewhere
        return sorted((n for n in nodes if n.startswith(root) and len(n) - len(root) <= step), key=lambda n: (len(n), n))

    roots = [name for name in nodes if (len(name) - 1) % step == 0 and (name == "r" or f"{name}" in nodes)]
    roots = [root for root in roots if root == "r" or any(n.startswith(root) and n != root for n in nodes)]
    at, starts = 0, {}
    for root in roots:
        starts[root] = (at, 22 * len(run(root)))
        at += starts[root][1]
    hierarchy = b""
    for root in roots:
        for name in run(root):
            mask = sum(1 << i for i in range(8) if f"{name}{i}" in nodes)
            proxy = name != root and name in starts
            kind = 2 if proxy else 0 if mask else 1
            hierarchy += struct.pack("<BBIqq", kind, mask, len(nodes[name]), *(starts[name] if proxy else places[name]))
    (folder / "hierarchy.bin").write_bytes(hierarchy)
    attributes = [("position", "int32", 3), ("intensity", "uint16", 1), ("classification", "uint8", 1), ("rgb", "uint16", 3)]
    (folder / "metadata.json").write_text(json.dumps({
        "version": "2.0", "name": "made", "points": len(points.xyz), "projection": "", "encoding": encoding,
        "hierarchy": {"firstChunkSize": starts["r"][1], "stepSize": step, "depth": 3},
        "boundingBox": {"min": low.tolist(), "max": (low + 8.0).tolist()},
        "offset": (low + right).tolist(), "scale": [scale] * 3,
        "attributes": [{"name": n, "type": kind, "numElements": count} for n, kind, count in attributes],
    }))  # fmt: skip
    return folder


def write_ept(folder: Path, points: Points, *, data: str = "laszip", hierarchy: str = "json", real: bool = False) -> Path:
    """real: coordinates as float64 instead of scaled int32."""
    low, scale = np.floor(points.xyz.min(axis=0)), 1 / 4096
    nodes = {}
    for name, rows in in_octants(points.xyz, low, 8.0, 2).items():
        x = y = z = 0
        for octant in map(int, name[1:]):
            x, y, z = 2 * x + (octant >> 2 & 1), 2 * y + (octant >> 1 & 1), 2 * z + (octant & 1)
        nodes[f"{len(name) - 1}-{x}-{y}-{z}"] = rows
    for part in ("ept-data", "ept-hierarchy"):
        (folder / part).mkdir(parents=True)
    kind = "<f8" if real else "<i4"
    fields = [("X", kind), ("Y", kind), ("Z", kind), ("Intensity", "<u2"), ("Classification", "u1"), ("PointSourceId", "<u2"),
              ("Red", "<u2"), ("Green", "<u2"), ("Blue", "<u2"), ("GpsTime", "<f8")]  # fmt: skip
    for name, rows in nodes.items():
        table = np.zeros(len(rows), fields)
        for i, axis in enumerate("XYZ"):
            table[axis] = points.xyz[rows, i] if real else np.rint((points.xyz[rows, i] - low[i]) / scale)
        table["Intensity"], table["Classification"] = points.intensity[rows], points.classes[rows]
        for i, channel in enumerate(("Red", "Green", "Blue")):
            table[channel] = points.rgb[rows, i].astype(np.uint16) * 257
        if data == "laszip":
            write_las(folder / "ept-data" / f"{name}.laz", points.xyz[rows], points.rgb[rows].astype(np.uint16) * 257,
                      points.intensity[rows], classes=points.classes[rows])  # fmt: skip
        elif data == "binary":
            (folder / "ept-data" / f"{name}.bin").write_bytes(table.tobytes())
        else:
            import zstandard

            (folder / "ept-data" / f"{name}.zst").write_bytes(zstandard.compress(table.tobytes()))
    deep = {name: len(rows) for name, rows in nodes.items() if name.startswith("2-")}
    parents = {name: f"1-{'-'.join(str(int(part) // 2) for part in name.split('-')[1:])}" for name in deep}
    shallow = {name: len(rows) for name, rows in nodes.items() if name not in deep}
    files = {"0-0-0-0": {name: (-1 if name in parents.values() else count) for name, count in shallow.items()}}
    for parent in set(parents.values()):
        files[parent] = {parent: len(nodes[parent])} | {name: count for name, count in deep.items() if parents[name] == parent}
    for name, counts in files.items():
        text = json.dumps(counts).encode()
        path = folder / "ept-hierarchy" / f"{name}.json{'.gz' if hierarchy == 'gzip' else ''}"
        path.write_bytes(gzip.compress(text) if hierarchy == "gzip" else text)
    names = {"<f8": ("float", 8), "<i4": ("signed", 4), "<u2": ("unsigned", 2), "u1": ("unsigned", 1)}
    schema = [{"name": name, "type": names[kind][0], "size": names[kind][1]} for name, kind in fields]
    if not real:
        for entry, offset in zip(schema, low):
            entry |= {"scale": scale, "offset": float(offset)}
    (folder / "ept.json").write_text(json.dumps({
        "bounds": [*low, *(low + 8)], "dataType": data, "hierarchyType": hierarchy, "points": len(points.xyz),
        "schema": schema,
        "srs": {"authority": "EPSG", "horizontal": "25832"}, "version": "1.0.0",
    }))  # fmt: skip
    return folder
