"""Checks of a scan dropped on the window and flown through: views, keys, pointer, the comparison."""

import time

import numpy as np
from driver import SIZE, Driver


def check_dropped_scan_opens(d: Driver) -> None:
    d.drop(d.folder / "room1")
    d.until(lambda: d.session.loads.current is None)
    assert d.session.scene is not None and d.session.notices.message is None
    assert d.session.scene.count == 50_000
    assert d.bare().std() > 5


def check_window_shows_what_render_makes(d: Driver) -> None:
    for view in ("raw", "filtered", "filled"):
        d.session.view_settings.show(view)
        assert np.array_equal(d.bare(), d.rendered()), view


def check_digits_choose_views(d: Driver) -> None:
    seen = []
    for key, view in (("1", "raw"), ("2", "filtered"), ("3", "filled")):
        d.key(key)
        assert d.session.view_settings.settings.view == view
        seen.append(d.bare())
    assert not np.array_equal(seen[0], seen[2]) and (seen[0] == seen[1]).mean() < 1.0


def check_held_keys_fly(d: Driver) -> None:
    for key, axis in (("W", 2), ("S", 2), ("A", 0), ("D", 0), ("E", None), ("Q", None)):
        d.key("HOME")
        camera, before = d.session.camera, d.bare()
        d.key(key, "down")
        d.until(lambda start=camera: np.linalg.norm(d.session.camera.position - start.position) > 0.05)
        d.key(key, "up")
        moved = d.session.camera.position - camera.position
        along = moved[2] if axis is None else camera.camera_to_world[:3, axis] @ moved
        sign = {"W": -1, "S": 1, "A": -1, "D": 1, "E": 1, "Q": -1}[key]
        assert along * sign > 0.9 * np.linalg.norm(moved), key
        assert not np.array_equal(before, d.bare()), key
        d.until(lambda: not d.session.flight.state.moving)


def check_modifiers_change_the_pace(d: Driver) -> None:
    speeds = {}
    for modifier in ("LEFT_ALT", None, "LEFT_SHIFT"):
        d.key("HOME")
        if modifier:
            d.key(modifier, "down")
        d.key("W", "down")
        start = time.monotonic()
        d.until(lambda start=start: time.monotonic() - start > 0.8)
        speeds[modifier] = np.linalg.norm(d.session.flight.state.velocity)
        d.key("W", "up")
        if modifier:
            d.key(modifier, "up")
        d.until(lambda: not d.session.flight.state.moving)
    d.key("HOME")
    assert speeds["LEFT_ALT"] * 3 < speeds[None] < speeds["LEFT_SHIFT"] / 3, speeds


def check_still_camera_draws_nothing(d: Driver) -> None:
    d.settle(8)
    made = []
    original = d.app.viewport.renderer.render
    d.app.viewport.renderer.render = lambda *a, **k: made.append(1) or original(*a, **k)
    d.settle(10)
    d.app.viewport.renderer.render = original
    assert not made
    d.session.notices.toasts = []
    d.settle(8)
    assert any(_idle_share(d) < 0.2 for _ in range(4)), "an idle window uses the processor"


def _idle_share(d: Driver) -> float:
    """Share of a processor that the process uses in 1.5 s: also that of other threads, of which one may just be ending."""
    start, spent = time.monotonic(), time.process_time()
    while time.monotonic() - start < 1.5:
        d.app.step()
    return (time.process_time() - spent) / (time.monotonic() - start)


def check_wheel_changes_speed_and_shows_it(d: Driver) -> None:
    d.point(320, 350)
    before = d.session.flight.state.speed
    d.app.input.on_scroll(d.app.window, 0.0, 2.0)
    d.settle()
    assert d.session.flight.state.speed > 1.4 * before
    assert any(toast.text.startswith("Speed") for toast in d.session.notices.toasts)
    d.app.input.on_scroll(d.app.window, 0.0, -2.0)


def check_dragging_looks_around(d: Driver) -> None:
    for button in (d.glfw.MOUSE_BUTTON_LEFT, d.glfw.MOUSE_BUTTON_RIGHT):
        d.key("HOME")
        d.point(320, 350)
        before = d.bare()
        d.button(d.glfw.PRESS, button)
        x, y = d.app.input.pointer
        d.app.input.on_pointer(d.app.window, x + 10, y)
        d.settle(2)  # the pointer is captured, and the server moves it
        direction = d.session.camera.forward
        x, y = d.app.input.pointer
        d.app.input.on_pointer(d.app.window, x + 60, y + 5)
        d.settle(2)
        d.button(d.glfw.RELEASE, button)
        right = np.cross(direction, [0, 0, 1])
        assert d.session.camera.forward @ right > 0.1, "dragging right looks right"
        assert not np.array_equal(before, d.bare())
    d.key("HOME")


def check_home_and_frame(d: Driver) -> None:
    home = d.session.camera
    d.key("F")
    framed = d.session.camera
    assert np.allclose(framed.forward, home.forward)
    corners = d.session.scene.bounds
    middle = corners.mean(axis=0)
    seen = framed.world_to_camera @ [*middle, 1.0]
    assert -seen[2] > np.linalg.norm(corners[1] - corners[0]) / 4, "the scene lies in front"
    d.key("HOME")
    assert np.array_equal(d.session.camera.camera_to_world, home.camera_to_world)


def check_split_compares_and_its_handle_drags(d: Driver) -> None:
    d.key("3")
    filled = d.bare()
    d.key("1")
    raw = d.bare()
    d.key("3")
    d.key("V")
    assert d.session.view_settings.split and d.session.view_settings.sides == ("raw", "filled")
    half = d.bare()
    assert np.array_equal(half[:, :320], raw[:, :320]) and np.array_equal(half[:, 320:], filled[:, 320:])
    d.point(320, 300)
    assert d.app.input.over_handle
    d.button(d.glfw.PRESS)
    assert d.session.dragging_handle and not d.session.flight.looking
    d.point(200, 300)
    d.button(d.glfw.RELEASE)
    column = round(d.session.view_settings.split_at * SIZE[0])
    assert abs(column - 200) <= 1.5, "folded panels leave the whole window"
    moved = d.bare()
    assert np.array_equal(moved[:, :column], raw[:, :column]) and np.array_equal(moved[:, column:], filled[:, column:])
    d.key("V")
    assert np.array_equal(d.bare(), filled)
