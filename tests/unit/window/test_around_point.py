"""Orbit, pan, zoom and the flight to a point, on random cameras against the camera's own projection."""

import numpy as np
import pytest
from window_session import Clock

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import Camera
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.window.flight.flight import REST, Flight
from pointglass.viewer.window.flight.glide import Glide
from pointglass.viewer.window.flight.navigation import PITCH_LIMIT, FlyState
from pointglass.viewer.window.flight.orbit import ORBIT, ZOOM_STEP, orbited, panned, zoomed
from pointglass.viewer.work.places.approach import approach
from pointglass.viewer.work.places.up_axis import upright_axes


def random_state(rng) -> FlyState:
    up = rng.normal(size=3)
    upright = upright_axes(up / np.linalg.norm(up))
    return FlyState(rng.normal(size=3) * 10 ** rng.uniform(0, 6), rng.uniform(-np.pi, np.pi), rng.uniform(-1.5, 1.5), 1.0,
                    upright=upright)


def lens(rng, state: FlyState) -> Camera:
    focal = rng.uniform(200, 900)
    return Camera(640, 400, focal, focal, 320, 200, state.camera_to_world)


@pytest.fixture
def cameras(seed):
    """(random generator, state, its camera, a point in sight) twenty times."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(20):
        state = random_state(rng)
        camera = lens(rng, state)
        point = camera.unproject([rng.uniform(0, 1, 2) * (640, 400)], 10 ** rng.uniform(-1, 2))[0]
        made.append((rng, state, camera, point))
    return made


def pixel(camera: Camera, state: FlyState, point) -> np.ndarray:
    return camera.moved(state.camera_to_world).project([point])[0][0]


def tolerance(state: FlyState, point) -> float:
    """Pixels that float64 loses where coordinates are large beside the distance."""
    return 1e-9 + 1e-12 * np.abs(state.position).max() / np.linalg.norm(state.position - point) * 1e3


def test_orbiting_keeps_the_distance_and_pixel_of_the_point_and_the_horizon(cameras):
    for rng, state, camera, point in cameras:
        moved = state
        for _ in range(30):
            moved = orbited(moved, point, *rng.uniform(-80, 80, 2))
        distance = np.linalg.norm(state.position - point)
        slack = 1e-10 * distance + 1e-14 * np.abs(state.position).max() * 100
        assert abs(np.linalg.norm(moved.position - point) - distance) < slack
        assert np.abs(pixel(camera, moved, point) - pixel(camera, state, point)).max() < 1e3 * tolerance(state, point)
        up, right = state.upright[:, 2], moved.camera_to_world[:3, 0]
        assert abs(right @ up) < 1e-12 and moved.camera_to_world[:3, 1] @ up > 0
        assert abs(moved.pitch) <= PITCH_LIMIT


def test_orbiting_turns_by_the_mouse_and_back(cameras):
    for rng, state, _, point in cameras:
        dx, dy = rng.uniform(-50, 50), np.clip(rng.uniform(-50, 50), (state.pitch - 1.5) / ORBIT, (state.pitch + 1.5) / ORBIT)
        there = orbited(state, point, dx, dy)
        back = orbited(orbited(there, point, 0, -dy), point, -dx, 0)
        assert np.allclose(back.position - state.position, 0, atol=1e-9 * (1 + np.abs(state.position).max()))
        assert np.isclose(np.sin(there.yaw), np.sin(state.yaw - ORBIT * dx))


def test_panning_puts_the_point_under_the_pointer_at_the_same_depth(cameras):
    for rng, state, camera, point in cameras:
        target = rng.uniform(0, 1, 2) * (640, 400)
        moved = panned(state, camera, point, tuple(target))
        assert np.abs(pixel(camera, moved, point) - target).max() < 1e3 * tolerance(state, point)
        before, after = (camera.moved(s.camera_to_world).project([point])[1][0] for s in (state, moved))
        assert np.isclose(before, after, rtol=1e-9, atol=1e-15 * 100 * np.abs(state.position).max())
        assert np.array_equal(moved.camera_to_world[:3, :3], state.camera_to_world[:3, :3])


def test_panning_by_a_point_behind_the_camera_moves_nothing(cameras):
    for _, state, camera, _ in cameras:
        assert panned(state, camera, state.position - state.forward, (10.0, 10.0)) is state


def test_zooming_keeps_the_pixel_and_never_passes_through(cameras):
    for rng, state, camera, point in cameras:
        distance = np.linalg.norm(state.position - point)
        notches = rng.integers(1, 4)
        once = zoomed(state, point, notches, 0.0)
        assert np.isclose(np.linalg.norm(once.position - point), distance * ZOOM_STEP**notches, rtol=1e-6)
        assert np.abs(pixel(camera, once, point) - pixel(camera, state, point)).max() < 1e3 * tolerance(once, point)
        nearest, near = 0.05 * distance, state
        for _ in range(60):
            near = zoomed(near, point, 3, nearest)
            assert (near.position - point) @ (state.position - point) > 0, "the camera passed through the point"
        assert np.linalg.norm(near.position - point) == pytest.approx(nearest, rel=1e-6)
        closer = zoomed(near, point, 1, 2 * nearest)
        assert np.allclose(closer.position, near.position), "nearer than the nearest: it stays"
        far = zoomed(near, point, -2, nearest)
        assert np.linalg.norm(far.position - point) == pytest.approx(nearest / ZOOM_STEP**2, rel=1e-6)


def test_a_glide_is_eased_takes_the_short_way_and_ends_exactly(seed):
    rng = np.random.default_rng(seed)
    for _ in range(10):
        start = random_state(rng)
        end = FlyState(start.position + rng.normal(size=3), rng.uniform(-np.pi, np.pi), rng.uniform(-1.5, 1.5), 2.0,
                       upright=start.upright)
        glide = Glide(start, end)
        assert np.allclose(glide.at(0.0).camera_to_world, start.camera_to_world) and glide.at(glide.seconds) is end
        states = [glide.at(t) for t in np.linspace(0, glide.seconds, 101)]
        along = (end.position - start.position) / np.linalg.norm(end.position - start.position)
        way = np.array([(state.position - start.position) @ along for state in states])
        speeds = np.diff(way)
        assert (speeds > -1e-9).all() and speeds[[0, -1]].max() < 0.01 * speeds.max()
        turns = np.abs((np.diff([state.yaw for state in states]) + np.pi) % (2 * np.pi) - np.pi)
        assert turns.sum() <= np.pi + 1e-9


def flight(state: FlyState) -> tuple[Flight, Clock]:
    from types import SimpleNamespace

    clock = Clock()
    made = Flight(clock)
    made.begin(state, SimpleNamespace(low=np.zeros(3), high=np.ones(3), limits=(0.1, 10.0)))
    return made, clock


def test_a_glide_moves_with_the_clock_ends_at_rest_and_a_key_ends_it(seed):
    rng = np.random.default_rng(seed)
    start = random_state(rng)
    end = FlyState(start.position + 1.0, 1.0, 0.2, start.speed, upright=start.upright)
    made, clock = flight(start)
    made.glide_to(end)
    assert made.moving and made.under_way
    clock.now += 0.3
    assert made.advance() and np.linalg.norm(made.state.position - start.position) > 0.01
    clock.now += 1.0
    assert made.advance() and np.allclose(made.state.camera_to_world, end.camera_to_world) and not made.gliding
    clock.now += 2 * REST
    assert not made.advance() and not made.moving and not made.under_way
    for stop in (made.stop_glide, lambda: made.held.add("forward"), made.let_go, lambda: made.drag(made.state)):
        made.glide_to(start)
        clock.now += 0.2
        made.advance()
        stop()
        made.advance()
        assert not made.gliding
        made.held.clear()


def test_a_drag_counts_as_moving_and_is_seen_once():
    made, clock = flight(FlyState(np.zeros(3)))
    clock.now += 1.0
    assert not made.moving
    made.drag(FlyState(np.ones(3)))
    assert made.moving and made.advance() and not made.advance()
    clock.now += 2 * REST
    assert not made.moving


def surface(rng, axes, centre, count=40_000, half=4.0):
    """Points of a square patch, spanned by the first two columns of ``axes``."""
    flat = rng.uniform(-half, half, (count, 2))
    return centre + flat @ axes[:, :2].T


def test_a_double_click_faces_a_wall_and_looks_down_on_a_floor(seed):
    rng = np.random.default_rng(seed)
    up = np.array([0.0, 0.0, 1.0])
    turn = rng.uniform(-np.pi, np.pi)
    normal = np.array([np.cos(turn), np.sin(turn), 0.0])
    wall_axes = np.stack([np.cross(up, normal), up, normal], axis=1)
    for axes in (wall_axes, np.eye(3)):
        xyz = surface(rng, axes, np.array([0.0, 0.0, 2.0]))
        scene = scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8), meta=ScanDescription(metres_per_unit=1.0))
        out = axes[:, 2]
        eye = np.array([0.0, 0.0, 2.0]) + 5 * out + axes[:, :2] @ rng.uniform(-3, 3, 2)
        point = np.array([0.0, 0.0, 2.0]) + axes[:, :2] @ rng.uniform(-1, 1, 2)
        position, direction = approach(scene, eye, point, up, 1.0)
        distance = np.linalg.norm(position - point)
        assert np.allclose(position + distance * direction, point) and distance <= np.linalg.norm(eye - point) / 2 + 1e-9
        assert (position - point) @ out > 0, "it stays on its side of the surface"
        if axes is wall_axes:
            assert -direction @ out > 0.999 and distance >= 1.4
        else:
            assert -direction @ out == pytest.approx(np.sin(np.radians(35)), abs=0.02)


def test_a_double_click_does_not_fly_behind_an_obstacle(seed):
    """A wall seen aslant through the gap beside a second wall that stands close in front of it."""
    rng = np.random.default_rng(seed)
    back = np.stack([rng.uniform(-4, 4, 40_000), np.zeros(40_000), rng.uniform(0, 3, 40_000)], axis=1)
    front = np.stack([rng.uniform(-4, 0.4, 30_000), np.full(30_000, 1.0), rng.uniform(0, 3, 30_000)], axis=1)
    xyz = np.concatenate([back, front])
    scene = scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8), meta=ScanDescription(metres_per_unit=1.0))
    point, eye = np.array([0.0, 0.0, 1.5]), np.array([4.0, 4.0, 1.5])
    position, direction = approach(scene, eye, point, np.array([0.0, 0.0, 1.0]), 1.0)
    along = np.linspace(0.3, 1.0, 50)[:, None] * (position - point) + point
    away = np.linalg.norm(along[:, None] - front[None, ::10], axis=2).min(axis=1)
    assert away.min() > 0.05, "something stands in the line of sight"
    assert not np.allclose(-direction, [0.0, 1.0, 0.0], atol=0.1)
