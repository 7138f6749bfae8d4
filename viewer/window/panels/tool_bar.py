"""The icon bar at the picture's left edge: one icon a tool, viewpoints, and what opens a folded panel.

It lies over the picture.  Where the window is too low for one column of icons, they get smaller, then stand in two.
"""

from math import ceil

from imgui_bundle import ImVec2, imgui

from ..flight.framing import SIDES
from ..interaction.tool import Tool
from ..interaction.toolbox import Toolbox
from ..kit import icons, theme
from ..kit.layout import Rect
from ..kit.theme import Theme, packed
from ..kit.widgets import DOCKED, hint, icon_button
from ..session.panel_actions import Actions
from ..session.scan_notice_actions import current_notices
from ..session.session import Session

_BUTTON, _LEAST_BUTTON, _GAP, _PAD, _AWAY = 32.0, 18.0, 4.0, 4.0, 10.0
"""Side of a button, its least side, between groups of buttons, around them, and to the picture's edge; design units."""
WIDTH = _BUTTON + 2 * _PAD + _AWAY
"""What the bar takes of the picture's left edge, design units."""


def explained(tool: Tool) -> str:
    """The tooltip of a tool's button."""
    return tool.label + (f" ({tool.key})" if tool.key else "") + f"\n{tool.help[:1].upper()}{tool.help[1:]}"


def draw_tool_bar(session: Session, toolbox: Toolbox, actions: Actions, style: Theme) -> None:
    """Top left of the part of the picture that no panel covers."""
    area, px = session.area.layout.uncovered, style.px
    folded = not session.area.panels.outliner
    gaps = 1 + folded
    room = area.height - 2 * px(_AWAY) - 2 * px(_PAD) - 2 * gaps * px(_GAP)
    rows = {columns: folded + ceil(len(toolbox.tools) / columns) + ceil(4 / columns) for columns in (1, 2)}
    columns = 1 if room / rows[1] >= px(_LEAST_BUTTON) else 2
    side = max(min(px(_BUTTON), room / rows[columns]), px(_LEAST_BUTTON))
    tall = rows[columns] * side + 2 * gaps * px(_GAP)
    _begin("tool bar", Rect(area.left + px(_AWAY), area.top + px(_AWAY), columns * side, tall), style)
    if folded:
        if icon_button(f"{icons.OUTLINER}##outliner", "Show what is open and what was made of it", style, side=side):
            actions.fold("outliner", False)
        if current_notices(session):
            corner = imgui.get_item_rect_max()
            dot = ImVec2(corner.x - px(5), imgui.get_item_rect_min().y + px(5))
            imgui.get_window_draw_list().add_circle_filled(dot, px(4), packed(theme.WARN), 16)
        _gap(style)
    for number, tool in enumerate(toolbox.tools):
        _column(number, columns)
        icon = tool.icon or tool.label[:1]
        if icon_button(f"{icon}##{tool.name}", explained(tool), style, side=side, lit=tool is toolbox.active):
            actions.select_tool(tool.name)
    _gap(style)
    if icon_button(f"{icons.HOME}##home", "Back to the start viewpoint (Home)", style, side=side):
        actions.do("home")
    _column(1, columns)
    if icon_button(f"{icons.FRAME}##frame", "See the whole scene from here (F)", style, side=side):
        actions.do("frame")
    if icon_button(f"{icons.SIDES}##sides", "The whole scene from above, the front, the side, a corner", style, side=side):
        imgui.open_popup("sides")
    _column(3, columns)
    parallel = session.flight.orthographic is not None
    said = "Perspective" if parallel else "Orthographic: parallel rays, one scale, a scale bar"
    if icon_button(f"{icons.ORTHOGRAPHIC}##orthographic", f"{said} (X)", style, side=side, lit=parallel):
        actions.do("orthographic")
    _sides(session, actions, style)
    _end()


def draw_corner(session: Session, actions: Actions, style: Theme) -> None:
    """Top right of the picture: help, the profiler, and what opens the folded inspector."""
    area, px = session.area.layout.uncovered, style.px
    folded = not session.area.panels.inspector
    side, number = px(_BUTTON), 2 + folded
    left = area.right - px(_AWAY) - side - 2 * px(_PAD)
    _begin("corner", Rect(left, area.top + px(_AWAY), side, number * side), style)
    if folded and icon_button(f"{icons.INSPECTOR}##inspector", "Show the tool's controls and how the picture is made", style,
                              side=side):  # fmt: skip
        actions.fold("inspector", False)
    if icon_button(f"{icons.HELP}##help", "Keys and mouse (F1)", style, side=side):
        actions.do("help")
    lit = session.profiler
    if icon_button(f"{icons.PROFILER}##profiler", "Where the time of a frame goes (F3)", style, side=side, lit=lit):
        actions.do("profiler")
    _end()


def _begin(name: str, content: Rect, style: Theme) -> None:
    """Begins a bar around so much content."""
    pad = style.px(_PAD)
    imgui.set_next_window_pos(ImVec2(content.left, content.top))
    imgui.set_next_window_size(ImVec2(content.width + 2 * pad, content.height + 2 * pad))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(pad, pad))
    imgui.push_style_var(imgui.StyleVar_.window_min_size, ImVec2(1, 1))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, 0))
    imgui.begin(name, None, DOCKED | imgui.WindowFlags_.no_scroll_with_mouse)


def _end() -> None:
    imgui.end()
    imgui.pop_style_var(3)


def _gap(style: Theme) -> None:
    """A line between two groups of buttons."""
    at, width, gap = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x, style.px(_GAP)
    imgui.get_window_draw_list().add_line(ImVec2(at.x + gap, at.y + gap), ImVec2(at.x + width - gap, at.y + gap),
                                          packed(theme.EDGE), 1.0)
    imgui.dummy(ImVec2(0, 2 * gap))


def _column(number: int, columns: int) -> None:
    """Puts the button with this number of its group beside the one before, where the row has room."""
    if number % columns:
        imgui.same_line()


def _sides(session: Session, actions: Actions, style: Theme) -> None:
    """The list of sides beside their icon."""
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(style.px(8), style.px(8)))
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(style.px(8), style.px(6)))
    if imgui.begin_popup("sides"):
        for side, row in SIDES.items():
            if imgui.selectable(row.label, False, 0, ImVec2(style.px(64), 0))[0]:
                actions.do(f"from_{side}")
            hint(row.what, style)
        if imgui.selectable("View cube", session.area.panels.cube, 0, ImVec2(style.px(64), 0))[0]:
            actions.show_cube(not session.area.panels.cube)
        hint("Show or hide the cube at the top right of the picture: a click turns the view", style)
        imgui.end_popup()
    imgui.pop_style_var(2)
