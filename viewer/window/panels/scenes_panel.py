"""The scene list at the left: the scans and their facts, the tools, and notices with their actions."""

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ...preprocess.scan_description import IN_MEMORY
from ...work.scan_files import FilePart, files_of
from ..flight.framing import SIDES
from ..interaction.tool import Toolbox, ToolContext
from ..kit import theme
from ..kit.theme import Theme, fitted, packed, text_in
from ..kit.widgets import begin_docked, button, facts, heading, hint, link, rail_button, small, to_the_right
from ..session.panel_actions import Actions
from ..session.session import Session
from .status_bar import count_text, units_text

_ROWS = 8
"""Files that are listed without scrolling."""
_RAIL_BESIDES_TOOLS = 4
"""Icons of the folded panel besides the tools: unfold, open, start viewpoint, notices."""


def draw_scenes_panel(session: Session, toolbox: Toolbox, tools: ToolContext, actions: Actions, style: Theme) -> None:
    """At the left, open or folded to its icons."""
    place = session.area.layout.scenes
    if place is None:
        return
    if not session.area.panels.scenes:
        _folded(session, toolbox, actions, style)
        return
    begin_docked("scenes", place, style)
    imgui.push_font(style.regular, theme.FONT_SIZE - 1)
    heading("Scans", style)
    to_the_right("<<", style)
    if imgui.small_button("<<##fold scenes"):
        actions.fold("scenes", True)
    hint("Fold the scene list", style)
    _scans(session, actions, style)
    _open_buttons(actions, style)
    heading("Tools", style)
    _tools(toolbox, tools, actions, style)
    _viewpoints(actions, style)
    _notices(session, actions, style)
    imgui.pop_font()
    imgui.end()


def _folded(session: Session, toolbox: Toolbox, actions: Actions, style: Theme) -> None:
    place = session.area.layout.scenes
    assert place is not None
    begin_docked("scenes folded", place, style, padding=(5, 6), scroll=False)
    imgui.push_font(style.bold, theme.FONT_SIZE)
    number = len(toolbox.tools) + _RAIL_BESIDES_TOOLS
    free = (place.height - style.px(12) - number * (place.width - style.px(10))) / (number - 1)
    usual = imgui.get_style().item_spacing
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(usual.x, min(max(free, style.px(1)), usual.y)))
    if rail_button(">>##scenes", "Show the scene list", style):
        actions.fold("scenes", False)
    if rail_button("O", "Open scans", style):
        actions.do("open")
    for tool in toolbox.tools:
        if rail_button(f"{tool.letter}##{tool.name}", _explained(tool), style, lit=tool is toolbox.active):
            actions.select_tool(tool.name)
            actions.fold("scenes", tool is toolbox.fly)  # a tool's controls are in the open panel
    if rail_button("H##home", "Back to the start viewpoint (Home)", style):
        actions.do("home")
    if session.notices.of_scan:
        at = imgui.get_cursor_screen_pos()
        if rail_button(f"{len(session.notices.of_scan)}##notices", "Notices about this scan", style):
            actions.fold("scenes", False)
        side = place.width - style.px(10)
        dot = ImVec2(at.x + side - style.px(5), at.y + style.px(5))
        imgui.get_window_draw_list().add_circle_filled(dot, style.px(4), packed(theme.WARN), 16)
    imgui.pop_style_var()
    imgui.pop_font()
    imgui.end()


def _explained(tool) -> str:
    return f"{tool.label}: {tool.help}" + (f" (key {tool.key})" if tool.key else "")


