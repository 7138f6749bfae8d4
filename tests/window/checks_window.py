"""Checks of the window itself: its size, real keys from xdotool, the neural view, a flight's end."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
from driver import SIZE, Driver


def check_resizing_and_minimising(d: Driver) -> None:
    for size in ((517, 383), (333, 211)):
        d.resize(*size)
        assert d.bare().shape == (size[1], size[0], 3) and np.array_equal(d.bare(), d.rendered())
    d.app.input.window_events.on_resize(d.app.window, 0, 0)
    d.settle()
    d.key("F12")
    d.app.projects.remember(d.app.viewport.shown_picture())  # as it is when the window is closed by the screen's bar
    d.app.input.window_events.on_resize(d.app.window, 333, 211)
    d.resize(*SIZE)
    assert np.array_equal(d.bare(), d.rendered())


def check_real_key_press(d: Driver) -> None:
    assert shutil.which("xdotool"), "xdotool is missing: apt install xdotool"
    name = d.glfw.get_x11_window(d.app.window)
    subprocess.run(["xdotool", "windowfocus", "--sync", str(name)], check=True, timeout=10)
    d.settle()
    assert not d.session.help
    subprocess.run(["xdotool", "key", "F1"], check=True, timeout=10)
    d.until(lambda: d.session.help)
    subprocess.run(["xdotool", "key", "Escape"], check=True, timeout=10)
    d.until(lambda: not d.session.help)
    start = d.session.camera.position.copy()
    subprocess.run(["xdotool", "keydown", "w"], check=True, timeout=10)
    try:
        d.until(lambda: np.linalg.norm(d.session.camera.position - start) > 0.05)
    finally:
        subprocess.run(["xdotool", "keyup", "w"], check=True, timeout=10)
    d.until(lambda: not d.session.flight.state.moving)


def check_neural_view(d: Driver) -> None:
    d.key("4")
    assert d.session.view_settings.shown_settings.view == "neural"
    d.until(lambda: d.session.view_settings.network_load is None, 60.0)
    assert d.session.notices.message is None, d.session.notices.message
    d.rest()
    assert d.session.screen.drawn == ("neural",)
    assert d.session.picture.cost.facts.network, (d.session.screen.drawn, d.session.screen.approximations)
    assert np.array_equal(d.bare(), d.rendered())
    d.key("V")
    assert d.session.view_settings.sides == ("raw", "neural") and d.bare().std() > 5
    d.key("V")
    d.key("3")


def check_a_neural_flight_shows_the_last_neural_picture_moved(d: Driver) -> None:
    lod = d.session.picture.adaptive_lod
    d.key("4")
    d.until(lambda: d.session.view_settings.network_load is None, 60.0)
    d.rest()
    usual, learns, lod.keep_up = lod.network, lod.drew, False  # at full resolution, as a fast machine has it
    lod.network = lambda networks, *, moving, **rest: None if moving else usual(networks, moving=moving, **rest)  # as if slow
    lod.drew = lambda *cost, **how: (learns(*cost, **how), setattr(lod, "spare", True))  # and the pictures fast
    try:
        still = d.session.camera.position.copy()
        d.key("W", "down")
        d.until(lambda: (d.session.picture.moved or 0.0) > 0.3)
        assert "moved from the last neural picture" in "; ".join(d.session.screen.approximations)
        viewport = d.app.viewport
        filled = viewport.frame.image("filled").astype(int)
        moved = viewport._moved_frame.image("filled").astype(int)
        assert (np.abs(moved - filled).max(axis=-1) > 2).mean() > 0.05, "it is not the filled picture"
        d.until(lambda: viewport.moved.place is not None and np.linalg.norm(viewport.moved.place - still) > 0.02, 60.0)
        assert d.session.flight.moving, "the network made a picture beside the flight"
        d.key("W", "up")
    finally:
        del lod.network, lod.drew
        lod.keep_up = True
    d.rest()
    assert d.session.picture.moved is None and np.array_equal(d.bare(), d.rendered())
    d.key("3")
    d.key("HOME")


def check_a_flight_leaves_out_what_is_hidden_and_ends_exact(d: Driver) -> None:
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.render.culling import occlusion

    usual, occlusion.WORTH = occlusion.WORTH, 0.0  # this room is so light that looking for what is hidden would not pay
    d.session.view_settings.request(Settings(view="filled", raster="compute"))  # software OpenGL's own hides nothing
    d.key("W", "down")
    d.until(lambda: d.session.flight.moving and "hidden cells skipped" in d.session.screen.approximations)
    d.key("W", "up")
    occlusion.WORTH = usual
    assert np.array_equal(d.bare(), d.rendered()) and not d.session.screen.approximations
    d.session.view_settings.request(Settings(view="filled"))
    d.key("HOME")


def check_ctrl_c_in_what_glfw_calls_back_stops_the_window(d: Driver) -> None:
    import ctypes
    import signal

    ended = []

    @ctypes.CFUNCTYPE(None)
    def called_back():
        signal.raise_signal(signal.SIGINT)
        ended.append(True)

    usual, d.glfw.poll_events = d.glfw.poll_events, called_back
    try:
        d.app.step(wait=False)
        raise AssertionError("the window goes on")
    except KeyboardInterrupt:
        assert ended, "what a key does is done to its end"
    finally:
        d.glfw.poll_events = usual


def check_no_gl_error_is_left(d: Driver) -> None:
    assert d.app.context.error == "GL_NO_ERROR"


def check_a_key_is_answered_over_the_last_picture_before_the_next_is_made(d: Driver) -> None:
    d.key("2")
    d.rest()
    shown, order, viewport, session = d.canvas(), [], d.app.viewport, d.session
    paint, to_screen = viewport.paint, viewport.canvas.to_screen
    answers = []

    def followed() -> None:
        order.append("screen")
        answers.append(viewport.canvas.read())
        to_screen()

    viewport.canvas.to_screen, viewport.paint = followed, lambda: (order.append("picture"), paint())
    session.picture.cost = replace(session.picture.cost, total_ms=200.0)  # as on a slow machine
    try:
        for action in (d.glfw.PRESS, d.glfw.RELEASE):  # another view, and the help page over it
            for name in ("3", "F1"):
                key = getattr(d.glfw, f"KEY_{name}")
                d.app.input.on_key(d.app.window, key, d.glfw.get_key_scancode(key), action, 0)
        d.app.step(wait=False)
    finally:
        viewport.paint, viewport.canvas.to_screen = paint, to_screen
    assert order == ["screen", "picture", "screen"], order
    assert session.help and not np.array_equal(answers[0], shown), "the help page is there"
    corner = np.s_[150:350, 560:635]  # of the picture, beside the page and below the buttons
    assert np.array_equal(answers[0][corner], shown[corner]) and not np.array_equal(answers[1][corner], shown[corner])
    d.key("F1")


def check_an_open_question_takes_all_keys(d: Driver) -> None:
    from pointglass.viewer.window.kit.notices import Answer

    d.rest()
    given, session = [], d.session
    before = session.camera.position.copy(), session.view_settings.sides, d.app.toolbox.active, session.interface
    session.notices.ask("Go on?", "A question", (Answer("Go on", lambda: given.append("on")), Answer("Stop", lambda: None)))
    d.settle()
    subprocess.run(["xdotool", "windowfocus", "--sync", str(d.glfw.get_x11_window(d.app.window))], check=True, timeout=30)
    keys = ("1", "i", "x", "g", "v", "F10", "F1", "ctrl+z", "w", "Home", "Return")
    subprocess.run(["xdotool", "key", *keys], check=True, timeout=30)
    d.until(lambda: given == ["on"])  # Enter comes last
    assert session.notices.message is None and not session.help and session.flight.orthographic is None
    assert np.array_equal(before[0], session.camera.position) and not d.app.toolbox.fly.walk_mode.on
    assert before[1:] == (session.view_settings.sides, d.app.toolbox.active, session.interface)
