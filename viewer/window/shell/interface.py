"""Draws one frame of the interface: start page, overlays of the tools, panels, status bar, notices, dialogs, in this order."""

from typing import TYPE_CHECKING, Any, Protocol

from ..kit.overlay import OverlayCanvas
from ..panels import dialogs, hud
from ..panels.inspector import draw_inspector
from ..panels.outliner import draw_outliner
from ..panels.status_bar import draw_status_bar
from ..panels.tool_bar import draw_corner, draw_tool_bar
from ..panels.view_cube import draw_view_cube
from ..panels.view_switch import draw_view_switch
from .list_keys import keys_in_lists

if TYPE_CHECKING:
    from ...picture.drawn_lines import Area
    from ..file_dialog.choice_window import ChoiceWindow
    from ..file_dialog.file_dialogs import FileDialogs
    from ..interaction.tool import ToolContext
    from ..interaction.toolbox import Toolbox
    from ..kit.chosen_button import ChosenButton
    from ..kit.theme import Theme
    from ..panels.missing_scans import MissingScansDialog
    from ..panels.start_page import StartPage
    from ..session.project_flow import ProjectFlow
    from ..session.session import Session
    from ..viewport.viewport import Viewport
    from .actions import WindowActions
    from .input import Input

_CURSORS = {"arrow": "arrow", "crosshair": "none", "hand": "hand", "resize": "resize_ew"}
"""A tool's cursor -> imgui's name.  imgui has no crosshair: the overlay draws it."""


class Host(Protocol):
    """The parts of a window that the interface shows."""

    imgui: Any
    session: "Session"
    theme: "Theme"
    input: "Input"
    toolbox: "Toolbox"
    tools: "ToolContext"
    viewport: "Viewport"
    projects: "ProjectFlow"
    files: "FileDialogs"
    start_page: "StartPage"
    missing_scans: "MissingScansDialog"
    choice_window: "ChoiceWindow"
    chosen_button: "ChosenButton"

    @property
    def actions(self) -> "WindowActions": ...


def draw_interface(app: Host, *, shown: bool = True) -> None:
    """One frame of the interface.

    shown: draw it, too, and not only lay it out: imgui sizes a window by its text in the frame before.
    """
    with app.actions.drawing():
        _draw(app, shown=shown)


def _draw(app: Host, *, shown: bool) -> None:
    imgui, session, look = app.imgui, app.session, app.theme
    look.fallback.follow()
    keys_in_lists(imgui)
    imgui.backends.opengl3_new_frame()
    imgui.backends.glfw_new_frame()  # without it a layout's keys seem held since the frame before, and repeat
    imgui.new_frame()
    over = app.input.over_handle and not imgui.get_io().want_capture_mouse
    if over or session.dragging_handle:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
    elif session.pointer is not None and not imgui.get_io().want_capture_mouse:
        imgui.set_mouse_cursor(getattr(imgui.MouseCursor_, _CURSORS[app.toolbox.active.cursor]))
    if session.scene is None and session.loads.current is None and not session.help:
        app.start_page.draw(app.projects.offers, session.flight.mouse, app.actions, look)
    legend = None
    if session.interface and session.scene is not None:
        legend = _overlays(app)
        hud.draw_handle(session, look, hovered=over)
        hud.draw_scale_bar(session, look)
        draw_outliner(session, app.toolbox, app.tools, app.actions, look)
        draw_inspector(session, app.toolbox, app.tools, app.actions, look)
        draw_status_bar(session, look, fps=app.viewport.frame_rate)
        if not session.help:  # which covers the middle of the picture
            draw_tool_bar(session, app.toolbox, app.actions, look)
            draw_corner(session, app.actions, look)
            draw_view_cube(session, app.actions, look)
            draw_view_switch(session, app.actions, look)
            hud.draw_profiler(session, look, fps=app.viewport.frame_rate)
            hud.draw_recording(session, look)
            hud.draw_lost(session, app.actions, look)
    hud.draw_toasts(session, look, legend)  # with the interface hidden, too: they go by themselves
    dialogs.draw_help(session, look, app.input.keyboard.printed)
    dialogs.draw_load(session, app.actions, look)
    message = session.notices.message is not None
    app.missing_scans.draw(app, look, covered=message or app.files.choice is not None)
    app.choice_window.draw(app.files, look, covered=message)
    dialogs.draw_message(session, app.actions, look, app.chosen_button)
    imgui.render()
    if shown:
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())


def _overlays(app: Host) -> "Area | None":
    """Draws the overlays and the selected tool's marks over the picture.  Returns where the legend lies."""
    session = app.session
    camera = session.screen.camera  # the marks belong to the picture that they are drawn over
    place = session.area.place_of((camera.width, camera.height))
    left, top, width, height = (length / session.area.density for length in place)
    overlay = OverlayCanvas(app.imgui.get_background_draw_list(), camera, app.theme, (left, top, width, height))
    try:
        app.toolbox.draw(overlay, app.tools)
    finally:
        overlay.end()
    return overlay.legend
