"""Checks of the layout: panels fold, the picture has the space they leave, the view switch tells what is drawn, status bar."""

import time
from dataclasses import replace

import numpy as np
import pytest
from driver import SIZE, Driver
from items import Items

from pointglass.viewer.window.kit import icons


def check_the_picture_has_the_space_that_the_panels_leave(d: Driver) -> None:
    d.resize(1200, 500)
    assert d.session.area.panels.outliner and d.session.area.panels.inspector, "there is room"
    wide = d.session.area.size
    outliner, inspector = d.session.area.layout.outliner, d.session.area.layout.inspector
    assert outliner is not None and inspector is not None
    assert d.session.area.origin == (round(outliner.right), 0)
    assert wide == (round(inspector.left) - round(outliner.right), 500 - 30)
    assert (d.session.camera.width, d.session.camera.height) == wide
    d.session.area.panels.inspector = False
    d.rest()
    assert d.session.area.size[0] == 1200 - round(outliner.right)
    left, (width, height) = d.session.area.origin[0], d.session.area.size
    frame = d.app.viewport.frame
    picture = d.app.viewport.full_picture()
    assert frame is not None and picture is not None and picture.shape == (height, width, 3)
    d.session.notices.toasts = []
    shown = d.canvas()[60:height - 60, left + 60 : left + width - 60].copy()
    picture = picture[60:height - 60, 60 : width - 60].copy()
    shown[:46, -98:] = picture[:46, -98:] = 0  # the view cube, which reaches a little farther from the corner
    assert np.array_equal(shown, picture), "nothing lies over the middle of the picture"
    d.session.area.panels.inspector = True


def check_panels_fold_where_the_window_becomes_narrow(d: Driver) -> None:
    d.resize(890, 400)
    panels = d.session.area.panels
    assert not panels.outliner and not panels.inspector
    assert d.session.area.size[0] == 890
    panels.inspector = True
    d.settle()
    assert d.session.area.size[0] == 890 - 216
    d.resize(500, 400)
    assert panels.inspector and d.session.area.size[0] == 500, "too narrow for both: the panel lies over the picture"
    panels.inspector = False
    d.resize(1200, 500)
    assert panels.outliner and panels.inspector, "there is room again"


def check_a_tool_of_the_icon_bar_opens_the_folded_panel_with_its_controls(d: Driver) -> None:
    """All icons lie above the status bar, also of a low window."""
    panels, items = d.session.area.panels, Items(d)
    for height in (600, 330):
        d.resize(890, height)
        d.key("ESCAPE")
        panels.outliner = panels.inspector = False
        d.settle()
        (_, bottom) = items.find(f"{icons.SIDES}##sides")[1]
        assert bottom < height - 30
        items.click(f"{icons.INSPECT}##inspect")
        assert panels.inspector and d.app.toolbox.active is d.app.toolbox.tools[1]
        panels.inspector = False
        d.key("T")
        assert panels.inspector and d.app.toolbox.active.name == "measure", "so does its key"
        panels.inspector = False
        d.settle()
        items.click(f"{icons.OUTLINER}##outliner")
        assert panels.outliner
        items.click(f"{icons.FOLD_LEFT}##fold outliner")
        assert not panels.outliner
    d.key("ESCAPE")
    d.resize(1200, 500)
    assert panels.outliner and panels.inspector


def check_the_notice_about_a_dark_scan_goes_once_it_is_brightened_and_comes_back_with_undo(d: Driver) -> None:
    from pointglass.viewer.window.flight.start_viewpoint import darkness
    from pointglass.viewer.window.session.scan_notice_actions import current_notices

    d.resize(1200, 500)
    session, items = d.session, Items(d)
    seen = session.shown_scan._seen
    assert seen is not None
    session.shown_scan._seen = dark = replace(seen, brightness=0.1)
    notice = darkness(dark)
    assert notice is not None
    session.notices.of_scan = [notice]
    items.click("Brighten")
    d.settle()
    assert session.document.look.exposure == session.shown_scan.exposure and current_notices(session) == []
    with pytest.raises(AssertionError, match="no item 'Brighten'"):
        items.find("Brighten")
    session.work.undo()
    items.find("Brighten")
    session.shown_scan._seen, session.notices.of_scan = seen, []
    d.rest()


def check_the_icon_bar_looks_from_a_side(d: Driver) -> None:
    d.resize(1200, 500)
    items = Items(d)
    items.click(f"{icons.SIDES}##sides")
    items.click("Top")
    d.rest()
    assert d.session.flight.state.forward[2] < -0.999
    items.click(f"{icons.HOME}##home")
    d.rest()
    flight = d.session.flight
    assert np.allclose(flight.state.position, flight.home.position) and np.allclose(flight.state.forward, flight.home.forward)


def check_buttons_that_take_the_scan_away_act_when_the_interface_has_been_drawn(d: Driver) -> None:
    d.resize(1200, 500)
    scan = d.session.shown_scan.paths
    Items(d).click(f"{icons.REMOVE}##close_scan")
    assert d.session.scene is None
    d.drop(*scan)
    d.until(lambda: d.session.scene is not None and d.session.loads.current is None and not d.session.shown_scan.preview)
    d.rest()


