"""Meshes in pictures: the shader against its reference, what they hide and what hides them, and pictures drawn again."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pointglass
from pointglass.viewer import cli
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.readers.meshes.mesh_store import mesh_of
from pointglass.viewer.render.described_picture import Composer, render
from pointglass.viewer.render.meshes.mesh_layers import composed
from pointglass.viewer.render.meshes.mesh_pass import view_depth
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.work.cameras.camera_files import write_camera_path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))

CAMERA = from_fov(120, 90, 60, look_at((0.0, -4.0, 0.0), (0.0, 0.0, 0.0)))
RED = (230, 40, 40, 255)


@pytest.fixture
def wall(tmp_path):
    """A green wall of points in the plane y = 0, and boxes before it (y = -2, left) and behind it (y = 2, right)."""
    x, z = np.meshgrid(np.linspace(-3, 3, 500), np.linspace(-3, 3, 500))
    rows = np.column_stack([x.ravel(), np.zeros(x.size), z.ravel(), np.tile((30, 170, 60), (x.size, 1))])
    np.savetxt(tmp_path / "wall.xyz", rows, "%.4f %.4f %.4f %d %d %d")
    for name, centre in (("before", (-0.6, -2, 0)), ("behind", (0.6, 2, 0))):
        box = trimesh.creation.box((0.8, 0.8, 0.8))
        box.apply_translation(centre)
        box.visual.face_colors = RED
        box.export(tmp_path / f"{name}.ply")
    write_camera_path(tmp_path / "cameras.json", [CAMERA])
    return tmp_path


@pytest.mark.parametrize("view", ["raw", "filtered", "filled"])
@pytest.mark.parametrize("opacity, point_size", [(1.0, 1), (0.4, 1), (1.0, 3)])
def test_the_picture_is_that_of_the_reference_to_the_byte(context, wall, view, opacity, point_size):
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.look import Look, enlarged

    scene = open_scene([wall / "wall.xyz"], cache=False)
    layers = (MeshLayer(str(wall / "before.ply"), opacity=opacity), MeshLayer(str(wall / "behind.ply")))
    edits = Edits(meshes=layers, clips=(Box((0.0, 0.0, 0.0), (3.0, 3.0, 0.3)),), look=Look(point_size=point_size))
    spec = PictureSpec(CAMERA, Settings(view=view), edits=edits)
    renderer, composer = Renderer(context, scene), Composer(context)
    try:
        frame = render(renderer, spec)
        made, plain = composer.images(frame, spec)[0], frame.image(view)
        depth, mask = view_depth(frame, view)
        z = np.frombuffer(depth.read(alignment=1), np.float32).reshape(90, 120)
        z = z if mask is None else np.where(frame.mask(), z, np.float32(np.inf))
        if point_size > 1 and view != "filled":
            plain, z = enlarged(plain, z, point_size)
        layers_made = composer.meshes(frame).layers
        assert layers_made is not None and np.isfinite(np.minimum(layers_made.opaque_depth, layers_made.clear_depth)).any()
        assert np.array_equal(made, composed(plain, z, layers_made))
    finally:
        composer.release()
        renderer.release()


def test_points_hide_a_mesh_and_a_mesh_hides_points(wall):
    with pointglass.open(wall / "wall.xyz", wall / "before.ply", wall / "behind.ply", cache=False) as scan:
        assert len(scan.meshes) == 2
        for view in ("raw", "filtered", "filled"):
            frame = scan.render(CAMERA, view=view, full=True)
            image, model = np.asarray(frame.image).astype(int), frame.provenance == 5
            assert (image[..., 0] > image[..., 1])[model].all()
            columns = np.flatnonzero(model.sum(axis=0) > 3)
            assert model.sum() > 300 and columns.max() < 60, view  # the left half alone: the wall hides the other
        scan.remove_mesh(wall / "before.ply")
        behind = scan.render(CAMERA, view="filled", full=True)
        assert not (behind.provenance == 5).any()
        scan.remove_mesh()
        assert np.array_equal(scan.render(CAMERA, view="filled"), behind.image)


def test_a_picture_with_a_mesh_is_drawn_again_to_the_byte(wall, capsys):
    scan, mesh, out = str(wall / "wall.xyz"), wall / "before.ply", wall / "a"
    assert cli.main(["render", scan, str(mesh), "--cameras", str(wall / "cameras.json"), "--size", "120x90", "--view", "filled",
                     "--aux", "--out", str(out), "--no-cache"]) == 0
    assert "12 triangles" in capsys.readouterr().err
    (made,) = (path for path in out.glob("*.png") if "provenance" not in path.name)
    assert str(wall) not in made.read_bytes().decode("latin-1")  # a picture names no folder
    again = ["render", scan, "--like", str(made), "--no-cache", "--out"]
    assert cli.main([*again, str(wall / "b")]) == 0
    assert (wall / "b" / made.name).read_bytes() == made.read_bytes()
    elsewhere = wall / "sub"
    elsewhere.mkdir()
    mesh.rename(elsewhere / mesh.name)
    capsys.readouterr()
    assert cli.main([*again, str(wall / "c")]) == 2
    said = capsys.readouterr().err
    assert "before.ply" in said and said.count("\n") == 1
    assert cli.main(["render", scan, str(elsewhere / mesh.name), *again[2:], str(wall / "c")]) == 0
    assert (wall / "c" / made.name).read_bytes() == made.read_bytes()
    trimesh.creation.icosphere(1).export(elsewhere / mesh.name)
    capsys.readouterr()
    assert cli.main(["render", scan, str(elsewhere / mesh.name), *again[2:], str(wall / "d")]) == 0
    assert "before.ply has changed since" in capsys.readouterr().err


def test_a_mesh_is_read_once_and_again_when_its_file_changes(wall):
    first = mesh_of(str(wall / "before.ply"))
    assert mesh_of(str(wall / "before.ply")) is first
    trimesh.creation.icosphere(1).export(wall / "before.ply")
    assert len(mesh_of(str(wall / "before.ply")).faces) == 80
