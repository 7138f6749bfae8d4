"""Tools and overlays without a window: who receives an event, and where the camera puts a world point."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from window_session import session

from pointglass.viewer.picture.camera import Camera, look_at
from pointglass.viewer.window.interaction.fly import Fly
from pointglass.viewer.window.interaction.measuring.measure import Measure
from pointglass.viewer.window.interaction.table import TOOLS, toolbox
from pointglass.viewer.window.interaction.tool import KeyEvent, PointerEvent, Tool, ToolContext
from pointglass.viewer.window.interaction.toolbox import Toolbox
from pointglass.viewer.work.measuring.measurement import KINDS, MeasuredPoint


class Recorder(Tool):
    """Uses the kinds of event it is told to use, and keeps all it receives."""

    def __init__(self, name: str, *uses: str):
        self.name, self.uses, self.received = name, uses, []

    def pointer(self, event, context):
        self.received.append(event.kind)
        return event.kind in self.uses

    def key_event(self, event, context):
        return event.key == "DELETE"

    def left(self, context):
        self.received.append("left")


CONTEXT: Any = SimpleNamespace()


def events(box: Toolbox, *kinds):
    for kind in kinds:
        box.pointer(PointerEvent(kind, (1.0, 2.0), button="left"), CONTEXT)


def test_a_tool_that_uses_a_press_receives_everything_until_the_release():
    fly, measure = Recorder("fly", "press", "move", "wheel"), Recorder("measure", "press")
    box = Toolbox([fly, measure], [])
    box.select("measure", CONTEXT)
    events(box, "move", "press", "move", "wheel", "release", "move")
    assert measure.received == ["move", "press", "move", "wheel", "release", "move"]
    assert fly.received == ["left", "move", "move"] and not box.holding


def test_what_the_selected_tool_does_not_use_reaches_fly():
    fly, probe = Recorder("fly", "press"), Recorder("probe")
    box = Toolbox([fly, probe], [])
    box.select("probe", CONTEXT)
    events(box, "press", "move", "release")
    assert fly.received == ["left", "press", "move", "release"] and probe.received == ["press"]
    assert box.key_event(KeyEvent("DELETE", "press"), CONTEXT) and not box.key_event(KeyEvent("W", "press"), CONTEXT)


def test_selecting_the_active_tool_again_or_another_one_ends_what_it_had_begun():
    fly, measure = Recorder("fly"), Recorder("measure", "press")
    box = Toolbox([fly, measure], [])
    box.select("measure", CONTEXT)
    events(box, "press")
    box.select("measure", CONTEXT)
    assert box.active is fly and measure.received == ["press", "leave", "left"] and not box.holding


def test_a_click_does_not_turn_the_camera_and_a_drag_does():
    made, clock = session()
    captured = []
    context = ToolContext(made, Any, Any, set_captured=captured.append)  # type: ignore[arg-type]
    box, start = toolbox(), made.camera.forward
    for delta, kind in (((0.0, 0.0), "press"), ((1.0, 1.0), "move"), ((0.0, 0.0), "release")):
        box.pointer(PointerEvent(kind, (9.0, 9.0), delta, "left"), context)  # type: ignore[arg-type]
    made.advance()
    assert np.array_equal(made.camera.forward, start) and not captured
    for delta, kind in (((0.0, 0.0), "press"), ((30.0, 2.0), "move"), ((20.0, 0.0), "move")):
        box.pointer(PointerEvent(kind, (9.0, 9.0), delta, "right"), context)  # type: ignore[arg-type]
    clock.now += 0.1
    made.advance()
    assert made.camera.forward @ np.cross(start, [0, 0, 1]) > 0.1 and captured == [True]
    box.release(context)
    assert captured == [True, False] and not made.flight.looking


def test_every_tool_has_a_name_of_its_own_and_fly_is_first():
    assert TOOLS[0] is Fly and len({tool.name for tool in TOOLS}) == len(TOOLS)
    keys = [tool.key for tool in TOOLS if tool.key]
    assert len(keys) == len(set(keys)) and all(tool.label and tool.help for tool in TOOLS)


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.most != 1])
def test_measuring_says_at_the_pointer_what_a_click_does_and_when_enter_ends(kind):
    tool, context = Measure(), SimpleNamespace(document=SimpleNamespace(measurements=()))
    tool.kind, fewest, most = kind, KINDS[kind].fewest, KINDS[kind].most
    assert tool.hint(context) == f"Click {KINDS[kind].click(0)}"
    for placed in range(1, most or 5):
        tool.points.append(MeasuredPoint((float(placed), 0.0, 0.0)))
        text = tool.hint(context)
        assert text.startswith(("Click the ", "Click another ")) and text.endswith("Backspace takes one back  ·  Esc gives up")
        assert ("Enter ends" in text) == (most is None and placed >= fewest)
    context.document.measurements, tool.points = (SimpleNamespace(kind="distance"),), []
    known = tool.hint(context) == ""
    assert known == (not KINDS[kind].surfaces), "who has measured knows how to begin, not what is to be clicked"


@pytest.mark.parametrize("seed", range(5))
def test_project_and_unproject_are_inverse_and_agree_with_the_matrices(seed):
    rng = np.random.default_rng(seed)
    eye = rng.normal(size=3) * 1e5
    matrix = look_at(eye, eye + rng.normal(size=3))
    camera = Camera(641, 403, 500.0, 480.0, 300.3, 207.9, matrix)
    pixels, depth = rng.uniform(-200, 900, (50, 2)), rng.uniform(0.1, 80.0, 50)
    points = camera.unproject(pixels, depth)
    back, z = camera.project(points)
    assert np.allclose(back, pixels, atol=1e-5) and np.allclose(z, depth, atol=1e-8)
    x, y, w = (points - eye) @ matrix[:3, 0], -(points - eye) @ matrix[:3, 1], -(points - eye) @ matrix[:3, 2]
    assert np.allclose(back, np.stack([300.3 + 500 * x / w, 207.9 + 480 * y / w], axis=1), atol=1e-5)
    behind, depth = camera.project(2 * eye - points)
    assert np.isnan(behind).all() and (depth < 0).all()


class Picker(Recorder):
    """Picks by clicks; keeps its clicks and keys."""

    takes_clicks = picks = True

    def pointer(self, event, context):
        if event.kind == "release" and event.clicks:
            self.received.append(event.position)
        return False

    def key_event(self, event, context):
        self.received.append(event.key)
        return True


class Resting:
    """What a click waits for: the picture's state, as it is given here."""

    def __init__(self) -> None:
        self.scene, self.toasts = object(), []
        self.camera = Camera(40, 30, 30.0, 30.0, 20.0, 15.0, look_at((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
        self.viewport: Any = SimpleNamespace(frame=SimpleNamespace(facts=SimpleNamespace(points_missing=0)))
        self.session: Any = SimpleNamespace(flight=SimpleNamespace(moving=False), screen=SimpleNamespace(needs_picture=False),
                                            shown_scan=SimpleNamespace(touched=False))
        self.toast, self.wake = self.toasts.append, lambda: None


def click_at(box: Toolbox, context: Any, *places: float) -> None:
    for place in places:
        for kind, clicks in (("press", 0), ("release", 1)):
            box.pointer(PointerEvent(kind, (place, 2.0), button="left", clicks=clicks), context)  # type: ignore[arg-type]


@pytest.mark.parametrize("busy", ("no picture yet", "moving", "another picture to come", "points missing"))
def test_clicks_that_come_before_the_picture_is_at_rest_are_answered_in_order_when_it_is(busy):
    fly, picker, context = Recorder("fly"), Picker("picker"), Resting()
    box = Toolbox([fly, picker], [])
    box.select("picker", context)  # type: ignore[arg-type]
    frame = context.viewport.frame
    if busy == "no picture yet":
        context.viewport.frame = None
    context.session.flight.moving = busy == "moving"
    context.session.screen.needs_picture = busy == "another picture to come"
    frame.facts.points_missing = 5 if busy == "points missing" else 0
    click_at(box, context, 1.0, 2.0)
    assert box.key_event(KeyEvent("ENTER", "press"), context)  # type: ignore[arg-type]
    box.follow(context)  # type: ignore[arg-type]
    assert picker.received == []
    frame.facts.points_missing, context.viewport.frame = 0, frame
    context.session.flight.moving = context.session.screen.needs_picture = False
    click_at(box, context, 3.0)
    assert picker.received == [], "not before those that wait"
    box.follow(context)  # type: ignore[arg-type]
    assert picker.received == [(1.0, 2.0), (2.0, 2.0), "ENTER", (3.0, 2.0)] and not context.toasts


def test_a_click_is_answered_at_what_it_was_made_at_where_the_picture_has_another_size_meanwhile(seed):
    rng = np.random.default_rng(seed)
    for _ in range(20):
        fly, picker, context = Recorder("fly"), Picker("picker"), Resting()
        box = Toolbox([fly, picker], [])
        box.select("picker", context)  # type: ignore[arg-type]
        before = context.camera
        context.session.flight.moving = True
        at = float(rng.uniform(0, before.width)), 2.0
        box.pointer(PointerEvent("release", at, button="left", clicks=1), context)  # type: ignore[arg-type]
        assert context.session.shown_scan.touched
        context.camera = before.resized(*rng.integers(20, 60, 2).tolist())
        context.session.flight.moving = False
        box.follow(context)  # type: ignore[arg-type]
        (column, row), _ = (value[0] for value in context.camera.project(before.unproject(np.array([at]), np.ones(1))))
        if 0 <= column <= context.camera.width and 0 <= row <= context.camera.height:
            assert picker.received[0] == pytest.approx((column, row)) and not context.toasts
        else:
            assert not picker.received and "click again" in context.toasts[0]


def test_a_click_whose_picture_has_moved_away_is_not_answered_and_a_line_says_so():
    fly, picker, context = Recorder("fly"), Picker("picker"), Resting()
    box = Toolbox([fly, picker], [])
    box.select("picker", context)  # type: ignore[arg-type]
    context.session.flight.moving = True
    click_at(box, context, 1.0)
    context.camera = replace(context.camera, camera_to_world=look_at((1.0, 0.0, 0.0), (1.0, 1.0, 0.0)))
    context.session.flight.moving = False
    box.follow(context)  # type: ignore[arg-type]
    assert picker.received == [] and "click again" in context.toasts[0]
    click_at(box, context, 4.0)
    assert picker.received == [(4.0, 2.0)]
