"""``pointglass export --meshes``: meshes at their places, as trimesh and Open3D read them; points stay points."""


import contextlib

import laspy
import numpy as np
import open3d as o3d
import pytest
import trimesh
from cloud_files import write_las
from command_line import run_here
from PIL import Image
from untyped import any_typed

from pointglass.viewer.common.rigid_transform import moved_points, rigid, rotation_about
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project

FAR = np.array([500_000.0, 5_400_000.0, 300.0])


def export(folder, *options, code=0):
    with contextlib.chdir(folder):
        done = run_here("export", *options)
    assert done.returncode == code, done.stderr
    return done


@pytest.fixture
def project(tmp_path, seed):
    """Points far from zero, a red box turned beside them, a picture on a sheet, and a mesh that is not shown; the corners."""
    random = np.random.default_rng(seed)
    write_las(tmp_path / "scan.las", FAR + random.uniform(0, 4, (500, 3)))
    box = trimesh.creation.box((2.0, 1.0, 0.5))
    box.export(tmp_path / "box.obj")
    picture = Image.fromarray(np.kron([[[250, 10, 10], [10, 250, 10]]], np.ones((8, 4, 1))).astype(np.uint8))
    sheet = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], process=False)
    material = any_typed(trimesh).visual.material.PBRMaterial(baseColorTexture=picture)
    sheet.visual = any_typed(trimesh).visual.TextureVisuals(uv=[(0, 0), (1, 0), (1, 1), (0, 1)], material=material)
    sheet.export(tmp_path / "sheet.glb")
    place = rigid(rotation_about(random.normal(size=3), 50.0), FAR + random.uniform(0, 3, 3))
    layers = (MeshLayer(str(tmp_path / "box.obj"), transform=place, colour=(255, 0, 0), opacity=0.5),
              MeshLayer(str(tmp_path / "sheet.glb"), up="y", transform=rigid(np.eye(3), FAR)),
              MeshLayer(str(tmp_path / "box.obj"), visible=False))
    write_project(tmp_path / "p.pointglass", Document((ScanFile(str(tmp_path / "scan.las")),), meshes=layers))
    corners = moved_points(place, np.asarray(box.vertices))
    flat = FAR + np.array([(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)])
    return tmp_path, corners, flat


def same_places(one, other, within):
    away = np.linalg.norm(np.asarray(one)[:, None] - np.asarray(other)[None], axis=2)
    return away.min(axis=0).max() < within and away.min(axis=1).max() < within


def test_meshes_come_back_at_their_places_from_every_format(project):
    folder, corners, flat = project
    said = export(folder, "p.pointglass", "--meshes", "--out", "out.glb").stdout
    assert "14 triangles" in said
    scene = trimesh.load_scene(folder / "out.glb")
    assert set(scene.geometry) == {"box", "sheet"}
    world = {}
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        x, y, z = trimesh.transform_points(scene.geometry[name].vertices, matrix).T
        world[name] = np.column_stack([x, -z, y])  # y is up in a glTF
    assert same_places(world["box"], corners, 1e-5) and same_places(world["sheet"], flat, 1e-5)
    material = scene.geometry["box"].visual.material
    assert material.baseColorFactor.tolist() == [255, 0, 0, 128] and material.alphaMode == "BLEND"
    pixels = np.asarray(scene.geometry["sheet"].visual.material.baseColorTexture.convert("RGB")).astype(int)
    assert pixels.shape == (8, 8, 3) and np.abs(pixels[:, :4] - (250, 10, 10)).max() < 2, "the picture, left half red"
    assert scene.geometry["sheet"].visual.uv.shape == (4, 2)
    done = export(folder, "p.pointglass", "--meshes", "--out", "out.ply")
    assert "pictures on sheet.glb" in done.stderr
    read = o3d.io.read_triangle_mesh(folder / "out.ply")
    assert same_places(read.vertices, np.concatenate([corners, flat]), 1e-8) and len(read.triangles) == 14
    assert (np.asarray(read.vertex_colors)[:8] == (1, 0, 0)).all()
    export(folder, "p.pointglass", "--meshes", "--out", "out.obj")
    mesh = trimesh.load_mesh(folder / "out.obj", process=False)
    assert same_places(mesh.vertices, np.concatenate([corners, flat]), 1e-8) and len(mesh.faces) == 14


def test_points_are_exported_without_meshes_which_a_line_says_and_options_of_points_are_refused(project):
    folder, _, _ = project
    done = export(folder, "p.pointglass", "--out", "points.las")
    assert len(laspy.read(folder / "points.las").points) == 500 and "--meshes writes them" in done.stderr
    for options, words in ((("--clip", "0,0,0,1,1,1", "--out", "x.glb"), "--clip: is for points"),
                           (("--out", "x.stl"), ".glb, .obj, .ply"), (("--out", "box.obj"), "is a mesh that is read")):
        done = export(folder, "p.pointglass", "--meshes", *options, code=2)
        assert words in done.stderr and len(done.stderr.strip().splitlines()) == 1
    done = export(folder, "scan.las", "--meshes", "--out", "x.glb", code=2)
    assert "no mesh is beside the scan" in done.stderr and not (folder / "x.glb").exists()
