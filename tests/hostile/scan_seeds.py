"""Small good scans in every format: in one file, in folders of tiles, and as text.  The same bytes each time."""

import gzip
import struct
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))  # the makers of files
sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "unit" / "readers"))

from cloud_files import E57Scan, surface, write_e57, write_las, write_ply
from format_files import PtxScan, some, text_rows, write_ept, write_pcd, write_potree1, write_potree2, write_ptx

POINTS = 40
"""Of most seeds."""


def _dated(path: Path) -> Path:
    """A LAS without the date of today."""
    data = bytearray(path.read_bytes())
    data[90:94] = bytes(4)
    path.write_bytes(data)
    return path


def _las14(path: Path) -> None:
    """Version 1.4 with extra bytes, GPS time, a reference system, and records behind the points."""
    import laspy

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 1 / 4096), np.zeros(3)
    header.add_extra_dim(laspy.ExtraBytesParams("reflectance", np.dtype("f4")))
    header.add_extra_dim(laspy.ExtraBytesParams("ring", np.uint8, scales=np.array([0.5]), offsets=np.array([1.0])))
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", b'GEOGCS["x",DATUM["y",SPHEROID["z",6378137,298.25]]]\0'))
    header.vlrs.append(
        laspy.VLR("LASF_Projection", 34735, "", struct.pack("<12H", 1, 1, 0, 2, 3072, 0, 1, 25832, 3076, 0, 1, 9001))
    )
    las = laspy.LasData(header)
    xyz, rgb = surface(POINTS)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.astype(np.uint16).T * 257
    las.reflectance, las.ring = np.linspace(0, 1, POINTS), np.arange(POINTS) / 2 + 1
    las.gps_time, las.point_source_id = np.arange(POINTS), np.arange(POINTS) // 20
    from laspy.vlrs.vlrlist import VLRList

    las.evlrs = VLRList([laspy.VLR("someone", 7, "more", bytes(30)), laspy.VLR("someone", 8, "", b"x")])
    las.write(str(path))
    _dated(path)


def _copc(path: Path) -> None:
    """Points in chunks of variable size, two levels, and the hierarchy behind the table of chunks."""
    import io

    import laspy
    from untyped import lazrs

    count, sizes = 60, (10, 30, 20)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 1 / 4096), np.zeros(3)
    las = laspy.LasData(header)
    xyz, rgb = surface(count)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.astype(np.uint16).T * 257
    plain = io.BytesIO()
    las.write(plain)
    raw, record = plain.getvalue(), lazrs.LazVlr.new_for_compression(7, 0, True)
    begin, length, told = struct.unpack_from("<I", raw, 96)[0], header.point_format.size, bytes(record.record_data())
    head = bytearray(raw[:375]) + struct.pack("<2x16sHH32x", b"copc", 1, 160) + bytes(160)
    head += struct.pack("<2x16sHH32x", b"laszip encoded", 22204, len(told)) + told
    head[104] |= 0x80
    struct.pack_into("<II", head, 96, len(head), 2)
    out = io.BytesIO()
    out.write(head)
    compressor, places, done = lazrs.LasZipCompressor(out, record), [], 0
    for size in sizes:
        places.append(out.tell() if places else len(head) + 8)
        compressor.compress_many(raw[begin + done * length : begin + (done + size) * length])
        compressor.finish_current_chunk()
        done += size
    places.append(out.tell())
    compressor.done()
    data = bytearray(out.getvalue())
    hierarchy = b"".join(
        struct.pack("<iiiiQii", level, 0, 0, 0, place, after - place, size)
        for level, place, after, size in zip((0, 1, 1), places, places[1:], sizes)
    )
    struct.pack_into("<QQ", data, 375 + 54 + 40, len(data), len(hierarchy))
    path.write_bytes(bytes(data) + hierarchy)
    _dated(path)


def _e57(path: Path, **changes) -> None:
    xyz, rgb = surface(POINTS, origin=(0, 0, 3))
    good = E57Scan(xyz, rgb, np.linspace(0, 1, POINTS), (1, 0, 0, 0), (5, 6, 7), name="one")
    write_e57(path, [replace(good, **changes), E57Scan(xyz + 1, name="two", kind="float")])


def _e57_photographs(path: Path) -> None:
    from e57_photo_files import panorama, pinhole, room_points, write_photos

    write_photos(path, [pinhole((0, 0, 0), 0.3, size=(32, 24)), panorama((0, 0, 0), 0.2, 64)], *room_points(POINTS))


def _splats(path: Path) -> None:
    """Gaussian splats with the comments and the element behind them that export writes."""
    rows = np.linspace(-2, 2, POINTS * 17, dtype="<f4").reshape(POINTS, 17)
    rows[:, :3] = surface(POINTS)[0]
    names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
             "rot_0", "rot_1", "rot_2", "rot_3"]  # fmt: skip
    fields = "".join(f"property float {name}\n" for name in names)
    head = (f"ply\nformat binary_little_endian 1.0\ncomment frame 1 0 0 5 0 0 1 6 0 -1 0 7\nelement vertex {POINTS}\n{fields}"
            f"element provenance {POINTS}\nproperty uint points\nend_header\n")
    path.write_bytes(head.encode() + rows.tobytes() + bytes(4 * POINTS))


