"""Places on meshes: where rays meet triangles, through transformations and clips, and what is in front."""

import numpy as np
import pytest
import trimesh

from pointglass.viewer.common.rigid_transform import rigid, rotation_about
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.readers.meshes.mesh_data import mesh_data
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.values import evaluate
from pointglass.viewer.work.meshes.pick_mesh import pick_mesh

FAR = np.array([500_000.0, 5_400_000.0, 300.0])


@pytest.mark.parametrize("orthographic", [None, 6.0])
def test_a_pick_lies_on_the_surface_of_the_mesh_that_is_seen(seed, orthographic):
    random = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(4)
    mesh = mesh_data(ball.vertices, ball.faces)
    place = rigid(rotation_about(random.normal(size=3), 70.0), FAR)
    near, far = (MeshLayer(name, transform=place, up="y", scale=scale) for name, scale in (("a", 2.0), ("b", 0.5)))
    pose = look_at(FAR + [0, -6, 1], FAR)
    camera = from_fov(200, 150, 60, pose)
    if orthographic:
        camera = type(camera)(200, 150, camera.fx, camera.fy, 100, 75, pose, orthographic=orthographic)
    at = tuple(random.uniform((94, 69), (106, 81)))
    picked, depth = pick_mesh((far, near), (), camera, at, lambda path: mesh)
    place = np.array(picked.position)
    assert 1.99 < np.linalg.norm(place - FAR) <= 2.0 + 1e-6 and picked.station == "model a" and picked.exact
    pixel, seen = camera.project([place])
    assert np.abs(pixel[0] - at).max() < 1e-4 and seen[0] == pytest.approx(depth, abs=1e-6)
    clip = Box(tuple(FAR), (0.6, 0.6, 0.6))
    cut, _ = pick_mesh((far, near), (clip,), camera, at, lambda path: mesh)
    assert cut.station == "model b" and 0.49 < np.linalg.norm(np.array(cut.position) - FAR) <= 0.5 + 1e-6
    assert pick_mesh((near,), (), camera, (0.5, 0.5), lambda path: mesh) is None


def test_a_distance_to_a_model_has_the_uncertainty_of_its_measured_end():
    scan = MeasuredPoint((0.0, 0.0, 0.0), 0.01, 0.002, "scan")
    model = MeasuredPoint((3.0, 0.0, 0.0), scan="model box.glb")
    one, two = (evaluate(Measurement("distance", (scan, end))) for end in (model, MeasuredPoint((3.0, 0.0, 0.0), 0.01, 0.002)))
    assert one.value == pytest.approx(3.0) and 0 < one.uncertainty < two.uncertainty
