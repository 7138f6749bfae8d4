"""Meshes as arguments of `video` and `publish`, by the command line; a comparison that is left out is told."""

import base64
import io

import numpy as np
import pytest
import trimesh
from command_line import run_here
from PIL import Image
from test_publish import EYE, OFFSET, SIZE, room, value_of

from pointglass.viewer.commands.publishing.cube_faces import face_cameras
from pointglass.viewer.commands.publishing.depth_codes import DepthScale, unpacked_depth
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.dates.date_comparison import DateComparison
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.work.cameras.camera_files import write_camera_path
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.viewpoint import Viewpoint

CENTRE, SIDE = np.array([4.6, 1.7, 1.5]), 0.6
"""Of a red box in the room, in front of the eye."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """(scan, mesh)."""
    folder = tmp_path_factory.mktemp("beside")
    box = trimesh.creation.box((SIDE, SIDE, SIDE))
    box.apply_translation(CENTRE + OFFSET)
    box.visual.face_colors = (230, 20, 20, 255)
    box.export(folder / "box.ply")
    return room(folder / "room.laz", 7, 200_000), folder / "box.ply"


def reddish(picture):
    return (picture[..., 0] > 90) & (picture[..., 1] < 0.35 * picture[..., 0]) & (picture[..., 2] < 0.35 * picture[..., 0])


def test_a_film_shows_a_mesh_also_from_workers_and_notices_that_it_changed(place, tmp_path):
    scan, mesh = place
    keys = [from_fov(160, 120, 60, look_at(EYE + OFFSET + (x, 0, 0), CENTRE + OFFSET), f"{x}") for x in (0.0, 0.5)]
    write_camera_path(tmp_path / "path.json", keys, fps=10, seconds=0.3)
    line = ("video", scan, mesh, "--path", tmp_path / "path.json", "--view", "raw", "--out")
    done = run_here(*line, tmp_path / "one")
    assert done.returncode == 0 and "12 triangles" in done.stderr, done.stderr
    frames = sorted((tmp_path / "one").glob("*.png"))
    assert len(frames) == 3 and all(reddish(np.asarray(Image.open(frame), int))[55:65, 75:85].all() for frame in frames)
    shared = run_here(*line, tmp_path / "shared", "--workers", "2")
    assert shared.returncode == 0, shared.stderr
    assert all((tmp_path / "shared" / frame.name).read_bytes() == frame.read_bytes() for frame in frames)
    other = tmp_path / "box.ply"
    trimesh.creation.icosphere(1).export(other)
    refused = run_here("video", scan, other, *line[3:], tmp_path / "one", "--resume")
    assert refused.returncode == 2 and "made with another alterations" in refused.stderr


def test_a_mesh_in_a_publication_has_depth_and_is_not_measured_and_a_comparison_is_said_to_be_left_out(place, tmp_path):
    scan, mesh = place
    view = Viewpoint.of(from_fov(64, 64, 60.0, look_at(EYE + OFFSET, EYE + OFFSET + (1, 0, 0))), "Here")
    project = tmp_path / "with.pointglass"
    write_project(project, Document(scans=(ScanFile(str(scan)),), viewpoints=(view,), meshes=(MeshLayer(str(mesh)),),
                                    comparison=DateComparison(("room.laz", 200_000), ("room.laz", 200_000))))
    line = "publish", project, "--out", tmp_path / "site", "--view", "filled", "--places", "viewpoints"
    refused = run_here(*line)  # its second scan is not open
    assert refused.returncode == 2 and "cannot be shown" in refused.stderr and "--second raw" in refused.stderr
    done = run_here(*line, "--second", "raw")
    assert done.returncode == 0, done.stderr
    assert "comparison" in done.stderr and "not part of this publication" in done.stderr
    check_depth(tmp_path / "site")
    by_argument = run_here("publish", scan, mesh, "--out", tmp_path / "argument", "--view", "filled", "--places", "1")
    assert by_argument.returncode == 0 and "12 triangles" in by_argument.stderr, by_argument.stderr
    pictures = value_of(tmp_path / "argument" / "places" / "000.first.js")["pictures"]
    shown = [np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB"), int) for picture in pictures]
    assert sum(int(reddish(picture).sum()) for picture in shown) > 500


def check_depth(site):
    """The box lies at its true depth, nothing on it is measured, and around it the room is."""
    place = value_of(site / "scene.js")["places"][0]
    codes, measured = unpacked_depth(base64.b64decode(value_of(site / "places" / "000.depth.js")["depth"]), 6, 512)
    depth = DepthScale(place["near"], place["step"]).depths(codes)[0]  # east, where the box is
    camera = face_cameras(EYE, 512)[0]
    column, row = np.meshgrid(np.arange(512) + 0.5, np.arange(512) + 0.5)
    rays = np.stack([(column - 256) / 256, (row - 256) / 256, np.ones_like(row)], -1) @ camera.view_rotation
    near = CENTRE[0] - SIDE / 2 - EYE[0]
    front = EYE + rays / rays[..., :1] * near
    box = (np.abs(front[..., 1:] - CENTRE[1:]) < SIDE / 2 - 0.02).all(axis=-1)
    assert box.sum() > 4000
    assert np.abs(depth[box] - near).max() < 0.005 and not measured[0][box].any()
    wall = (np.abs(front[..., 1:] - CENTRE[1:]) > SIDE / 2 + 0.1).any(axis=-1) & (np.abs(column - 256) < 200)
    assert measured[0][wall].mean() > 0.1 and np.median(depth[wall & measured[0]]) > near + 0.3
    assert SIZE[0] > CENTRE[0]
