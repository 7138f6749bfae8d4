"""Checks of moving about a point of the scene with the mouse: orbit, pan, zoom, and the flight to a point."""

import time

import numpy as np
from driver import Driver, middle


def on_a_wall(point) -> bool:
    """Within 3 cm: the depth of a pixel, and not the exact point."""
    return bool(np.minimum(np.abs(point), np.abs(point - np.array([8.0, 6.0, 3.0]))).min() < 0.03)


def start(d: Driver) -> None:
    d.key("HOME")
    d.rest()


def press(d: Driver, at: tuple[float, float], mods: int = 0, button: str = "MIDDLE") -> None:
    d.point(*at)
    d.app.input.on_button(d.app.window, getattr(d.glfw, f"MOUSE_BUTTON_{button}"), d.glfw.PRESS, mods)
    d.settle(2)


def drag(d: Driver, dx: float, dy: float) -> None:
    x, y = d.app.input.pointer
    d.app.input.on_pointer(d.app.window, x + dx, y + dy)
    d.settle(2)


def release(d: Driver, mods: int = 0, button: str = "MIDDLE") -> None:
    d.app.input.on_button(d.app.window, getattr(d.glfw, f"MOUSE_BUTTON_{button}"), d.glfw.RELEASE, mods)
    d.settle()


def pixel(d: Driver, point) -> np.ndarray:
    return d.session.camera.project([point])[0][0]


def check_middle_drag_orbits_the_point_under_the_pointer(d: Driver) -> None:
    d.settle()
    start(d)
    camera, about = d.session.camera, d.app.toolbox.fly.around_point
    press(d, middle(d, 0.1, 0.1))
    pivot = about.pivot
    assert pivot is not None and on_a_wall(pivot)
    assert np.linalg.norm(pixel(d, pivot) - (np.array(middle(d, 0.1, 0.1)) - d.session.area.origin)) < 2.0
    drag(d, 4, 0)
    for _ in range(4):
        drag(d, 20, -6)  # the pointer is captured, and the server moves it: by how much does not matter
    d.picture("orbit")
    turned = d.session.camera
    assert turned.forward @ camera.forward < 0.999
    assert np.isclose(*(np.linalg.norm(one.position - pivot) for one in (camera, turned)))
    assert np.linalg.norm(turned.project([pivot])[0] - camera.project([pivot])[0]) < 1e-6 and abs(turned.right[2]) < 1e-9
    release(d)
    assert about.pivot is None and not d.app.toolbox.holding
    assert np.array_equal(d.bare(), d.rendered())


def check_shift_and_middle_drag_keep_the_point_under_the_pointer(d: Driver) -> None:
    start(d)
    camera, shift = d.session.camera, d.glfw.MOD_SHIFT
    press(d, middle(d), shift)
    grabbed = d.app.toolbox.fly.around_point.pivot
    offset = pixel(d, grabbed) - d.app.input.position
    for _ in range(3):
        drag(d, 30, 12)
        assert np.abs(pixel(d, grabbed) - d.app.input.position - offset).max() < 1e-6
    d.picture("pan")
    release(d, shift)
    assert np.allclose(d.session.camera.forward, camera.forward)
    moved = d.session.camera.position - camera.position
    assert abs(moved @ camera.forward) < 1e-9 < np.linalg.norm(moved)


def check_ctrl_and_wheel_zoom_to_the_pointer(d: Driver) -> None:
    start(d)
    camera, speed = d.session.camera, d.session.flight.state.speed
    d.point(*middle(d, -0.15, 0.05))
    d.key("LEFT_CONTROL", "down")
    try:
        d.app.input.on_scroll(d.app.window, 0.0, 2.0)
        d.settle(1)
        d.picture("zoom")
        point = d.app.toolbox.fly.around_point._zoom[1]
        before, after = (np.linalg.norm(one.position - point) for one in (camera, d.session.camera))
        assert on_a_wall(point) and np.isclose(after / before, 0.85**2)
        assert np.abs(pixel(d, point) - camera.project([point])[0][0]).max() < 1e-6
        for _ in range(40):
            d.app.input.on_scroll(d.app.window, 0.0, 3.0)
        d.settle(2)
        near = np.linalg.norm(d.session.camera.position - point)
        assert (d.session.camera.position - point) @ (camera.position - point) > 0 and 0 < near < 0.3
    finally:
        d.key("LEFT_CONTROL", "up")
    assert d.session.flight.state.speed == speed, "the flying speed is the plain wheel's"
    d.app.input.on_scroll(d.app.window, 0.0, 1.0)
    assert d.session.flight.state.speed > speed
    d.app.input.on_scroll(d.app.window, 0.0, -1.0)


