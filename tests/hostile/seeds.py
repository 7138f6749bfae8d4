"""Small good files of every format that the program reads, from which mutants are made.  The same bytes each time."""

import json
import os
import pickle
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))  # the makers of files

from cloud_files import E57Scan, surface, write_e57, write_las, write_ply
from format_files import PtxScan, some, text_rows, write_ept, write_pcd, write_potree1, write_potree2, write_ptx

POINTS = 40
"""Of most seeds."""
KEPT = Path(__file__).parent / "kept"
"""Mutants that failed once, each a folder; which files have changed and what runs is in its ``case.json``."""


@dataclass(frozen=True)
class Seed:
    """kind: what runs (exercise.KINDS).  files: path in the folder -> contents.  entry: path that is given to the program,
    "" for the folder.  untouched: files that are not edited."""

    format: str
    name: str
    kind: str
    files: dict[str, bytes]
    entry: str
    untouched: tuple[str, ...] = ()


def _read(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def _dated(path: Path) -> Path:
    """A LAS without the date of today."""
    data = bytearray(path.read_bytes())
    data[90:94] = bytes(4)
    path.write_bytes(data)
    return path


# ---- scans in one file
def _las14(path: Path) -> None:
    """Version 1.4 with extra bytes, GPS time, a reference system, and records behind the points."""
    import laspy

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 1 / 4096), np.zeros(3)
    header.add_extra_dim(laspy.ExtraBytesParams("reflectance", np.float32))
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
    las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("someone", 7, "more", bytes(30)), laspy.VLR("someone", 8, "", b"x")])
    las.write(str(path))
    _dated(path)


def _copc(path: Path) -> None:
    """Points in chunks of variable size, two levels, and the hierarchy behind the table of chunks."""
    import io

    import laspy
    import lazrs

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
    from test_e57_images import panorama, pinhole, room_points, write_photos

    write_photos(path, [pinhole((0, 0, 0), 0.3, size=(32, 24)), panorama((0, 0, 0), 0.2, 64)], *room_points(POINTS))


def _texts() -> dict[str, bytes]:
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
    },
    "pcd": {
        "a.pcd": lambda p: write_pcd(p, some(POINTS), "ascii"),
        "b.pcd": lambda p: write_pcd(p, some(POINTS), "binary", pad=True),
        "c.pcd": lambda p: write_pcd(p, some(POINTS), "binary_compressed", packed="U"),
        "d.pcd": lambda p: write_pcd(p, some(POINTS), "binary_compressed", packed=None, pad=True),
    },
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


# ---- what is not a scan
def _grid(folder: Path) -> None:
    from pointglass.viewer.grid.convert import convert

    os.environ["POINTGLASS_CACHE"] = str(folder / "unused")
    scan = write_ply(folder / "floor.ply", *surface(60))
    convert([scan], folder / "grid")
    scan.unlink()
    head = json.loads((folder / "grid" / "meta.json").read_text())  # without what differs each time
    head |= {"identity": [], "sum": None}
    head["meta"]["sources"] = ["/scans/floor.ply"]
    head["meta"]["records"]["files"] = [["/scans/floor.ply", 1823, 1795625382318747823]]
    del head["sum"]
    import zlib

    head["sum"] = zlib.crc32(json.dumps(head).encode())
    (folder / "grid" / "meta.json").write_text(json.dumps(head))


def _cameras(folder: Path) -> dict[str, Seed]:
    from test_camera_files import PICTURE, opencv_quaternion, shots, transforms, write_colmap
    from test_colmap_binary import models

    text, binary = models(folder, np.random.default_rng(3), 3)
    write_colmap(folder / "plain")
    quaternion, _ = opencv_quaternion()
    w, x, y, z = quaternion
    tum = "".join(f"{t}.5 1 2 3 {x} {y} {z} {w}\n" for t in range(4))
    lens = {**PICTURE, "fl_x": 50.0, "w": 80, "h": 60}
    files = {
        ("nerfstudio", "a"): {"transforms.json": json.dumps(transforms(applied_transform=np.eye(4)[:3].tolist())).encode()},
        ("nerfstudio", "b"): {"transforms.json": json.dumps({"frames": [lens, {**lens, "camera_angle_x": 0.7}]}).encode()},
        ("nerfstudio", "c"): {
            "camera_path.json": json.dumps(
                shots({"aspect": 1.3}, {}, {}, fps=24, seconds=2.5, camera_type="perspective")
            ).encode()
        },
        ("colmap", "text"): _read(text),
        ("colmap", "binary"): _read(binary),
        ("colmap", "plain"): _read(folder / "plain"),
        ("tum", "a"): {"trajectory.txt": b"# t x y z qx qy qz qw\n" + tum.encode(), "intrinsics.txt": b"100 100 40 30 80 60\n"},
    }
    return {
        f"{form} {name}": Seed(form, name, "cameras", found, "" if form == "colmap" else next(iter(found)))
        for (form, name), found in files.items()
    }


def _png(text: str, size: tuple[int, int] = (5, 4)) -> bytes:
    from pointglass.viewer.tools.files import write_png
    from pointglass.viewer.tools.shot_metadata import KEY

    with tempfile.TemporaryDirectory() as folder:
        write_png(Path(folder) / "a.png", np.zeros((*size, 3), np.uint8), {KEY: text})
        return (Path(folder) / "a.png").read_bytes()


