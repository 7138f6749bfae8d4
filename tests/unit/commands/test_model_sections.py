"""Meshes in plans and sections: the exact cut against trimesh's, and sheets and drawings as other programs read them."""


import contextlib

import ezdxf
import numpy as np
import pytest
import trimesh
from command_line import run_here, run_in_a_process
from PIL import Image
from test_section import room
from untyped import polylines

from pointglass.viewer.commands.section.cut import along_line, plan
from pointglass.viewer.commands.section.model_lines import MODEL_COLOURS, model_lines
from pointglass.viewer.common.rigid_transform import rigid, rotation_about
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.sheets.mesh_cut import cut_segments, joined_lines, tolerance_of

FAR = np.array([636_000.0, 5_848_000.0, 40.0])


def bumpy(random):
    """A closed mesh: a sphere with random radii; one half split apart, as STL files are."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.vertices *= random.uniform(0.7, 1.3, (len(mesh.vertices), 1))
    faces = np.asarray(mesh.faces)
    half = len(faces) // 2
    apart = np.asarray(mesh.vertices)[faces[half:]].reshape(-1, 3)
    vertices = np.concatenate([mesh.vertices, apart])
    return mesh, vertices, np.concatenate([faces[:half], len(mesh.vertices) + np.arange(3 * half).reshape(-1, 3)])


def test_the_cut_of_random_meshes_is_trimeshs_section_and_closed(seed):
    random = np.random.default_rng(seed)
    for _ in range(5):
        mesh, vertices, faces = bumpy(random)
        depth = random.uniform(-0.8, 0.8)
        lines = joined_lines(cut_segments(vertices, faces, depth), tolerance_of(vertices))
        section = mesh.section(plane_origin=(0, 0, depth), plane_normal=(0, 0, 1))
        assert section is not None
        assert all(line.closed for line in lines) and len(lines) == len(section.entities)
        assert sum(line.length for line in lines) == pytest.approx(section.length, rel=1e-9)
        ours = np.concatenate([line.vertices for line in lines])
        away = np.abs(section.vertices[:, None, :2] - ours[None]).max(axis=2).min(axis=0)
        assert away.max() < 1e-9, "every corner is one of trimesh's"


def test_a_wall_of_many_triangles_is_four_corners_where_vertices_lie_in_the_plane_too():
    mesh = trimesh.creation.box((4.0, 3.0, 2.0))
    for _ in range(4):
        mesh = mesh.subdivide()  # rows of vertices at 0, 0.125, ...
    for depth in (0.0, 0.06, 0.125, 1.0):
        (line,) = joined_lines(cut_segments(np.asarray(mesh.vertices), mesh.faces, depth), tolerance_of(mesh.vertices))
        assert line.closed and np.abs(np.abs(line.vertices) - (2.0, 1.5)).max() < 1e-12 and len(line.vertices) == 4
    assert not joined_lines(cut_segments(np.asarray(mesh.vertices), mesh.faces, -1.0), 1e-9), "nothing lies before it"


def test_clips_and_the_ends_of_a_line_cut_a_mesh_as_they_cut_points(tmp_path):
    trimesh.creation.box((4.0, 3.0, 2.0)).export(tmp_path / "box.obj")
    layer = MeshLayer(str(tmp_path / "box.obj"), transform=rigid(np.eye(3), FAR))
    clip = Box(tuple(FAR + (1.0, 0.0, 0.0)), (1.5, 10.0, 10.0))  # from -0.5 to 2.5
    ((model),) = model_lines([layer], plan(40.3, 0.2), (clip,))
    (line,) = model.lines
    assert not line.closed and line.length == pytest.approx(2.5 + 3.0 + 2.5, abs=1e-8)
    cut = along_line(FAR[:2] + (-1.0, 0.0), FAR[:2] + (5.0, 0.0), 0.2)
    (model,) = model_lines([layer], cut, ())
    (line,) = model.lines
    assert line.length == pytest.approx(3.0 + 2.0 + 3.0, abs=1e-8) and line.vertices[:, 0].min() == pytest.approx(0.0)


@pytest.mark.slow
def test_plans_and_drawings_of_the_command_have_a_turned_box_with_its_own_colour_and_layer(tmp_path, seed):
    xyz = unpack(room(seed, 60_000))[0]
    np.savetxt(tmp_path / "room.xyz", xyz, "%.4f")
    trimesh.creation.box((3.0, 2.0, 1.5)).export(tmp_path / "desk $1.obj")
    turn = rotation_about(np.array((0.0, 0.0, 1.0)), 30.0)
    place = np.array((4.0, 3.0, 1.0))
    hidden = MeshLayer(str(tmp_path / "desk $1.obj"), visible=False)
    layer = MeshLayer(str(tmp_path / "desk $1.obj"), transform=rigid(turn, place))
    document = Document((ScanFile(str(tmp_path / "room.xyz")),), meshes=(hidden, layer))
    write_project(tmp_path / "p.pointglass", document)

    def section(*options, run=run_here):
        with contextlib.chdir(tmp_path):
            done = run("section", *options)
        assert done.returncode == 0, done.stderr
        return done.stdout

    said = section(tmp_path / "p.pointglass", "--plan", "1.2", "--thickness", "0.4", "--trace", "--out", "plan.dxf",
                   run=run_in_a_process)
    assert "1 line of model desk $1.obj, 10 " in said
    drawing = ezdxf.readfile(tmp_path / "plan.dxf")
    assert not drawing.audit().has_errors
    (line,) = polylines(drawing, "POINTGLASS MODEL 1 desk $1.obj")
    corners = (np.array([(x, y) for x, y, *_ in line.get_points()]) - place[:2]) @ turn[:2, :2]
    assert line.closed and len(corners) == 4 and np.abs(np.abs(corners) - (1.5, 1.0)).max() < 1e-9
    blue = np.array([int(MODEL_COLOURS[0][0][at : at + 2], 16) for at in (1, 3, 5)])
    for more in ((), ("--paper", "A4")):
        section(tmp_path / "p.pointglass", "--plan", "1.2", "--no-picture", "--trace", *more, "--out", "plan.png")
        pixels = np.asarray(Image.open(tmp_path / "plan.png").convert("RGB")).astype(int)
        found = (np.abs(pixels - blue).max(axis=2) < 40).sum()
        assert 0.5 < found / (10_000 / 50 / 25.4 * 300 * 4) < 2.5, "lines of 10 m at 1:50, four pixels wide"
    said = section("room.xyz", tmp_path / "desk $1.obj", "--line", "-2,0,8,6", "--out", "section.pdf")
    assert "model desk $1.obj" in said and (tmp_path / "section.pdf").read_bytes()[:4] == b"%PDF"
