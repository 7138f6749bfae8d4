"""Flying, and start viewpoints, without a window."""

import numpy as np
import pytest
from window_session import room

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import look_at
from pointglass.viewer.preprocess.scan_description import ScanSummary
from pointglass.viewer.window.flight.framing import overview
from pointglass.viewer.window.flight.navigation import FlyState, Motion, changed_speed, step, view_along
from pointglass.viewer.window.flight.start_viewpoint import start_camera, survey


@pytest.mark.parametrize("steps", [2, 7, 60])
def test_path_does_not_depend_on_the_frame_rate(steps):
    start = FlyState(np.array([4e5, 5e6, 10.0]), 0.4, -0.2, 3.0, np.array([0.3, -1.0, 0.2]))
    motion = Motion(forward=1, right=-1, fast=True)
    once = step(start, motion, 0.5)
    many = start
    for _ in range(steps):
        many = step(many, motion, 0.5 / steps)
    assert np.allclose(once.position - start.position, many.position - start.position, atol=1e-8)
    assert np.allclose(once.velocity, many.velocity)


def test_pitch_stops_short_of_the_zenith_and_the_camera_stays_level():
    state = FlyState(np.zeros(3))
    for dy in (-1e5, 1e5):
        state = step(state, Motion(look=(37.0, dy)), 0.01)
        matrix = state.camera_to_world
        assert abs(state.pitch) < np.pi / 2 and abs(matrix[2, 0]) < 1e-12
        assert np.allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3)) and np.linalg.det(matrix[:3, :3]) > 0


def test_looking_agrees_with_look_at():
    direction = np.array([1.0, -2.0, 0.5])
    assert np.allclose(view_along([1, 2, 3], direction, 1.0).camera_to_world, look_at([1, 2, 3], direction + [1, 2, 3]))


def test_released_keys_come_to_rest():
    state = step(FlyState(np.zeros(3)), Motion(forward=1), 1.0)
    assert state.moving
    for _ in range(200):
        state = step(state, Motion(), 1 / 60)
    assert not state.moving


def test_wheel_stays_within_the_limits():
    state = FlyState(np.zeros(3), speed=1.0)
    assert changed_speed(changed_speed(state, 3, (0.1, 9)), -3, (0.1, 9)).speed == pytest.approx(1.0)
    assert changed_speed(state, 99, (0.1, 9)).speed == 9 and changed_speed(state, -99, (0.1, 9)).speed == 0.1


@pytest.mark.parametrize(("metre", "offset"), [(1.0, (0, 0, 0)), (3.28084, (6e5, 8e5, 400)), (1000.0, (-5e3, 0, 0))])
def test_a_visit_to_a_room_starts_inside_at_eye_height(metre, offset):
    camera = start_camera(room(metre=metre, offset=offset), 640, 400)
    place = (camera.position - offset) / metre
    assert (place[:2] > 0.3).all() and (place[:2] < [7.7, 5.7]).all() and 1.3 < place[2] < 1.9
    assert abs(camera.forward[2]) < 0.2


def test_a_visit_starts_at_a_scanner_where_there_is_one():
    scans = [ScanSummary("a", 10, (1, 1, 1.5)), ScanSummary("b", 900, (5, 4, 1.4))]
    assert np.allclose(start_camera(room(scans=scans), 640, 400).position, [5, 4, 1.4])
    far = [ScanSummary("a", 10, (9e5, 0, 0))]
    assert start_camera(room(scans=far), 640, 400).position[0] < 10


@pytest.mark.parametrize("points", [1, 2, 50])
def test_the_smallest_scenes_have_a_start(points):
    rng = np.random.default_rng(2)
    for xyz in (rng.random((points, 3)), np.ones((points, 3)) * 7.0):
        scene = scene_from_arrays(xyz, np.full((points, 3), 200, np.uint8))
        camera = start_camera(scene, 640, 400)
        seen = camera.world_to_camera @ [*xyz[0], 1.0]
        assert -seen[2] > 0 and np.isfinite(camera.camera_to_world).all()


def test_overview_has_everything_in_the_picture():
    scene = room()
    for direction in ([1, 0, 0], [0.3, 0.4, -0.8], [-1, 2, 0.1]):
        seen = survey(scene)
        state = overview(seen, 1.6, np.array(direction, float), 1.0)
        corners = seen.low + np.indices((2, 2, 2)).reshape(3, 8).T * (seen.high - seen.low)
        view = (corners - state.position) @ state.camera_to_world[:3, :3]
        depth, tall = -view[:, 2], np.tan(np.radians(30))
        assert (depth > 0).all()
        assert (np.abs(view[:, 0]) <= 1.6 * tall * depth).all() and (np.abs(view[:, 1]) <= tall * depth).all()