def _window_files() -> list[Seed]:
    from documents import random_document
    from test_shot_metadata import shot

    from pointglass.viewer.tools.project import write_project
    from pointglass.viewer.window.autosave import UnsavedWork
    from pointglass.viewer.window.preferences import Preferences

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.pointglass"
        document = random_document(np.random.default_rng(5), [str(path.parent / "floor.ply")])
        write_project(path, replace(document, scans=(replace(document.scans[0], visible=True, crs="EPSG:25832"),)))
        project = path.read_bytes()
        unsaved = UnsavedWork(document, "", "", "floor", 5.0).text().replace(folder, "/scans").encode()
        scan = write_ply(path.with_name("floor.ply"), *surface(60)).read_bytes()
    from pointglass.viewer.tools.document import Alterations
    from pointglass.viewer.tools.look import Look

    plain = shot()
    altered = replace(plain, alterations=Alterations(look=Look(point_size=2)), other_view="raw", split_at=0.4)
    recent = [
        {"paths": ["/scans/floor.ply"], "title": "floor", "points": 60},
        {"paths": ["/a", "/b"], "title": "x", "points": 5},
    ]
    film = {"version": "1", "scans": ["a"], "points": 5, "size": [8, 8], "path": [[1.0] * 16]}
    return [
        Seed("like", "plain", "like", {"a.png": _png(plain.text())}, "a.png"),
        Seed("like", "altered", "like", {"a.png": _png(altered.text())}, "a.png"),
        Seed("project", "a", "project", {"a.pointglass": project, "floor.ply": scan}, "a.pointglass", ("floor.ply",)),
        Seed("state", "window", "preferences", {"window.json": json.dumps(asdict(Preferences())).encode()}, ""),
        Seed(
            "state", "recent", "recent", {"recent.json": json.dumps(recent).encode(), "thumbnail.png": _png("x", (20, 32))}, ""
        ),
        Seed("state", "autosave", "unsaved", {"work.json": unsaved}, "work.json"),
        Seed("state", "film", "film", {"film.json": json.dumps(film).encode()}, "film.json"),
    ]


def _weights(folder: Path) -> Seed:
    """The smallest network."""
    import torch

    from pointglass.model.unet import make_network
    from pointglass.model.weights import save_weights

    torch.manual_seed(0)
    save_weights(folder / "fast.safetensors", make_network("fast"), "fast", filtered=True)
    return Seed("weights", "fast", "weights", _read(folder), "fast.safetensors")


def _rooms(folder: Path) -> list[Seed]:
    from rooms import make_room
    from test_rgbd import PLAIN, write_nerfstudio, write_tum

    make_room(folder / "room", face=8, view=(6, 8), views=1)
    write_nerfstudio(folder / "rgbd", PLAIN)
    write_tum(folder / "tum")
    return [
        Seed("rooms", name, kind, _read(folder / name), "")
        for name, kind in (("room", "room"), ("rgbd", "rgbd"), ("tum", "rgbd"))
    ]


def seeds(form: str) -> tuple[Seed, ...]:
    """The seeds of one format."""
    return tuple(seed for seed in _group(next((group for group in _GROUPS if form in group), form)) if seed.format == form)


@cache
def _group(form: str | tuple[str, ...]) -> tuple[Seed, ...]:
    """The seeds of formats that are made together, in a child process, since lazrs' threads are missing in forks."""
    with tempfile.NamedTemporaryFile() as file:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                Path(file.name).write_bytes(pickle.dumps(_made(form)))
                code = 0
            except BaseException:
                traceback.print_exc()
            os._exit(code)
        if os.waitpid(child, 0)[1]:
            raise RuntimeError(f"the seeds of {form} cannot be made")
        return pickle.loads(Path(file.name).read_bytes())


_GROUPS = (("nerfstudio", "colmap", "tum"), ("like", "project", "state"))
"""Formats whose seeds are made together: what makes them takes long to import."""


def _made(form: str | tuple[str, ...]) -> tuple[Seed, ...]:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if form in ONE_FILE:
            for name, make in ONE_FILE[form].items():
                make(folder / name)
            return tuple(Seed(form, name, "scan", {name: data}, name) for name, data in _read(folder).items())
        if form in FOLDERS:
            found = []
            for name, make in FOLDERS[form].items():
                make(folder / name)
                found.append(Seed(form, name, "scan", _read(folder / name), ""))
            return tuple(found)
        if form == "text":
            return tuple(Seed(form, name, "scan", {name: data}, name) for name, data in _texts().items())
        if form == "grid":
            _grid(folder)
            return (Seed(form, "grid", "grid", _read(folder / "grid"), ""),)
        if form == _GROUPS[0]:
            return tuple(_cameras(folder).values())
        if form == _GROUPS[1]:
            return tuple(_window_files())
        if form == "weights":
            return (_weights(folder),)
        if form == "rooms":
            return tuple(_rooms(folder))
    raise KeyError(form)


FORMATS = (*ONE_FILE, "text", *FOLDERS, "grid", "nerfstudio", "colmap", "tum", "like", "project", "state", "weights", "rooms")
"""Everything that is read."""
