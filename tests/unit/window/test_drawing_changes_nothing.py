"""Panels, overlays and tools draw what a session holds and change nothing of it while nobody acts."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from window_session import frame_cost, session

from pointglass.viewer.picture.clip import Box
from pointglass.viewer.window.interaction.table import TOOLS, toolbox
from pointglass.viewer.window.interaction.tool import ToolContext
from pointglass.viewer.window.kit.notices import Answer, KeepAsScanned, ScanNotice
from pointglass.viewer.window.session.time_recording import FrameTimes
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement

imgui = pytest.importorskip("imgui_bundle", reason="the window's packages are not installed").imgui


class NoActions:
    """Nobody acts: any action is an error."""

    def __getattr__(self, name):
        return lambda *given: pytest.fail(f"drawing acts: {name}{given}")


def snapshot(made) -> dict:
    """The public fields of a session and its parts: numbers, texts, records and arrays by value, other objects by identity."""
    parts = {"session": made, **{name: getattr(made, name) for name in (
        "area", "notices", "loads", "flight", "shown_scan", "picture", "view_settings", "work")},
        "panels": made.area.panels, "adaptive_lod": made.picture.adaptive_lod}  # fmt: skip

    def value(found):
        if isinstance(found, np.ndarray):
            return found.tobytes()
        if isinstance(found, (list, tuple, set, frozenset)):
            return type(found).__name__, [value(each) for each in found]
        return found if isinstance(found, (bool, int, float, str, type(None))) else id(found)

    fields = {f"{part}.{name}": value(found) for part, owner in parts.items() for name, found in vars(owner).items()
              if not name.startswith("_")}
    return fields | {"document": id(made.document), "camera": made.camera.position.tobytes()}


@pytest.fixture
def look():
    from pointglass.viewer.window.kit.theme import Theme

    context = imgui.create_context()
    io = imgui.get_io()
    io.set_ini_filename("")
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.display_size = (1280, 720)
    yield Theme(1.0)
    imgui.destroy_context(context)


@pytest.fixture
def made():
    """A session in which everything that can be shown is there."""
    found, _ = session()
    found.resize((1280, 720))
    found.arrange(1.0)
    points = [MeasuredPoint(p, 0.01, 0.001, "a scan that was removed") for p in ((0.0, 0.0, 0.0), (1.0, 2.0, 0.5))]
    found.work.edit("all", clips=(Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), name="Box"),),
                    measurements=(Measurement("distance", tuple(points), "Distance"),))
    found.advance()
    spent = frame_cost(raster=2.0, facts={"points_total": 4_000, "device": "cpu", "bridge": "none"})
    found.drew(found.screen.plan, spent)
    found.notices.of_scan = [ScanNotice("a notice", KeepAsScanned())]
    found.notices.toast("a toast")
    found.notices.tell_saved(Path("a folder/a picture.png"))
    found.view_settings.compare(True)
    found.help = found.profiler = found.lost = True
    found.recording = FrameTimes()
    return found


def twice(draw) -> None:
    for _ in range(2):
        imgui.new_frame()
        draw()
        imgui.end_frame()


def unchanged(made, draw) -> None:
    before = snapshot(made)
    twice(draw)
    after = snapshot(made)
    assert {name: (before.get(name), after.get(name)) for name in before | after if before.get(name) != after.get(name)} == {}


def context_of(made, look) -> tuple[ToolContext, Any]:
    from pointglass.viewer.window.file_dialog.file_dialogs import FileDialogs

    viewport: Any = SimpleNamespace(frame=None, frame_camera=None, photos=SimpleNamespace(psnr=None), renderer=None)
    context, box = ToolContext(made, viewport, look), toolbox()
    context.files = FileDialogs()
    job = SimpleNamespace(title="Rendering", label="frames", fraction=0.5, total=2, seconds_left=3.0, cancelled=False)
    saves: Any = SimpleNamespace(workers=[job])
    context.saves = saves
    return context, box


@pytest.mark.parametrize("folded", [False, True])
def test_panels(made, look, folded):
    from pointglass.viewer.window.kit.chosen_button import ChosenButton
    from pointglass.viewer.window.panels import dialogs, hud
    from pointglass.viewer.window.panels.inspector import draw_inspector
    from pointglass.viewer.window.panels.outliner import draw_outliner
    from pointglass.viewer.window.panels.status_bar import draw_status_bar
    from pointglass.viewer.window.panels.tool_bar import draw_corner, draw_tool_bar
    from pointglass.viewer.window.panels.view_switch import draw_view_switch

    made.area.panels.outliner = made.area.panels.inspector = not folded
    made.arrange(1.0)
    (context, box), actions = context_of(made, look), NoActions()
    unchanged(made, lambda: draw_outliner(made, box, context, actions, look))
    unchanged(made, lambda: draw_inspector(made, box, context, actions, look))
    unchanged(made, lambda: draw_tool_bar(made, box, actions, look))
    unchanged(made, lambda: draw_corner(made, actions, look))
    unchanged(made, lambda: draw_status_bar(made, look, fps=None))
    unchanged(made, lambda: draw_view_switch(made, actions, look))
    unchanged(made, lambda: hud.draw_profiler(made, look, fps=12.0))
    unchanged(made, lambda: hud.draw_handle(made, look, hovered=True))
    unchanged(made, lambda: hud.draw_toasts(made, look))
    unchanged(made, lambda: hud.draw_recording(made, look))
    unchanged(made, lambda: hud.draw_lost(made, actions, look))
    unchanged(made, lambda: dialogs.draw_help(made, look, lambda control: control.name))
    made.loads.current = SimpleNamespace(title="Opening", fraction=0.5, label="reading", finished=False)
    unchanged(made, lambda: dialogs.draw_load(made, actions, look))
    made.notices.ask("Question?", "text", (Answer("Yes"), Answer("No")))
    unchanged(made, lambda: dialogs.draw_message(made, actions, look, ChosenButton()))


@pytest.mark.parametrize("name", [tool.name for tool in TOOLS])
def test_tools(made, look, name):
    from pointglass.viewer.window.kit.overlay import OverlayCanvas

    context, box = context_of(made, look)
    if name != box.active.name:
        box.select(name, context)
    box.follow(context)

    def draw():
        imgui.begin("tool")
        box.active.panel(imgui, context)
        imgui.end()
        overlay = OverlayCanvas(imgui.get_background_draw_list(), made.camera, look, (0.0, 0.0, 1280.0, 720.0))
        box.draw(overlay, context)
        overlay.end()

    unchanged(made, draw)


def test_a_snapshot_sees_what_a_drawing_could_write(made, look):
    for write in (lambda: setattr(made, "help", False), lambda: setattr(made.work, "under_pointer", object()),
                  lambda: made.notices.toast("again"), lambda: made.work.edit("a step", up=(0.0, 1.0, 0.0)),
                  lambda: setattr(made.area.panels, "look", False)):
        with pytest.raises(AssertionError):
            unchanged(made, write)


def test_messages_leave_the_legend_free(made, look):
    from pointglass.viewer.window.panels import hud

    area = made.area.layout.picture
    made.notices.toast("a line that is as wide as lines of messages are, " * 3)
    for wide in (250.0, area.width - 200.0):  # beside it, and above it where there is little room
        legend = area.left + 14.0, area.top + area.height - 83.0, wide, 69.0
        twice(lambda legend=legend: hud.draw_toasts(made, look, legend))
        for number in range(len(made.notices.toasts)):
            shown = imgui.internal.find_window_by_name(f"toast{number}")
            beside = shown.pos.x >= legend[0] + wide and shown.pos.x + shown.size.x <= area.right
            assert beside or shown.pos.y + shown.size.y <= legend[1]
