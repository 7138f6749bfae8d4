"""Checks of the window itself: its size, real keys from xdotool, the panel, the network's view, a flight's end."""

import shutil
import subprocess

import numpy as np
from driver import SIZE, Driver


def check_resizing_and_minimising(d: Driver) -> None:
    for size in ((517, 383), (333, 211)):
        d.glfw.set_window_size(d.app.window, *size)
        d.until(lambda size=size: d.session.size == size)
        assert d.bare().shape == (size[1], size[0], 3) and np.array_equal(d.bare(), d.rendered())
    d.app.input.on_resize(d.app.window, 0, 0)
    d.settle()
    d.key("F12")
    d.app.input.on_resize(d.app.window, 333, 211)
    d.glfw.set_window_size(d.app.window, *SIZE)
    d.until(lambda: d.session.size == SIZE)
    assert np.array_equal(d.bare(), d.rendered())


def check_real_key_press(d: Driver) -> None:
    assert shutil.which("xdotool"), "xdotool is missing: apt install xdotool"
    name = d.glfw.get_x11_window(d.app.window)
    subprocess.run(["xdotool", "windowfocus", "--sync", str(name)], check=True, timeout=10)
    d.settle()
    assert not d.session.help
    subprocess.run(["xdotool", "key", "F1"], check=True, timeout=10)
    d.until(lambda: d.session.help, 5.0)
    subprocess.run(["xdotool", "key", "Escape"], check=True, timeout=10)
    d.until(lambda: not d.session.help, 5.0)
    start = d.session.camera.position.copy()
    subprocess.run(["xdotool", "keydown", "w"], check=True, timeout=10)
    try:
        d.until(lambda: np.linalg.norm(d.session.camera.position - start) > 0.05, 5.0)
    finally:
        subprocess.run(["xdotool", "keyup", "w"], check=True, timeout=10)
    d.until(lambda: not d.session.flight.state.moving, 5.0)


def check_panel_folds_and_its_buttons_work(d: Driver) -> None:
    def click(x, y):
        d.point(x, y)
        d.button(d.glfw.PRESS)
        d.button(d.glfw.RELEASE)
        d.settle()

    d.key("3")
    camera = d.session.camera
    click(590, 28)
    assert d.session.panel
    before = d.canvas()
    click(363, 64)  # the first of the four views
    assert d.session.view_settings.settings.view == "raw" and not np.array_equal(before, d.canvas())
    assert np.array_equal(camera.camera_to_world, d.session.camera.camera_to_world), "a click on the panel looks around"
    d.session.panel = False


def check_a_list_of_choices_closes_with_esc_and_its_hints_hide_none_of_it(d: Driver) -> None:
    from imgui_bundle import imgui

    def listed() -> bool:
        return imgui.is_popup_open("", imgui.PopupFlags_.any_popup)

    d.glfw.set_window_size(d.app.window, 900, 400)
    d.until(lambda: d.session.size == (900, 400))
    d.session.panel = True
    d.point(800, 190)  # the filter's presets
    d.button(d.glfw.PRESS)
    d.button(d.glfw.RELEASE)
    d.settle()
    assert listed()
    d.point(800, 281)
    d.until(lambda: np.ptp(d.canvas()[276:296, 300:560], axis=(0, 1)).min() > 100, 5.0)  # its hint's text, beside the panel
    d.key("ESCAPE")
    assert not listed() and d.session.panel and d.session.interface and not d.app.closing
    d.session.panel = False
    d.glfw.set_window_size(d.app.window, *SIZE)
    d.until(lambda: d.session.size == SIZE)


def check_what_is_typed_into_a_slider_and_is_no_number_changes_nothing(d: Driver) -> None:
    from viewer.window import panels

    before, usual = d.session.view_settings.settings, panels.imgui.slider_float
    panels.imgui.slider_float = lambda *_: (True, float("nan"))  # as imgui does, where one types "nan"
    d.session.panel = True
    try:
        d.settle()
    finally:
        panels.imgui.slider_float, d.session.panel = usual, False
    assert d.session.view_settings.settings == before


def check_the_panel_folds_where_the_window_becomes_too_narrow(d: Driver) -> None:
    def resize(*size):
        d.glfw.set_window_size(d.app.window, *size)
        d.until(lambda: d.session.size == size)

    resize(900, 400)
    d.session.panel = True
    resize(880, 400)
    assert d.session.panel, "there is room"
    resize(330, 240)
    assert not d.session.panel
    resize(900, 400)
    assert d.session.panel, "there is room again"
    d.session.panel = False
    resize(330, 240)
    resize(900, 400)
    assert not d.session.panel, "it had not been open"
    d.session.panel = True
    resize(330, 240)
    d.session.panel = True  # brought back by hand: it stays
    resize(320, 240)
    assert d.session.panel
    picture, shown = d.bare(), d.canvas()
    changed = np.flatnonzero((picture != shown).any(axis=(0, 2)))
    assert changed[0] >= 10 and changed[-1] <= 320 - 10, "it keeps within the window, and the figures make room for it"
    d.session.panel = False
    resize(*SIZE)


def check_neural_view(d: Driver) -> None:
    d.key("4")
    assert d.session.view_settings.shown_settings.view == "neural"
    d.until(lambda: d.session.view_settings.network_load is None, 60.0)
    assert d.session.notices.message is None, d.session.notices.message
    d.until(lambda: d.session.drawn == ("neural",) and not d.session.needs_picture)  # not the filled one of a size just changed
    assert d.session.picture.stats["network"], (d.session.drawn, d.session.approximations)
    assert np.array_equal(d.bare(), d.rendered())
    d.key("V")
    assert d.session.view_settings.sides == ("raw", "neural") and d.bare().std() > 5
    d.key("V")
    d.key("3")


def check_a_flight_leaves_out_what_is_hidden_and_ends_exact(d: Driver) -> None:
    from viewer.render import occlusion

    usual, occlusion.WORTH = occlusion.WORTH, 0.0  # this room is so light that looking for what is hidden would not pay
    d.key("3")
    d.key("W", "down")
    d.until(lambda: d.session.flight.moving and "hidden cells skipped" in d.session.approximations)
    d.key("W", "up")
    occlusion.WORTH = usual
    assert np.array_equal(d.bare(), d.rendered()) and not d.session.approximations
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
