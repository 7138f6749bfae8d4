"""Checks of the layout: panels fold, the picture has the space they leave, the view switch tells what is drawn, status bar."""

import time

import numpy as np
from driver import SIZE, Driver


def check_the_picture_has_the_space_that_the_panels_leave(d: Driver) -> None:
    d.resize(1200, 500)
    assert d.session.area.panels.scenes and d.session.area.panels.look, "there is room"
    wide = d.session.area.size
    assert d.session.area.origin == (232, 0) and wide == (1200 - 232 - 316, 500 - 30)
    assert (d.session.camera.width, d.session.camera.height) == wide
    d.session.area.panels.look = False
    d.rest()
    assert d.session.area.size[0] == 1200 - 232 - 44
    left, (width, height) = d.session.area.origin[0], d.session.area.size
    frame = d.app.viewport.frame
    picture = d.app.viewport.full_picture()
    assert frame is not None and picture is not None and picture.shape == (height, width, 3)
    d.session.notices.toasts = []
    shown = d.canvas()[60:height - 60, left + 20 : left + width - 20]
    assert np.array_equal(shown, picture[60:height - 60, 20 : width - 20]), "nothing lies over the middle of the picture"
    d.session.area.panels.look = True


def check_panels_fold_where_the_window_becomes_narrow(d: Driver) -> None:
    d.resize(890, 400)
    panels = d.session.area.panels
    assert not panels.scenes and not panels.look
    assert d.session.area.size[0] == 890 - 88
    panels.look = True
    d.settle()
    assert d.session.area.size[0] == 890 - 44 - 316
    d.resize(500, 400)
    assert panels.look and d.session.area.size[0] == 500 - 88, "too narrow for both: the panel lies over the picture"
    panels.look = False
    d.resize(1200, 500)
    assert panels.scenes and panels.look, "there is room again"


def check_a_tool_of_the_folded_panel_opens_it_for_its_controls(d: Driver) -> None:
    """All icons of the folded panel lie above the status bar, also of a low window."""
    d.resize(890, 600)
    d.key("ESCAPE")
    panels = d.session.area.panels
    assert not panels.scenes
    pitch = (600 - 30 - 12) / (len(d.app.toolbox.tools) + 4)
    d.click(22, 6 + 3.5 * pitch)  # the second tool: unfold, open and Fly come before
    assert panels.scenes and d.app.toolbox.active is d.app.toolbox.tools[1]
    d.key("ESCAPE")
    panels.scenes = False
    d.resize(1200, 500)
    assert panels.scenes and panels.look


def check_the_view_switch_changes_the_view_and_tells_what_is_drawn(d: Driver) -> None:
    d.resize(1200, 500)
    d.key("3")
    d.rest()
    camera = d.session.camera
    middle = 232 + (1200 - 232 - 316) / 2
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
    d.click(1100, 48)  # the network's quality
    assert listed()
    d.key("ESCAPE")
    assert not listed() and d.session.area.panels.look and d.session.interface and not d.app.closing


def check_text_typed_into_a_slider_that_is_no_number_changes_nothing(d: Driver) -> None:
    from pointglass.viewer.window.kit import widgets
    from pointglass.viewer.window.panels import look_panel

    before, usual = d.session.view_settings.settings, widgets.imgui.slider_float
    header = look_panel.imgui.collapsing_header
    widgets.imgui.slider_float = lambda *_: (True, float("nan"))  # as imgui does where one types "nan"
    look_panel.imgui.collapsing_header = lambda *_: True
    try:
        d.settle()
    finally:
        widgets.imgui.slider_float, look_panel.imgui.collapsing_header = usual, header
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
