"""The inspector at the right: the controls of the selected tool, and how the picture is made."""

from imgui_bundle import ImVec2, imgui

from ..interaction.tool import ToolContext
from ..interaction.toolbox import Toolbox
from ..kit import icons, theme
from ..kit.theme import Theme
from ..kit.widgets import begin_docked, heading, hint, icon_button, section, to_the_right
from ..session.panel_actions import Actions
from ..session.session import Session
from .look_panel import draw_look
from .tool_bar import explained

_SIDES = 10.0, 10.0
"""Between the panel's edge and what it holds, design units."""


def draw_inspector(session: Session, toolbox: Toolbox, tools: ToolContext, actions: Actions, style: Theme) -> None:
    """At the right, where it is open.  While a tool is selected, how the picture is made lies folded below its controls."""
    place = session.area.layout.inspector
    if place is None:
        return
    begin_docked("inspector", place, style, padding=_SIDES)
    imgui.push_font(style.regular, theme.FONT_SIZE - 1)
    tool, flying = toolbox.active, toolbox.active is toolbox.fly
    heading("Picture" if flying else f"{tool.icon or tool.label[:1]}  {tool.label}", style, beside_buttons=True)
    if not flying:
        hint(explained(tool), style)
    side = imgui.get_frame_height()
    to_the_right(side)
    if icon_button(f"{icons.FOLD_RIGHT}##fold inspector", "Fold this panel", style, side=side):
        actions.fold("inspector", True)
    if not flying:
        tool.panel(imgui, tools)
        imgui.dummy(ImVec2(0, style.px(4)))
    if flying or section("Picture", style):
        draw_look(session, actions, style)
    imgui.pop_font()
    imgui.end()
