"""Mesh files: each format's triangles against those written by trimesh, and files that are damaged or reach elsewhere."""

import json
import struct

import numpy as np
import pytest
import trimesh
from PIL import Image

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.readers.meshes.mesh_data import mesh_data
from pointglass.viewer.readers.meshes.mesh_file import read_mesh
from pointglass.viewer.readers.meshes.mesh_formats import scans_and_meshes


def area(mesh):
    corners = mesh.vertices[mesh.faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2


@pytest.mark.parametrize("name", ["m.glb", "m.gltf", "m.obj", "m.stl", "m.ply"])
def test_each_format_gives_the_triangles_at_their_places(tmp_path, name, seed):
    random = np.random.default_rng(seed)
    box, ball = trimesh.creation.box((2, 1, 3)), trimesh.creation.icosphere(2)
    ball.apply_translation(random.uniform(2, 4, 3))
    if name.endswith("gltf"):
        for file, data in trimesh.Scene([box, ball]).export(file_type="gltf").items():
            (tmp_path / (name if file == "model.gltf" else file)).write_bytes(data)
    elif name == "m.glb":
        trimesh.Scene([box, ball]).export(tmp_path / name)
    else:
        trimesh.util.concatenate([box, ball]).export(tmp_path / name)
    mesh = read_mesh(tmp_path / name)
    assert len(mesh.faces) == 12 + len(ball.faces)
    assert area(mesh) == pytest.approx(box.area + ball.area, rel=1e-5)
    assert mesh.bounds[1] == pytest.approx(np.maximum(box.bounds[1], ball.bounds[1]), abs=1e-5)
    assert np.linalg.norm(mesh.normals, axis=2) == pytest.approx(1.0, abs=1e-5)


def test_a_pipe_is_smooth_and_an_edge_is_sharp():
    pipe, box = trimesh.creation.cylinder(1.0, 4.0, sections=12), trimesh.creation.box()
    mesh = mesh_data(pipe.vertices, pipe.faces)
    outwards = pipe.vertices[pipe.faces] * (1, 1, 0)
    cap = np.abs(pipe.face_normals[:, 2]) > 0.5
    assert mesh.normals[cap] == pytest.approx(np.repeat(pipe.face_normals[cap][:, None], 3, axis=1), abs=1e-6)
    assert mesh.normals[~cap] == pytest.approx(outwards[~cap] / np.linalg.norm(outwards[~cap], axis=2, keepdims=True), abs=0.07)
    sharp = mesh_data(box.vertices, box.faces)
    assert sharp.normals == pytest.approx(np.repeat(box.face_normals[:, None], 3, axis=1), abs=1e-6)


def test_coordinates_of_an_obj_far_from_zero_keep_every_digit(tmp_path):
    (tmp_path / "m.obj").write_text("v 500000.1234 5400000.5678 312.0001\nv 500001.1234 5400000.5678 312\n"
                                    "v 500000.1234 5400001.5678 312\nf 1 2 3\n")
    assert read_mesh(tmp_path / "m.obj").vertices[0].tolist() == [500000.1234, 5400000.5678, 312.0001]


def test_colours_and_pictures_of_materials_are_kept(tmp_path):
    Image.fromarray(np.full((8, 8, 3), (10, 200, 30), np.uint8)).save(tmp_path / "t.png")
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nmap_Kd t.png\n")
    (tmp_path / "m.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
                                    "usemtl a\nf 1 2 3\nusemtl b\nf 1/1 2/2 4/3\n")
    mesh = read_mesh(tmp_path / "m.obj")
    plain, pictured = (mesh.textures.of_face == -1), (mesh.textures.of_face == 0)
    assert plain.sum() == pictured.sum() == 1
    assert (mesh.rgb[mesh.faces[plain]] == (255, 0, 0)).all()
    assert (mesh.textures.texels == (10, 200, 30)).all() and len(mesh.textures.levels[0]) == 4


def test_pictures_that_are_neither_jpeg_nor_png_are_not_decoded(tmp_path):
    Image.fromarray(np.full((8, 8, 3), (10, 200, 30), np.uint8)).save(tmp_path / "t.bmp")
    (tmp_path / "m.mtl").write_text("newmtl b\nKd 0 0 1\nmap_Kd t.bmp\n")
    (tmp_path / "m.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 1\n"
                                    "vt 0 0\nvt 1 0\nvt 0 1\nusemtl b\nf 1/1 2/2 3/3\n")
    assert len(read_mesh(tmp_path / "m.obj").textures.texels) == 0


def test_only_files_in_the_mesh_s_own_folder_are_read(tmp_path):
    inside = tmp_path / "in"
    inside.mkdir()
    files = trimesh.Scene([trimesh.creation.box()]).export(file_type="gltf")
    for file, data in files.items():
        (inside / file).write_bytes(data)
    model = json.loads((inside / "model.gltf").read_text())
    buffer = model["buffers"][0]["uri"]
    (inside / buffer).rename(tmp_path / "secret.bin")
    for uri in ("../secret.bin", str(tmp_path / "secret.bin")):
        model["buffers"][0]["uri"] = uri
        (inside / "model.gltf").write_text(json.dumps(model))
        with pytest.raises(InputError, match="leads out of this folder"):
            read_mesh(inside / "model.gltf")


def glb(content: dict, data: bytes = b"") -> bytes:
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


LOOP = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"children": [1]}, {"children": [0]}]}
HUGE = {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 12}], "bufferViews": [{"buffer": 0, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 1 << 40, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}], "scene": 0}
DAMAGED = {
    "empty.obj": b"# nothing\n",
    "lines.obj": b"v 0 0 0\nv 1 0 0\nl 1 2\n", "index.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "nan.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "cut.stl": b"\0" * 80 + struct.pack("<I", 1000) + b"\0" * 70,
    "text.stl": b"solid x\nfacet normal 0 0 z\n", "noise.glb": bytes(range(256)) * 4, "loop.glb": glb(LOOP),
    "huge.glb": glb(HUGE, bytes(12)), "none.glb": glb({"asset": {"version": "2.0"}}),
    "huge.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\n"
                b"property float z\nelement face 5\nproperty list uchar int vertex_indices\nend_header\n" + bytes(100),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_mesh_is_one_line(tmp_path, name):
    (tmp_path / name).write_bytes(DAMAGED[name])
    with pytest.raises(InputError) as told:
        read_mesh(tmp_path / name)
    assert "\n" not in str(told.value) and name in str(told.value)


def test_what_is_wrong_with_a_file_is_said_with_the_value_in_our_words(tmp_path):
    good = trimesh.creation.box().export(file_type="glb")
    cases = {
        "noise.glb": (b"PK\3\4" + good[4:], "begins with 'PK"), "head.glb": (good[:15], "15 bytes do not hold the head"),
        "cut.glb": (good[:-30], f"has {len(good) - 30:,}: it is cut"),
        "old.glb": (good[:4] + struct.pack("<I", 1) + good[8:], "GLB of version 1"),
        "text.glb": (good[:20] + b"%" + good[21:], "no JSON at byte 0"), "other.gltf": (b'{"scans": []}', 'has no "asset"'),
        "one.gltf": (b'{"asset": {"version": "1.0"}}', "version '1.0'"),
        "cut.stl": (bytes(80) + struct.pack("<I", 1000) + bytes(70), "154 bytes do not hold the 1,000 triangles"),
        "lost.glb": (glb({"asset": {"version": "2.0"}, "scenes": [{"nodes": [7]}], "scene": 0}), "points at something"),
    }  # fmt: skip
    for name, (data, words) in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError) as told:
            read_mesh(tmp_path / name)
        assert words in str(told.value) and str(told.value).startswith(f"{tmp_path / name}: "), name


def test_a_ply_with_faces_is_a_mesh_beside_a_scan_and_the_scan_where_it_is_alone(tmp_path):
    trimesh.creation.box().export(tmp_path / "b.ply")
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "p.ply")
    box, points, model = tmp_path / "b.ply", tmp_path / "p.ply", tmp_path / "m.glb"
    assert scans_and_meshes([points, box, model]) == ([points], [box, model])
    assert scans_and_meshes([box]) == ([box], [])
    assert scans_and_meshes([box, model]) == ([box], [model])