def check_the_outliner_shows_hides_renames_and_deletes_what_was_made(d: Driver) -> None:
    d.resize(1200, 500)
    items, work = Items(d), d.session.work
    d.key("B")
    items.click("+ Box")
    d.key("ESCAPE")
    assert d.session.document.clips[0].active
    items.click(f"{icons.SHOWN}##shown")
    assert not d.session.document.clips[0].active
    items.click("##row")
    assert d.app.toolbox.active.name == "clip", "a click on a row selects its tool"
    d.key("ESCAPE")  # the tool's panel has a button of that name, too
    items.click("##row", button=d.glfw.MOUSE_BUTTON_RIGHT)
    items.click("Delete")
    assert not d.session.document.clips
    work.undo()
    assert len(d.session.document.clips) == 1
    while d.session.document.clips:
        work.undo()
    d.key("ESCAPE")


def check_the_view_switch_changes_the_view_and_tells_what_is_drawn(d: Driver) -> None:
    d.resize(1200, 500)
    d.key("3")
    d.rest()
    camera = d.session.camera
    middle = d.session.area.origin[0] + d.session.area.size[0] / 2
    d.click(middle - 130, 28)  # the first of four segments
    assert d.session.view_settings.settings.view == "raw"
    assert np.array_equal(camera.camera_to_world, d.session.camera.camera_to_world), "a click on the interface looks around"
    d.rest()
    assert d.session.screen.drawn == ("raw",)
    d.key("3")


def check_the_point_under_the_pointer_is_measured(d: Driver) -> None:
    d.rest()
    left, top = d.session.area.origin
    width, height = d.session.area.size
    for _ in range(3):
        d.point(left + width / 2, top + height / 2)
    point = d.session.point
    assert point is not None
    walls = np.minimum(np.abs(point), np.abs(point - (8.0, 6.0, 3.0))).min()
    assert walls < 0.12, f"{point} lies on no wall"
    d.point(10, 300)
    d.settle()
    assert d.session.pointer is None or d.session.point is None


def check_a_list_of_choices_closes_with_esc(d: Driver) -> None:
    from imgui_bundle import imgui

    def listed() -> bool:
        return imgui.is_popup_open("", imgui.PopupFlags_.any_popup)

    d.resize(1200, 500)
    Items(d).click("##quality")
    assert listed()
    d.key("ESCAPE")
    assert not listed() and d.session.area.panels.inspector and d.session.interface and not d.app.closing


def check_text_typed_into_a_slider_that_is_no_number_changes_nothing(d: Driver) -> None:
    from pointglass.viewer.window.kit import widgets
    from pointglass.viewer.window.panels import look_panel

    before, usual = d.session.view_settings.settings, widgets.imgui.slider_float
    header = look_panel.section
    widgets.imgui.slider_float = lambda *_: (True, float("nan"))  # as imgui does where one types "nan"
    look_panel.section = lambda *_: True
    try:
        d.settle()
    finally:
        widgets.imgui.slider_float, look_panel.section = usual, header
    assert d.session.view_settings.settings == before


def check_nothing_in_sight_says_how_to_get_back(d: Driver) -> None:
    from pointglass.viewer.window.flight.navigation import view_along

    d.rest()
    assert not d.session.lost
    start = d.session.flight.state
    d.session.flight.go(view_along((-60.0, 3.0, 1.0), (-1.0, 0.0, 0.0), start.speed))
    d.session.picture.renew()
    d.rest()
    assert d.session.lost
    shown = d.canvas()
    assert np.linalg.norm(d.session.flight.direction_to_middle(d.session.camera)) > 0.99
    d.key("HOME")
    d.rest()
    assert not d.session.lost and not np.array_equal(shown, d.canvas())


def check_input_is_answered_while_a_slow_network_runs(d: Driver) -> None:
    from pointglass.viewer.render.network import neural

    d.resize(*SIZE)
    loaded = neural.NeuralStage._run
    calls = []

    def slow(stage):
        network = loaded.fget(stage)  # type: ignore[attr-defined]

        class Slow:
            device = network.device

            def __call__(self, packed):
                time.sleep(0.8)
                calls.append(1)
                return network(packed)

        return Slow()

    neural.NeuralStage._run = property(slow)  # type: ignore[assignment,method-assign]
    try:
        d.key("4")
        d.until(lambda: d.session.view_settings.network_load is None, 60.0)
        d.until(lambda: d.session.picture.pending is not None, 30.0)
        latencies = []
        while d.session.picture.pending is not None and len(latencies) < 400:
            begun = time.perf_counter()
            d.app.input.on_key(d.app.window, d.glfw.KEY_F1, 0, d.glfw.PRESS, 0)
            d.app.step(wait=False)
            latencies.append(time.perf_counter() - begun)
        d.session.help = False
        assert latencies, "the network was over before anything was pressed"
        late = float(np.percentile(latencies, 95)) * 1e3
        (d.folder / "latency.txt").write_text(f"{late:.1f} ms at p95 of {len(latencies)} events\n")
        assert late < 250.0, f"{late:.0f} ms at p95"
        d.rest()
        assert d.session.screen.drawn == ("neural",) and len(calls) == 1, f"one final pass, not {len(calls)}"
        d.session.flight.held.add("forward")
        d.settle(3)
        assert d.session.screen.drawn == ("filled",), "in flight nothing waits for a slow network"
        d.session.flight.held.clear()
        d.rest()
        assert d.session.screen.drawn == ("neural",)
    finally:
        neural.NeuralStage._run = loaded  # type: ignore[method-assign]
    d.key("3")
    d.key("HOME")
