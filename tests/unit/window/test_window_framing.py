"""The start viewpoint: objects entire and upright, terrain from above, rooms from inside."""

from dataclasses import replace

import numpy as np
import pytest
from window_session import room

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.window.flight.cube_regions import BORDER, region_at, view_of
from pointglass.viewer.window.flight.flight import Flight
from pointglass.viewer.window.flight.framing import SIDES
from pointglass.viewer.window.flight.start_viewpoint import darkness, start_camera, start_state, survey
from pointglass.viewer.work.places.standing_place import enclosure
from pointglass.viewer.work.places.up_axis import upright_axes


@pytest.mark.parametrize("aspect", [0.8, 1.6, 2.4])
def test_an_object_is_framed_entire_and_upright_and_terrain_is_seen_from_above(aspect, seed):
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=(30_000, 3))
    statue = turn / np.linalg.norm(turn, axis=1, keepdims=True) * (0.8, 0.9, 2.0) + (4e5, 5e6, 30.0)
    tile = np.stack([rng.uniform(0, 900, 30_000), rng.uniform(0, 500, 30_000), rng.normal(0, 4, 30_000)], axis=1)
    for points, steepest in ((statue, 35.0), (tile, 60.0)):
        scene = scene_from_arrays(points, np.full((len(points), 3), 180, np.uint8), meta=ScanDescription(metres_per_unit=1.0))
        height = 480
        camera = start_camera(scene, round(aspect * height), height)
        pixels, depth = camera.project(points)
        inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels <= (camera.width, camera.height)).all(axis=1)
        assert inside.mean() > 0.9999, "with its corners"
        assert camera.up[2] > 0.3 and -np.sin(np.radians(steepest)) < camera.forward[2] < -0.1
        spans = np.ptp(pixels[inside], axis=0) / (camera.width, camera.height)
        assert spans.max() > 0.6, "it fills the picture"


def test_a_dark_scan_is_said_to_be_dark():
    for level, dark in ((20, True), (150, False)):
        scene = scene_from_arrays(np.random.default_rng(1).random((5000, 3)), np.full((5000, 3), level, np.uint8))
        assert (darkness(survey(scene)) is not None) is dark


def test_a_room_is_entered_and_a_wall_is_not():
    camera = start_camera(room(), 640, 400)
    assert (camera.position > 0.3).all() and (camera.position < (7.7, 5.7, 2.7)).all()
    rng = np.random.default_rng(3)
    wall = np.stack([rng.uniform(0, 6, 20_000), rng.normal(0, 0.01, 20_000), rng.uniform(0, 3, 20_000)], axis=1)
    scene = scene_from_arrays(wall, np.full((20_000, 3), 200, np.uint8), meta=ScanDescription(metres_per_unit=1.0))
    seen = survey(scene)
    assert enclosure(seen, np.array([3.0, 1.5, 1.6])) < 0.5
    pixels, depth = start_camera(scene, 640, 400).project(wall)
    assert (depth > 0).all() and np.ptp(pixels, axis=0).min() > 100, "seen from its front"


