"""Which way is up: the offer to turn a scan upright, and flying in a world whose up is not z."""

import numpy as np
import pytest
from window_session import room

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.edits import UP_AXES
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.window.flight.flight import Flight
from pointglass.viewer.window.flight.navigation import Motion, step, view_along
from pointglass.viewer.window.flight.start_viewpoint import brightening, darkness, lying, start_state, survey
from pointglass.viewer.window.kit.notices import Brighten, CallUp
from pointglass.viewer.work.places.up_axis import Z_UP, turned, upright_axes


def _room(size, rng, count=60_000):
    """Points on the walls, floor and ceiling of a box of ``size`` metres, by area, with furniture on the floor."""
    size = np.asarray(size, float)
    areas = np.repeat([size[1] * size[2], size[0] * size[2], size[0] * size[1]], 2)
    wall = rng.choice(6, count, p=areas / areas.sum())
    xyz = rng.random((count, 3)) * size
    xyz[np.arange(count), wall // 2] = (wall % 2) * size[wall // 2]
    table = rng.random((count // 10, 3)) * (1.5, 1.0, 0.7) + size * (0.3, 0.3, 0.0)
    return np.concatenate([xyz, table])


def _scene(xyz):
    return scene_from_arrays(xyz, np.full((len(xyz), 3), 130, np.uint8), meta=ScanDescription(metres_per_unit=1.0), noise=False)


@pytest.mark.parametrize("up", list(UP_AXES.values()))
def test_upright_axes_are_a_rotation_that_ends_in_up(up):
    axes = upright_axes(up)
    assert np.allclose(axes[:, 2], up) and np.allclose(axes.T @ axes, np.eye(3)) and np.linalg.det(axes) > 0


def test_a_room_lying_on_its_side_is_offered_its_up_axis_and_an_upright_one_is_not(seed):
    rng = np.random.default_rng(seed)
    for size in ((8, 6, 3), (12, 15, 3.5), (6, 9, 2.6)):
        xyz = _room(size, rng)
        lies = lying(survey(_scene(xyz @ upright_axes(UP_AXES["y"]).T)), Z_UP)
        assert lies is not None and lies.offer in (CallUp("y"), CallUp("-y"))
        assert lying(survey(_scene(xyz)), Z_UP) is None
        assert lying(survey(_scene(xyz[:, [1, 0, 2]])), Z_UP) is None


def test_what_only_looks_like_a_floor_is_not_offered(seed):
    rng = np.random.default_rng(seed)
    corridor = _room((20, 1.6, 2.8), rng)
    facade = rng.random((40_000, 3)) * (20.0, 0.2, 9.0)
    tower = _room((4, 4, 18), rng)
    ball = rng.normal(size=(40_000, 3))
    for xyz in (corridor, facade, tower, ball / np.linalg.norm(ball, axis=1, keepdims=True)):
        assert lying(survey(_scene(xyz)), Z_UP) is None
    scene = _scene(_room((8, 6, 3), rng) @ upright_axes(UP_AXES["y"]).T)
    assert lying(survey(scene), UP_AXES["y"]) is None, "a person has already turned it"


@pytest.mark.parametrize("name", ["y", "-y", "x", "-z"])
def test_a_visit_to_a_turned_room_is_the_turned_visit(name):
    """Start, flight and overview in a room that was turned are those in the room itself, turned."""
    axes = upright_axes(UP_AXES[name])
    level = room()
    points, rgb, _, _ = unpack(level, slice(None))
    scene = scene_from_arrays(points @ axes.T, rgb, meta=ScanDescription(metres_per_unit=1.0), noise=False)
    seen = survey(scene)
    state = start_state(scene, seen, 1.6, UP_AXES[name])
    inside = axes.T @ state.position
    assert (inside[:2] > 0.3).all() and (inside[:2] < [7.7, 5.7]).all() and 1.2 < inside[2] < 2.0
    assert abs(state.right @ np.array(UP_AXES[name])) < 1e-12 and abs(state.forward @ np.array(UP_AXES[name])) < 0.2
    for motion in (Motion(forward=1, right=-1), Motion(up=1, look=(40.0, -12.0))):
        flat = step(view_along(inside, axes.T @ state.forward, state.speed), motion, 0.4)
        assert np.allclose(axes @ flat.position, step(state, motion, 0.4).position, atol=1e-9)
    flight = Flight(lambda: 0.0)
    flight.begin(state, seen)
    flight.step_back(1.6)
    local = turned(seen, axes)
    view = (np.array([local.low, local.high]) @ axes.T - flight.state.position) @ flight.state.camera_to_world[:3, :3]
    assert (view[:, 2] < 0).all(), "everything lies ahead"


def test_calling_another_direction_up_levels_the_camera_and_keeps_the_direction():
    scene = room()
    flight = Flight(lambda: 0.0)
    flight.begin(start_state(scene, survey(scene), 1.6), survey(scene))
    ahead = flight.state.forward
    assert not flight.set_up(Z_UP) and flight.set_up(UP_AXES["y"]) and not flight.set_up(UP_AXES["y"])
    assert abs(flight.state.right @ np.array(UP_AXES["y"])) < 1e-12
    assert flight.state.forward @ ahead > 0.999 or abs(ahead[1]) > 0.99


def test_a_dark_scan_is_offered_an_exposure_that_brings_its_median_to_the_middle(seed):
    rng = np.random.default_rng(seed)
    for level in (12, 30, 50):
        scene = scene_from_arrays(rng.random((5000, 3)), np.full((5000, 3), level, np.uint8), noise=False)
        seen = survey(scene)
        notice = darkness(seen)
        assert notice is not None and notice.offer == Brighten()
        stops = brightening(seen)
        linear = ((level / 255 + 0.055) / 1.055) ** 2.4 * 2**stops
        assert stops == 3.0 or 0.33 < 1.055 * linear ** (1 / 2.4) - 0.055 < 0.47
    bright = survey(scene_from_arrays(rng.random((5000, 3)), np.full((5000, 3), 120, np.uint8), noise=False))
    assert darkness(bright) is None and brightening(bright) <= 0.5