def check_the_orbit_preset_turns_moves_and_zooms_as_in_programs_for_objects(d: Driver) -> None:
    d.session.flight.mouse = "orbit"
    try:
        start(d)
        camera, about = d.session.camera, d.app.toolbox.fly.around_point
        press(d, middle(d, 0.1, 0.1), button="LEFT")
        assert about.pivot is None, "a press alone may be a click"
        drag(d, 30, 4)
        pivot = about.pivot
        assert pivot is not None and on_a_wall(pivot)
        drag(d, 20, 0)
        release(d, button="LEFT")
        turned = d.session.camera
        assert turned.forward @ camera.forward < 0.999 and about.pivot is None
        assert np.isclose(*(np.linalg.norm(one.position - pivot) for one in (camera, turned)))
        d.rest()
        press(d, middle(d), button="RIGHT")
        drag(d, 30, 12)
        release(d, button="RIGHT")
        assert np.allclose(d.session.camera.forward, turned.forward)
        assert np.linalg.norm(d.session.camera.position - turned.position) > 1e-3
        speed, before = d.session.flight.state.speed, d.session.camera.position
        d.rest()
        d.point(*middle(d, 0.1, 0.0))
        d.app.input.on_scroll(d.app.window, 0.0, 1.0)
        d.settle()
        assert d.session.flight.state.speed == speed and np.linalg.norm(d.session.camera.position - before) > 1e-3
        start(d)
        d.key("T")  # a click still is the tool's
        d.rest()
        d.click(*middle(d, 0.05, 0.05))
        d.rest()
        assert len(d.app.toolbox.active.points) == 1
        d.double_click(*middle(d, -0.2, 0.0))
        d.key("ESCAPE")
        d.key("ESCAPE")
    finally:
        d.session.flight.mouse = "fly"
        while d.session.document.measurements:
            d.session.work.undo()


def check_a_double_click_flies_there_and_a_key_stops_it(d: Driver) -> None:
    start(d)
    camera = d.session.camera
    at = middle(d, 0.2, 0.0)
    d.double_click(*at)
    flight = d.session.flight
    assert flight.gliding
    d.picture("flying_there", settle=0)
    d.until(lambda: not flight.gliding, 20.0)
    d.rest()
    d.picture("flew_there")
    moved = d.session.camera
    assert np.linalg.norm(moved.position - camera.position) > 0.5
    ahead = moved.unproject([(moved.cx, moved.cy)], 1.0)[0] - moved.position
    assert np.abs(ahead).max() > 0.8, "it faces a wall of the room, or looks down on its floor"
    start(d)
    d.double_click(*at)
    d.key("F3")
    d.key("F3")
    assert not flight.gliding and not np.allclose(d.session.camera.position, moved.position)
    d.key("I")
    d.double_click(*at)
    assert not flight.gliding, "Inspect takes clicks"
    d.key("I")
    start(d)


def check_walking_keeps_to_the_floor_and_stops_at_walls(d: Driver) -> None:
    start(d)
    flight = d.session.flight
    speed = flight.state.speed
    d.key("G")
    d.until(lambda: flight.walker is not None, 30.0)
    d.until(lambda: not flight.moving)
    assert abs(flight.state.position[2] - 1.65) < 0.03 and flight.state.speed != speed
    d.rest()
    d.picture("walk")
    d.key("LEFT_SHIFT", "down")
    d.key("W", "down")
    end = time.monotonic() + 2.5
    d.until(lambda: time.monotonic() > end)
    d.key("W", "up")
    d.key("LEFT_SHIFT", "up")
    d.until(lambda: not flight.moving)
    d.picture("walked")
    x, y, z = flight.state.position
    assert 0.1 < x < 7.9 and 0.1 < y < 5.9 and abs(z - 1.65) < 0.05, "in the room"
    d.key("G")
    assert flight.walker is None and flight.state.speed == speed
    d.key("G")
    d.until(lambda: flight.walker is not None, 30.0)
    d.key("HOME")
    d.settle(2)
    assert flight.walker is None and any(toast.text == "Flying" for toast in d.session.notices.toasts)
    assert flight.state.speed == speed
