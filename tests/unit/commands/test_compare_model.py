"""``pointglass compare SCAN MODEL``: signed distances of points from a box whose distance field is known."""

import numpy as np
import pytest
import trimesh
from untyped import read_las

from pointglass.viewer.cli import main
from pointglass.viewer.common.rigid_transform import rigid, rotation_about
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.work.comparing.model_distances import distances_from_model
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project

FAR = np.array([500_000.0, 5_400_000.0, 300.0])
HALF = np.array([2.0, 1.5, 1.0])


def field(places):
    """Signed distance from the box around the origin."""
    outside = np.abs(places) - HALF
    return np.linalg.norm(np.maximum(outside, 0), axis=1) + np.minimum(outside.max(axis=1), 0)


def on_box(random, count):
    """Points on its surface, with the normal of the side of each."""
    places = random.uniform(-1, 1, (count, 3)) * HALF
    side, axis = random.choice([-1.0, 1.0], count), random.integers(0, 3, count)
    places[np.arange(count), axis] = side * HALF[axis]
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = side
    return places, normals


def test_distances_are_those_of_the_distance_field(seed):
    random = np.random.default_rng(seed)
    places, _ = on_box(random, 20_000)
    places += random.uniform(-0.05, 0.05, places.shape)
    box = trimesh.creation.box(2 * HALF)
    found = distances_from_model(box.vertices + FAR, np.asarray(box.faces), places + FAR)
    assert found.distance == pytest.approx(field(places), abs=2e-7)


def test_far_beside_an_edge_the_sign_is_that_of_the_field(seed):
    """Two faces are equally near in float32, of which one looks the other way."""
    random = np.random.default_rng(seed)
    places, normals = on_box(random, 20_000)
    edge = (np.argmax(np.abs(normals), axis=1) + random.integers(1, 3, len(places))) % 3
    rows = np.arange(len(places))
    places[rows, edge] = np.sign(places[rows, edge]) * (HALF[edge] - random.uniform(0, 0.002, len(places)))
    places += normals * random.uniform(1, 20, (len(places), 1))
    box, turn = trimesh.creation.box(2 * HALF), rotation_about(np.array((0.0, 0.0, 1.0)), random.uniform(0, 90))
    found = distances_from_model(box.vertices @ turn.T + FAR, np.asarray(box.faces), places @ turn.T + FAR)
    assert found.distance == pytest.approx(field(places), abs=1e-5)  # float32 of 20 m chooses the face


def test_the_command_finds_a_shift_of_three_millimetres_and_says_how_sure_it_is(tmp_path, seed, capsys):
    random = np.random.default_rng(seed)
    places, normals = on_box(random, 60_000)
    places += normals * 0.003 + random.normal(0, 0.002, (len(places), 1)) * normals
    turn = rotation_about(np.array((0.0, 0.0, 1.0)), 20.0)
    np.savetxt(tmp_path / "scan.xyz", places @ turn.T + FAR, "%.5f")
    trimesh.creation.box(2 * HALF).export(tmp_path / "box.obj")
    scan, model, out = tmp_path / "scan.xyz", tmp_path / "box.obj", tmp_path / "out"
    document = Document((ScanFile(str(scan)),), meshes=(MeshLayer(str(model), transform=rigid(turn, FAR)),))
    write_project(tmp_path / "p.pointglass", document)
    assert main(["compare", str(scan), str(model), "--project", str(tmp_path / "p.pointglass"), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "outside the model" in said
    points = read_las(out / "distances.laz")
    distance, unsure = np.array(points["distance"]), np.array(points["uncertainty"])
    middle = (np.abs(np.column_stack([points.x, points.y, points.z]) - FAR) @ np.abs(turn) < 10).all(axis=1)
    assert len(distance) == len(places) and np.median(distance) == pytest.approx(0.003, abs=1e-4)
    assert 0.93 < (np.abs(distance - 0.003) < unsure)[middle].mean() < 0.97
    far = places + normals * random.choice((0.003, 4.0), (len(places), 1), p=(0.9, 0.1))
    np.savetxt(scan, far @ turn.T + FAR, "%.5f")
    assert main(["compare", str(scan), str(model), "--project", str(tmp_path / "p.pointglass"), "--out", str(out)]) == 0
    assert "without a counterpart within" in capsys.readouterr().out
    table = (out / "distances.csv").read_text("utf-8-sig")
    assert ",before,,,box.obj," in table and ",after,,,scan.xyz," in table  # no folders of this machine
    near = np.array(read_las(out / "distances.laz")["distance"])
    assert np.isnan(near).mean() == pytest.approx(0.1, abs=0.01)
    more = ["--project", str(tmp_path / "p.pointglass"), "--range", "5", "--out", str(out)]
    assert main(["compare", str(scan), str(model), *more]) == 0
    reached = np.array(read_las(out / "distances.laz")["distance"])
    assert np.isfinite(reached).all() and 3.99 < reached[np.isnan(near)].min() < reached.max() < 4.02
    assert main(["compare", str(model), str(model), "--out", str(out)]) == 2
    assert main(["compare", str(scan), str(model), "--out", str(out)]) == 2  # without the project they lie far apart
    assert capsys.readouterr().err.strip().endswith("up axis")
