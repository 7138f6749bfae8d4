"""``pointglass align MODEL SCAN``: a model of the swept room comes to the place where the scan was measured."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from cloud_files import write_ply
from command_line import run_here
from swept_room import PLACES, sweep
from test_align import pairs_file

from pointglass.viewer.common.rigid_transform import inverse, moved_points, rigid, rotation_about
from pointglass.viewer.readers.meshes.mesh_store import mesh_of
from pointglass.viewer.work.comparing.compared_model import placed_vertices
from pointglass.viewer.work.project import read_project


def room_model(points):
    """The box of the room that :func:`sweep` measures, its walls seen from inside."""
    low, high = points.min(axis=0), points.max(axis=0)
    box = trimesh.creation.box(high - low)
    box.apply_translation((low + high) / 2)
    box.invert()
    return box


@pytest.mark.slow
def test_a_model_is_aligned_by_pairs_and_by_its_triangles_and_the_project_shows_it_there(tmp_path, seed):
    random = np.random.default_rng(seed)
    points = sweep(PLACES[0], seed, noise=0.0)
    box = room_model(points)
    points = points + random.normal(0, 0.002, points.shape)
    truth = rigid(rotation_about(random.normal(size=3), random.uniform(-180, 180)), random.uniform(-500, 500, 3))
    scan = write_ply(tmp_path / "scan.ply", points, np.full((len(points), 3), 128, np.uint8))
    inner = np.asarray(box.vertices)
    trimesh.Trimesh(moved_points(inverse(truth), inner), box.faces, process=False).export(tmp_path / "room.obj", digits=12)
    pairs = pairs_file(tmp_path / "pairs.csv", truth, random, 0.02)
    out = tmp_path / "p.pointglass"
    command = [sys.executable, "-m", "pointglass.viewer", "align", tmp_path / "room.obj", scan, "--pairs", pairs, "--out", out]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "4 pairs, rms 0." in done.stdout and "points lie 0.00" in done.stdout
    document = read_project(out)
    (layer,) = document.meshes
    placed = placed_vertices(layer, mesh_of(layer.path))
    away = np.linalg.norm(np.sort(placed, axis=0) - np.sort(inner, axis=0), axis=1)
    assert away.max() < 0.001, "half of the noise, at corners 3 m away"
    assert len(document.scans) == 1
    refused = run_here("align", scan, tmp_path / "room.obj")
    assert refused.returncode == 2 and "give the mesh first" in refused.stderr