@pytest.mark.parametrize("seed_of_room", range(3))
def test_a_visit_begins_facing_the_room_not_the_street_behind_its_window(seed_of_room):
    """A brick front 12 m beyond a wide window, seen from the scanner near that window, has more detail and distance than the
    room: it must not win."""
    rng = np.random.default_rng([seed_of_room, 5])
    size = np.array([6.0, 5.0, 2.7])
    xyz = rng.random((60_000, 3)) * size
    side = rng.integers(0, 6, len(xyz))
    xyz[np.arange(len(xyz)), side % 3] = np.where(side < 3, 0.0, size[side % 3])
    rgb = np.full((len(xyz), 3), 190, np.uint8)
    window = (xyz[:, 1] == size[1]) & (np.abs(xyz[:, 0] - 3) < 2.4) & (xyz[:, 2] > 0.8) & (xyz[:, 2] < 2.4)
    bars = np.abs(xyz[:, 0] - 3) < 0.05
    xyz, rgb = xyz[~window | bars], rgb[~window | bars]
    front = np.stack([rng.uniform(-9, 15, 40_000), np.full(40_000, 17.0), rng.uniform(-5, 9, 40_000)], axis=1)
    bricks = np.repeat(((front[:, 0] // 1.5 + front[:, 2] // 1.5) % 2 * 150 + 50).astype(np.uint8)[:, None], 3, axis=1)
    shelf = np.stack([rng.uniform(0.5, 5.5, 8_000), np.full(8_000, 0.3), rng.uniform(0, 2, 8_000)], axis=1)
    books = np.repeat(((shelf[:, 0] // 0.3 + shelf[:, 2] // 0.4) % 2 * 150 + 50).astype(np.uint8)[:, None], 3, axis=1)
    scans = (ScanSummary("one", 108_000, (3.0, 4.1, 1.55)),)
    scene = scene_from_arrays(np.concatenate([xyz, front, shelf]), np.concatenate([rgb, bricks, books]),
                              meta=ScanDescription(metres_per_unit=1.0, scans=scans))
    camera = start_camera(scene, 640, 480)
    assert np.allclose(camera.position, scans[0].position, atol=0.01) and camera.forward[1] < 0.3


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize("side", list(SIDES))
def test_from_each_side_the_whole_scan_is_seen_upright(side, up, seed):
    rng = np.random.default_rng(seed)
    upright = upright_axes(up)
    points = (rng.random((20_000, 3)) * rng.uniform(1, 30, 3)) @ upright.T + rng.uniform(-1e5, 1e5, 3)
    scene = scene_from_arrays(points, np.full((len(points), 3), 180, np.uint8), meta=ScanDescription(metres_per_unit=1.0))
    now = [0.0]
    flight, seen = Flight(lambda: now[0]), survey(scene)
    flight.begin(start_state(scene, seen, 1.5, up), seen)
    flight.look_from(side, 1.5)
    for _ in range(60):
        now[0] += 0.1
        flight.advance()
    assert not flight.gliding
    camera = flight.camera((600, 400))
    pixels, depth = camera.project(points)
    inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels <= (600, 400)).all(axis=1)
    assert inside.mean() > 0.98 and (np.ptp(pixels[inside], axis=0) / (600, 400)).max() > 0.6
    direction = np.array(SIDES[side].direction)
    assert camera.forward @ (upright @ direction) > 0.999 * np.linalg.norm(direction)
    vertical = {"top": 1.0, "bottom": -1.0}
    ahead = upright @ (0.0, vertical[side], 0.0) if side in vertical else np.array(up)
    assert camera.up @ ahead > 0.5, "+y lies at the top from above, up at the top from elsewhere"


@pytest.mark.parametrize(("metres", "text"), [(1.0, "30 m/s"), (0.3048, "30 ft/s"), (None, "30 units/s"), (0.5, "15 m/s")])
def test_a_speed_is_shown_in_the_unit_that_lengths_are_shown_in(metres, text):
    flight = Flight(lambda: 0.0)
    flight.state = replace(flight.state, speed=30.0)
    assert flight.speed_text(metres) == text


def test_a_click_on_the_view_cube_turns_to_what_it_hits_about_the_middle_of_the_picture(seed):
    """The region of a place of the cube's picture against a march along its ray; and where the camera ends."""
    rng = np.random.default_rng(seed)
    now = [0.0]
    for number in range(12):
        flight = Flight(lambda: now[0])
        state = replace(flight.state, position=rng.normal(size=3), yaw=rng.uniform(-3, 3), pitch=rng.uniform(-1.5, 1.5),
                        upright=upright_axes((0.0, 0.0, 1.0) if number % 2 else (0.0, 1.0, 0.0)))
        flight.state = state
        if number % 3 == 0:
            flight.orthographic = 4.0
        to_view = (state.upright.T @ state.camera_to_world[:3, :3]).T
        for x, y in rng.uniform(-1.8, 1.8, (40, 2)):
            ray = to_view.T @ np.array([np.full(4001, x), np.full(4001, y), np.linspace(2, -2, 4001)])
            inside = np.flatnonzero(np.abs(ray).max(axis=0) <= 1)
            found = region_at(to_view, x, y)
            if found is None:
                assert len(inside) < 6, "past the cube, or a corner of it"
            elif len(inside) > 6:
                hit = ray[:, inside[0]]
                sure = np.abs(np.abs(hit) - BORDER) > 2e-3
                assert ((np.sign(hit) * (np.abs(hit) > BORDER))[sure] == np.array(found)[sure]).all()
        region = found or (0, 0, 1)
        camera = flight.camera((300, 200))
        pivot = camera.unproject([(150, 100)], 3.0)[0]
        flight.turn_about(pivot, *view_of(region, state.yaw))
        for _ in range(3):
            now[0] += 0.1
            flight.advance()
            assert flight.gliding
            pixels, depth = flight.camera((300, 200)).project([pivot])
            assert np.allclose(pixels, (150, 100)) and np.isclose(depth[0], 3.0)
        now[0] += 1.0
        flight.advance()
        ahead, wanted = state.upright.T @ flight.state.forward, -np.array(region) / np.linalg.norm(region)
        assert not flight.gliding and ahead @ wanted > (1 - 1e-9 if flight.orthographic else np.cos(np.radians(1.01)))