def _spz(path: Path, version: int, degree: int = 0) -> None:
    """Splats as SPZ: of versions 1 to 3 one gzip stream, of version 4 zstandard frames behind a table."""
    import zstandard

    rng = np.random.default_rng(version)
    widths = [6 if version == 1 else 9, 1, 3, 3, 4 if version > 2 else 3, (0, 9, 24, 45)[degree]]
    columns = [rng.integers(100, 256, POINTS * width, np.uint8).tobytes() for width in widths if width]
    streams = len(columns) if version > 3 else 0
    head = struct.pack("<4sIIBBBB", b"NGSP", version, POINTS, degree, 12, 0, streams)
    if version < 4:
        path.write_bytes(gzip.compress(head + b"".join(columns), mtime=0))
        return
    frames = [zstandard.compress(column) for column in columns]
    table = b"".join(struct.pack("<QQ", len(frame), len(column)) for frame, column in zip(frames, columns))
    path.write_bytes(head + struct.pack("<I12x", 32) + table + b"".join(frames))


def _glb_splats(path: Path) -> None:
    """Gaussian splats in two nodes of a binary glTF."""
    from test_splat_glb import glb, splats

    document, binary, _ = splats(np.random.default_rng(4))
    path.write_bytes(glb(document, binary))


def texts() -> dict[str, bytes]:
    points = some(POINTS)
    plain, coloured = text_rows([points.xyz]), text_rows([points.xyz, points.rgb])
    return {
        "a.pts": f"{POINTS}\n{text_rows([points.xyz, points.intensity, points.rgb])}".encode(),
        "b.xyz": plain.encode(),
        "c.txt": ("//X Y Z R G B\n" + coloured).encode(),
        "d.csv": ("x,y,z,r,g,b,intensity\n" + text_rows([points.xyz, points.rgb, points.intensity], ",")).encode(),
        "e.asc": text_rows([points.xyz, points.intensity], ";").encode(),
        "f.csv": ("X;Y;Z\n" + text_rows([points.xyz], ";").replace(".", ",")).encode(),
    }


ONE_FILE: dict[str, dict[str, Callable[[Path], object]]] = {
    "las": {"a.las": lambda p: _dated(write_las(p, *surface(POINTS), np.arange(POINTS), wkt='LOCAL_CS["x"]')), "b.las": _las14},
    "laz": {"a.laz": lambda p: _dated(write_las(p, *surface(POINTS), np.arange(POINTS))), "b.laz": _las14, "c.copc.laz": _copc},
    "e57": {
        "a.e57": _e57,
        "b.e57": lambda p: _e57(p, spherical=True, invalid=np.arange(POINTS) % 3),
        "c.e57": lambda p: _e57(p, kind="scaled", colour_full=65535, limits=False),
        "d.e57": _e57_photographs,
    },
    "ply": {
        "a.ply": lambda p: write_ply(p, *surface(POINTS), order="ascii", extra=True),
        "b.ply": lambda p: write_ply(p, *surface(POINTS), kind="float"),
        "c.ply": lambda p: write_ply(p, *surface(POINTS), order="binary_big_endian", vertex_list=True, colour="ushort"),
        "d.ply": lambda p: write_ply(p, *surface(POINTS), faces_first=True),
        "splats.ply": _splats,
    },
    "pcd": {
        "a.pcd": lambda p: write_pcd(p, some(POINTS), "ascii"),
        "b.pcd": lambda p: write_pcd(p, some(POINTS), "binary", pad=True),
        "c.pcd": lambda p: write_pcd(p, some(POINTS), "binary_compressed", packed="U"),
        "d.pcd": lambda p: write_pcd(p, some(POINTS), "binary_compressed", packed=None, pad=True),
    },
    "spz": {f"{version}.spz": lambda p, version=version: _spz(p, version, version % 3) for version in (1, 2, 3, 4)},
    "glb": {"splats.glb": _glb_splats},
    "ptx": {"a.ptx": lambda p: write_ptx(p, [PtxScan(some(20)), PtxScan(some(20, 1), empty=3)])},
}
FOLDERS: dict[str, dict[str, Callable[[Path], object]]] = {
    "potree1": {
        "1.7": lambda p: write_potree1(p, some(POINTS), version="1.7"),
        "1.4": lambda p: write_potree1(p, some(POINTS), version="1.4"),
        "laz": lambda p: write_potree1(p, some(12), version="1.8", form="laz"),
    },
    "potree2": {
        "plain": lambda p: write_potree2(p, some(POINTS)),
        "brotli": lambda p: write_potree2(p, some(POINTS), encoding="BROTLI"),
    },
    "ept": {
        "binary": lambda p: write_ept(p, some(POINTS), data="binary"),
        "zst": lambda p: write_ept(p, some(POINTS), data="zstandard"),
        "gzip": lambda p: write_ept(p, some(POINTS), data="binary", hierarchy="gzip", real=True),
        "laz": lambda p: write_ept(p, some(12)),
    },
}