def _scans(session: Session, actions: Actions, style: Theme) -> None:
    scene = session.scene
    assert scene is not None
    sources = scene.meta.sources or (IN_MEMORY,)
    width = imgui.get_content_region_avail().x
    if len(sources) > 1 and len(parts := files_of(scene)) == len(sources):
        _files(session, actions, style, parts)
    else:
        for source in sources[:_ROWS]:
            imgui.text_unformatted(fitted(Path(source).name, width))
            hint(source, style)
        if len(sources) > _ROWS:
            text_in(theme.DIM, f"and {len(sources) - _ROWS} more")
    imgui.push_font(style.regular, theme.SMALL)
    rows = [("points", f"{scene.count:,}".replace(",", "\u2009") if scene.count < 1e6 else count_text(scene.count))]
    rows.append(("format", scene.meta.format or "unknown"))
    rows.append(("units", units_text(session.facts)))
    extent = scene.bounds[1] - scene.bounds[0]
    rows.append(("extent", " x ".join(f"{length:.4g}" for length in extent)))
    rows.append(("spacing", f"{scene.spacing:.3g}"))
    facts(rows, style, "scan facts")
    imgui.pop_font()
    if session.shown_scan.preview and session.loads.current is not None:
        small("Preview; all points follow.", style, theme.WARN)


def _files(session: Session, actions: Actions, style: Theme, parts: list[FilePart]) -> None:
    """The files of the scene, each with a switch that shows it and a name that flies to it."""
    metrics = imgui.get_style()
    row = imgui.get_frame_height() + metrics.item_spacing.y
    if len(parts) > _ROWS:
        imgui.begin_child("files", ImVec2(0, _ROWS * row))
    hidden = set(session.document.hidden_stations)
    clipper = imgui.ListClipper()
    clipper.begin(len(parts), row)
    while clipper.step():
        for number in range(clipper.display_start, clipper.display_end):
            part = parts[number]
            imgui.push_id(number)
            imgui.begin_disabled(not part.apart)
            on = not hidden.issuperset(part.numbers)
            changed, on = imgui.checkbox("##file", on)
            imgui.end_disabled()
            hint("Show the points of this file" if part.apart else "This file shares its number with others in the grid: it "
                 "cannot be hidden by itself", style)
            if changed:
                actions.show_points_of(part, on)
            imgui.same_line()
            imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + metrics.frame_padding.y)
            if link(fitted(Path(part.path).name, imgui.get_content_region_avail().x)):
                actions.fly_to_file(part)
            hint(f"{part.path}\nA click flies to it", style)
            imgui.pop_id()
    if len(parts) > _ROWS:
        imgui.end_child()


def _open_buttons(actions: Actions, style: Theme) -> None:
    width = (imgui.get_content_region_avail().x - style.px(8)) / 2
    if button("Open…", style, width=width, explained="Choose scan files"):
        actions.do("open")
    imgui.same_line(0, style.px(8))
    if button("Close", style, width=width, explained="Back to the start page"):
        actions.do("close_scan")


def _tools(toolbox: Toolbox, tools: ToolContext, actions: Actions, style: Theme) -> None:
    width = (imgui.get_content_region_avail().x - style.px(8)) / 2
    for number, tool in enumerate(toolbox.tools):
        if number % 2:
            imgui.same_line(0, style.px(8))
        lit = tool is toolbox.active
        if button(f"{tool.label}##{tool.name}", style, width=width, primary=lit, explained=_explained(tool)):
            actions.select_tool(tool.name)
    toolbox.active.panel(imgui, tools)


def _viewpoints(actions: Actions, style: Theme) -> None:
    heading("Viewpoint", style)
    width = (imgui.get_content_region_avail().x - style.px(8)) / 2
    if button("Start", style, width=width, explained="Back to the start viewpoint (key Home)"):
        actions.do("home")
    imgui.same_line(0, style.px(8))
    if button("Whole scene", style, width=width, explained="See the whole scene from here (key F)"):
        actions.do("frame")
    width = (imgui.get_content_region_avail().x - 3 * style.px(8)) / len(SIDES)
    for number, (side, row) in enumerate(SIDES.items()):
        if number:
            imgui.same_line(0, style.px(8))
        if button(f"{row.label}##side", style, width=width, explained=row.what):
            actions.do(f"from_{side}")


def _notices(session: Session, actions: Actions, style: Theme) -> None:
    if not session.notices.of_scan:
        return
    heading("Notices", style)
    for number, notice in enumerate(session.notices.of_scan):
        imgui.push_id(number)
        small(notice.text, style, theme.TEXT)
        if notice.offer is not None and link(notice.offer.label):
            actions.act_on_notice(notice.offer)
        imgui.dummy(ImVec2(0, style.px(2)))
        imgui.pop_id()
