"""Small good files that are read and are no scans: grids, cameras, pictures, projects, state files, weights, and rooms for
training.  The same bytes each time."""

import json
import os
import sys
import tempfile
import zlib
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))  # the makers of files
sys.path.insert(1, str(Path(__file__).resolve().parents[1] / "unit" / "work"))
sys.path.insert(2, str(Path(__file__).resolve().parents[1] / "unit" / "lab"))

from cloud_files import surface, write_ply

from .seed import Seed, files_of


def grid(folder: Path) -> None:
    from pointglass.viewer.commands.convert import convert

    os.environ["POINTGLASS_CACHE"] = str(folder / "unused")
    scan = write_ply(folder / "floor.ply", *surface(60))
    convert([scan], folder / "grid")
    scan.unlink()
    head = json.loads((folder / "grid" / "meta.json").read_text())  # without what differs each time
    head |= {"identity": [], "sum": None}
    head["meta"]["sources"] = ["/scans/floor.ply"]
    head["meta"]["records"]["files"] = [["/scans/floor.ply", 1823, 1795625382318747823]]
    del head["sum"]
    head["sum"] = zlib.crc32(json.dumps(head).encode())
    (folder / "grid" / "meta.json").write_text(json.dumps(head))


def cameras(folder: Path) -> dict[str, Seed]:
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
        ("colmap", "text"): files_of(text),
        ("colmap", "binary"): files_of(binary),
        ("colmap", "plain"): files_of(folder / "plain"),
        ("tum", "a"): {"trajectory.txt": b"# t x y z qx qy qz qw\n" + tum.encode(), "intrinsics.txt": b"100 100 40 30 80 60\n"},
    }
    return {
        f"{form} {name}": Seed(form, name, "cameras", found, "" if form == "colmap" else next(iter(found)))
        for (form, name), found in files.items()
    }


def _png(text: str, size: tuple[int, int] = (5, 4)) -> bytes:
    from pointglass.viewer.common.files import write_png
    from pointglass.viewer.work.pictures.shot_metadata import KEY

    with tempfile.TemporaryDirectory() as folder:
        write_png(Path(folder) / "a.png", np.zeros((*size, 3), np.uint8), {KEY: text})
        return (Path(folder) / "a.png").read_bytes()


def window_files() -> list[Seed]:
    from documents import random_document
    from test_shot_metadata import shot

    from pointglass.viewer.window.session.autosave import UnsavedWork
    from pointglass.viewer.window.session.preferences import Preferences
    from pointglass.viewer.work.project import write_project

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.pointglass"
        document = random_document(np.random.default_rng(5), [str(path.parent / "floor.ply")])
        write_project(path, replace(document, scans=(replace(document.scans[0], visible=True, crs="EPSG:25832"),)))
        project = path.read_bytes()
        unsaved = UnsavedWork(document, "", "", "floor", 5.0).text().replace(folder, "/scans").encode()
        scan = write_ply(path.with_name("floor.ply"), *surface(60)).read_bytes()
    from pointglass.viewer.picture.edits import Edits
    from pointglass.viewer.picture.look import Look

    plain = shot()
    views = plain.spec.settings.view, "raw"
    edited = replace(plain.spec, edits=Edits(look=Look(point_size=2)), views=views, split_at=0.4)
    altered = replace(plain, spec=edited)
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


def weights(folder: Path) -> Seed:
    """The smallest network."""
    import torch

    from pointglass.model.network.unet import make_network
    from pointglass.model.network.weights import save_weights

    torch.manual_seed(0)
    save_weights(folder / "fast.safetensors", make_network("fast"), "fast", filtered=True)
    return Seed("weights", "fast", "weights", files_of(folder), "fast.safetensors")


def rooms(folder: Path) -> list[Seed]:
    from rooms import make_room
    from test_rgbd import PLAIN, write_nerfstudio, write_tum

    make_room(folder / "room", face=8, view=(6, 8), views=1)
    write_nerfstudio(folder / "rgbd", PLAIN)
    write_tum(folder / "tum")
    return [
        Seed("rooms", name, kind, files_of(folder / name), "")
        for name, kind in (("room", "room"), ("rgbd", "rgbd"), ("tum", "rgbd"))
    ]


def meshes() -> list[Seed]:
    """A sheet with a picture as glTF in both forms and as OBJ, and a box as STL, in bytes and as text, and as PLY."""
    import io

    import trimesh.creation
    import trimesh.visual
    from PIL import Image
    from untyped import any_typed

    def sheet(**more) -> Any:
        made = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 1, 1)], [(0, 1, 2), (0, 2, 3)], process=False)
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4), (200, 30, 10)), **more)
        made.visual = trimesh.visual.TextureVisuals(uv=[(0, 0), (1, 0), (1, 1), (0, 1)], material=material)
        return trimesh.Scene([made])

    picture = io.BytesIO()
    Image.new("RGB", (4, 4), (200, 30, 10)).save(picture, "PNG")
    obj = (b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 1 1 1 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl a\nf 1/1 2/2 3/3\n"
           b"o other\nf 1 3 4\n")
    box = any_typed(trimesh.creation.box())
    box.visual.vertex_colors = np.arange(32).reshape(8, 4) * 8
    return [
        Seed("mesh", "glb", "mesh", {"a.glb": sheet().export(file_type="glb")}, "a.glb"),
        Seed("mesh", "gltf", "mesh", dict(sheet().export(file_type="gltf")), "model.gltf"),
        Seed("mesh", "obj", "mesh", {"a.obj": obj, "a.mtl": b"newmtl a\nKd 1 0 0\nmap_Kd t.png\n", "t.png": picture.getvalue()},
             "a.obj"),
        Seed("mesh", "stl", "mesh", {"a.stl": box.export(file_type="stl")}, "a.stl"),
        Seed("mesh", "stl text", "mesh", {"a.stl": box.export(file_type="stl_ascii").encode()}, "a.stl"),
        Seed("mesh", "ply", "mesh", {"a.ply": box.export(file_type="ply")}, "a.ply"),
    ]
