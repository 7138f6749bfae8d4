"""The window's state without a window: flying, where a visit starts, settings that wait, captures, controls."""

import csv
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from viewer.camera import look_at
from viewer.cloud import scene_from_arrays
from viewer.errors import InputError
from viewer.progress import progress
from viewer.settings import Settings
from viewer.window import controls
from viewer.window.capture import FrameTimes, save_png, stamped
from viewer.window.loading import Loaded
from viewer.window.navigation import FlyState, Motion, changed_speed, looking, step
from viewer.window.present import composite, split_column
from viewer.window.session import Session
from viewer.window.start import overview, start_camera, survey


def room(*, metre: float = 1.0, offset=(0.0, 0.0, 0.0), scans=None, points=40_000):
    """A furnished-with-nothing room of 8 x 6 x 3 m; ``metre`` in file units."""
    rng = np.random.default_rng(1)
    size = np.array([8.0, 6.0, 3.0])
    xyz = rng.random((points, 3)) * size
    wall = rng.integers(0, 6, points)
    xyz[np.arange(points), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    meta = {"metres_per_unit": 1.0 / metre} | ({"scans": scans} if scans else {})
    return scene_from_arrays(xyz * metre + np.array(offset), rng.integers(0, 255, (points, 3), np.uint8), meta=meta)


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def session(*, loader=lambda settings: None, settings=None):
    clock = Clock()
    made = Session(settings or Settings(view="filled"), (640, 400), load_network=loader, clock=clock)
    scene = room()
    made.accept(Loaded(scene, survey(scene)))
    return made, clock


def stats(**stages):
    return {"total_ms": 1.0, "stages": stages, "points_drawn": 1, "cells_drawn": 1, "raster": "compute",
            "network": None, "approximations": []}  # fmt: skip


def finish(made):
    while made.choice.network_load is not None:
        made.choice.network_load.join(5.0)
        made.poll()


# -- flying --------------------------------------------------------------------------------------------------------


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
    assert np.allclose(looking([1, 2, 3], direction, 1.0).camera_to_world, look_at([1, 2, 3], direction + [1, 2, 3]))


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


# -- where a visit starts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("metre", "offset"), [(1.0, (0, 0, 0)), (3.28084, (6e5, 8e5, 400)), (1000.0, (-5e3, 0, 0))])
def test_a_visit_to_a_room_starts_inside_at_eye_height(metre, offset):
    camera = start_camera(room(metre=metre, offset=offset), 640, 400)
    place = (camera.position - offset) / metre
    assert (place[:2] > 0.3).all() and (place[:2] < [7.7, 5.7]).all() and 1.3 < place[2] < 1.9
    assert abs(camera.forward[2]) < 0.2


def test_a_visit_starts_at_a_scanner_where_there_is_one():
    scans = [{"name": "a", "count": 10, "position": [1, 1, 1.5]}, {"name": "b", "count": 900, "position": [5, 4, 1.4]}]
    assert np.allclose(start_camera(room(scans=scans), 640, 400).position, [5, 4, 1.4])
    far = [{"name": "a", "count": 10, "position": [9e5, 0, 0]}]
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


# -- the session ---------------------------------------------------------------------------------------------------


def test_a_still_session_needs_one_picture():
    made, clock = session()
    assert made.needs_picture
    made.drew(made.plan, stats())
    clock.now += 5
    assert not made.advance() and not made.needs_picture and made.next_change() is None
    made.flight.held.add("forward")
    made.advance()
    clock.now += 0.1
    assert made.advance() and made.needs_picture


def test_neural_waits_for_its_network_and_shows_what_was_asked():
    gate = threading.Event()
    made, _ = session(loader=lambda settings: gate.wait(5) and None)
    made.choice.show("neural")
    assert made.choice.settings.view == "filled" and made.choice.shown_settings.view == "neural"
    gate.set()
    finish(made)
    assert made.choice.settings.view == "neural" and made.picture.dirty
    made.choice.show("raw")
    made.choice.show("neural")
    assert made.choice.settings.view == "neural" and made.choice.network_load is None, "a network is loaded once"


def test_missing_weights_say_so_and_change_nothing():
    def none(settings):
        raise InputError("no weights are shipped for quality 'best'")

    made, _ = session(loader=none, settings=Settings(view="neural"))
    finish(made)
    assert made.notices.message is not None and "best" in made.notices.message.text
    assert made.choice.shown_settings.view == "filled"
    made.choice.request(replace(made.choice.settings, quality="best"))
    finish(made)
    assert made.choice.shown_settings.quality == "balanced"


def test_a_slow_network_flies_filled_and_repaints_at_rest():
    made, clock = session()
    made.choice.show("neural")
    finish(made)
    made.drew(made.plan, stats(network=900.0))
    clock.now += 1
    made.flight.held.add("forward")
    made.advance()
    clock.now += 0.1
    made.advance()
    assert made.plan.views == ("filled",)
    made.drew(made.plan, stats())
    assert "filled while moving" in made.approximations
    made.flight.held.clear()
    for _ in range(200):
        clock.now += 1 / 60
        made.advance()
    assert made.plan.views == ("neural",) and made.needs_picture
    made.picture.pace.keep_up = False
    made.flight.held.add("forward")
    assert made.plan.views == ("neural",)


def fly(made, clock, raster, *, frames=40, occlusion=None):
    """Moves for some frames whose raster stage takes ``raster(level)`` milliseconds; returns the levels drawn with."""
    levels = []
    made.flight.held.add("forward")
    for _ in range(frames):
        clock.now += 0.05
        made.advance()
        plan = made.plan
        assert plan.moving
        levels.append(plan.level)
        made.drew(plan, stats(raster=raster(plan.level)) | ({} if occlusion is None else {"occlusion": occlusion}))
    made.flight.held.clear()
    while made.flight.state.moving:
        clock.now += 0.05
        made.advance()
        made.drew(made.plan, stats(raster=raster(made.plan.level)))
    return levels


def rest(made, clock, raster, points=lambda level: level or 1e9):
    """Draws what is asked for at rest, at most 50 pictures; returns their levels."""
    clock.now += 1.0
    made.advance()
    levels = []
    while made.needs_picture and len(levels) < 50:
        plan = made.plan
        levels.append(plan.level)
        made.drew(plan, stats(raster=raster(plan.level)) | {"points_drawn": points(plan.level)})
    assert not made.needs_picture and made.next_change() is None, "at rest nothing is drawn for ever, nor waited for"
    return levels


def test_where_drawing_is_quick_nothing_is_left_out():
    made, clock = session()
    assert set(fly(made, clock, lambda level: 12.0)) == {None}


@pytest.mark.parametrize("per_point", [5.0, 12.0, 30.0])
def test_points_a_pixel_settle_while_moving_and_all_come_back_at_rest(per_point):
    made, clock = session()
    cost = lambda level: min(400.0, per_point * (level or 1e9))  # noqa: E731
    levels = fly(made, clock, cost)
    settled = levels[-20:]
    assert len(set(settled)) == 1 and cost(settled[0]) <= 60.0, f"no swinging to and fro: {levels}"
    levels = rest(made, clock, cost, points=lambda level: cost(level) / per_point)
    assert levels[-1] is None and levels[:-1] == sorted(levels[:-1]), "finer and finer, then every point"
    assert fly(made, clock, cost, frames=3)[0] == settled[0], "the next flight begins where this one settled"


def test_points_are_not_left_out_where_that_saves_nothing():
    made, clock = session()
    made.flight.held.add("forward")
    levels = []
    for _ in range(30):  # 90 ms whatever is drawn, as where the picture's size decides
        clock.now += 0.05
        made.advance()
        plan = made.plan
        levels.append(plan.level)
        points = int(min(1e6, 1e5 * (plan.level or 1e9)))
        made.drew(plan, stats(raster=90.0) | {"points_drawn": points})
    assert levels[-1] == 16.0 or levels[-1] == 8.0, f"as many points as before anything was gained: {levels}"


def test_at_rest_a_picture_that_would_take_too_long_is_not_begun():
    made, clock = session()
    cost = lambda level: 1e6 if level is None else 100.0 * level  # noqa: E731
    made.picture.pace.begin(10**9)
    assert made.plan.level == 1.0, "a huge scene begins coarse"
    fly(made, clock, cost)
    levels = rest(made, clock, cost)
    assert None not in levels and max(map(cost, levels)) <= 2000.0 < 4 * cost(levels[-1])
    made.picture.pace.keep_up = False
    assert made.plan.level is None, "unless that is asked for"


def test_points_that_do_not_grow_in_number_are_all_there_are():
    made, clock = session()
    made.picture.pace.begin(10**9)
    levels = rest(made, clock, lambda level: 50.0, points=lambda level: min(level or 1e9, 10.0))
    assert levels == [1.0, 4.0, 16.0, 64.0, None]


def test_a_level_of_ones_own_is_never_exceeded():
    made, clock = session(settings=Settings(view="filled", lod=2.0))
    cost = lambda level: 40.0 * level  # noqa: E731
    assert max(fly(made, clock, cost)) == 2.0
    assert rest(made, clock, cost)[-1] == 2.0


def test_hidden_cells_are_looked_for_only_where_it_pays_and_never_left_out_at_rest():
    made, clock = session()
    made.drew(made.plan, stats())
    fly(made, clock, lambda level: 10.0, frames=5, occlusion={"points_hidden": 9})
    made.flight.held.add("forward")
    assert made.plan.hides
    made.drew(made.plan, stats(raster=10.0) | {"occlusion": {"points_hidden": 9}})
    made.flight.held.clear()
    assert made.next_change() is not None
    clock.now += 1.0
    assert made.needs_picture and not made.plan.hides
    made.drew(made.plan, stats())
    clock.now += 1.0
    made.flight.held.add("forward")
    for hides in (True, False):  # the first frame of a flight knows of nothing that hides
        clock.now += 0.05
        made.advance()
        made.drew(made.plan, stats(raster=10.0) | {"occlusion": {"points_hidden": 0}})
        assert made.plan.hides == hides
    fly(made, clock, lambda level: 10.0, frames=100)
    made.flight.held.add("forward")
    assert made.plan.hides, "tried again later"


def test_comparison_never_shows_the_same_view_twice_at_first():
    made, _ = session()
    for view in ("raw", "filtered", "filled"):
        made.choice.show(view)
        made.choice.compare(True)
        assert made.choice.sides[0] == "raw" and made.choice.sides[1] != "raw"
        made.choice.compare(False)


def test_what_is_odd_about_a_scan_is_said():
    made, _ = session()
    scene = room()
    scene.meta["colour"] = {"source": "intensity", "note": "no colour in the file; showing intensity"}
    scene.meta["warnings"].append("3 points without coordinates left out")
    scene.meta["exposures"], scene.meta["passes"] = {"applied": False}, {"applied": True}
    made.accept(Loaded(scene, survey(scene)))
    assert [toast.text for toast in made.notices.toasts] == [
        "no colour in the file; showing intensity", "3 points without coordinates left out",
        "brightness matched between runs of points; --exposures as-scanned leaves it",
    ]  # fmt: skip


def test_a_cancelled_load_leaves_the_scene():
    started = threading.Event()

    def endless(paths):
        with progress(0, "Reading") as meter:
            while True:
                started.set()
                meter.update(1)

    made, _ = session()
    scene, made.loads.open_scene = made.scene, endless
    made.loads.open([Path("x.laz")])
    work = made.loads.current
    assert started.wait(5) and work is not None
    made.escape()
    assert made.loads.current is None and work.join(5) and made.poll() is None
    assert made.scene is scene and made.notices.message is None


def test_a_failed_picture_goes_back_to_the_last_good_settings_and_then_stops():
    made, _ = session()
    made.drew(made.plan, stats())
    made.choice.request(replace(made.choice.settings, raster="points"))
    made.failed("no")
    assert made.choice.settings.raster == "auto" and made.needs_picture
    for _ in range(4):
        made.failed("no")
    assert not made.needs_picture, "a broken device must not be asked for ever"


# -- captures and the table ----------------------------------------------------------------------------------------


def test_composite_is_exact_at_both_ends():
    image = np.zeros((1, 3, 4), np.uint8)
    image[0, 0], image[0, 1], image[0, 2] = (9, 200, 255, 255), (9, 200, 255, 0), (255, 255, 255, 128)
    assert composite(image, (10, 20, 30)).tolist() == [[[9, 200, 255], [10, 20, 30], [133, 138, 143]]]
    assert split_column(0.0, 7) == 0 and split_column(1.0, 7) == 7


def test_captures_never_overwrite_and_leave_nothing_half_written(tmp_path):
    image = np.zeros((2, 2, 3), np.uint8)
    paths = []
    for _ in range(3):
        paths.append(stamped("pointglass", ".png", tmp_path))
        save_png(paths[-1], image)
    assert len(set(paths)) == 3 and sorted(tmp_path.iterdir()) == sorted(paths)
    with pytest.raises(InputError, match="cannot be written"):
        save_png(tmp_path / "no" / "folder.png", image)


def test_recording_has_a_row_a_frame(tmp_path):
    times = FrameTimes()
    for number in range(3):
        times.add(10 + number / 10, stats(cull=0.5, raster=2.0), (64, 48), ("raw",))
    times.save(tmp_path / "t.csv")
    rows = list(csv.DictReader((tmp_path / "t.csv").open()))
    assert [row["interval_ms"] for row in rows] == ["", "100.000", "100.000"]
    assert rows[0]["raster_ms"] == "2.000" and rows[0]["network_ms"] == ""


def test_every_key_does_one_thing():
    keys = [key for control in controls.ALL for key in control.keys]
    assert len(keys) == len(set(keys))
    table = controls.table_markdown()
    assert all(control.help in table for control in controls.ALL)
