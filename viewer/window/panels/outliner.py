"""The outliner at the left: the scans with their facts, and what has been made of them, each with an eye, a name and a menu.

Groups of rows come from the tools (viewer.window.interaction.outline): a new kind of work is listed where its tool is.
Notices about the scan, with what can be done about them, are at the end.
"""

from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

from ...common.rigid_transform import motion_text
from ...common.text import count_text
from ...preprocess.scan_description import IN_MEMORY
from ...work.scan_files import FilePart, files_of
from ..interaction.outline import Group, Row
from ..interaction.tool import ToolContext
from ..interaction.toolbox import Toolbox
from ..kit import icons, theme
from ..kit.theme import Theme, fitted, packed, text_in
from ..kit.widgets import begin_docked, facts, heading, hint, icon_button, link, section, small, to_the_right
from ..session.panel_actions import Actions
from ..session.scan_notice_actions import current_notices
from ..session.session import Session
from .job_list import draw_job_list
from .status_bar import units_text

_FILES = 8
"""Files that are listed without scrolling."""
_ROWS = 12
"""Rows of a group that are listed without scrolling."""
_NAME_LETTERS = 80
"""Letters that a new name may have."""
_MOVED = icons.ALIGN
"""Before the name of a file that was moved."""
_SHOW_FILE = "Show the points of this file"
_SHARED = "This file shares its number with others in the grid: it cannot be hidden by itself"
_FACTS = 50.0
"""Of the names of facts, design units."""
_SIDES = 10.0, 10.0
"""Between the panel's edge and what it holds, design units."""


def draw_outliner(session: Session, toolbox: Toolbox, tools: ToolContext, actions: Actions, style: Theme) -> None:
    """At the left, where it is open.  The order of groups is that of the tools."""
    place = session.area.layout.outliner
    if place is None:
        return
    begin_docked("outliner", place, style, padding=_SIDES)
    imgui.push_font(style.regular, theme.FONT_SIZE - 1)
    heading("Scans", style, beside_buttons=True)
    _scan_buttons(actions, style)
    _scans(session, actions, style)
    for tool in toolbox.tools:
        for group in tool.outline(tools):
            if group.count:
                _group(group, style, marks=tool is toolbox.active)
    draw_job_list([*toolbox.workers, *tools.saves.workers], session.notices.saved, actions, style)
    _notices(session, actions, style)
    imgui.pop_font()
    imgui.end()


def _scan_buttons(actions: Actions, style: Theme) -> None:
    """On the line of the heading, to its right; smaller where the panel is narrow."""
    rows = ((icons.OPEN, "open", "Open scans or a project (O)"),
            (icons.ADD, "add", "Add scans to the scene"),
            (icons.EXPORT, "export", "Export the points in sight: not hidden, left by clips"),
            (icons.REMOVE, "close_scan", "Close the scan: back to the start page"),
            (icons.FOLD_LEFT, "fold outliner", "Fold this panel"))
    imgui.same_line()
    side = min(imgui.get_frame_height(), imgui.get_content_region_avail().x / len(rows))
    to_the_right(len(rows) * side)
    for number, (icon, name, explained) in enumerate(rows):
        if number:
            imgui.same_line(0, 0)
        if icon_button(f"{icon}##{name}", explained, style, side=side):
            if name == "fold outliner":
                actions.fold("outliner", True)
            else:
                actions.do(name)
    imgui.same_line(0, 0)
    imgui.dummy(ImVec2(0, imgui.get_frame_height()))


def _scans(session: Session, actions: Actions, style: Theme) -> None:
    scene = session.scene
    assert scene is not None
    sources = scene.meta.sources or (IN_MEMORY,)
    if len(sources) > 1 and len(parts := files_of(scene)) == len(sources):
        _files(session, actions, style, parts)
    else:
        width = imgui.get_content_region_avail().x
        for number, source in enumerate(sources[:_FILES]):
            moved = f"{_MOVED} " if (motion := _motion(session, number)) else ""
            imgui.text_unformatted(moved + fitted(Path(source).name, width - imgui.calc_text_size(moved).x))
            hint(f"{source}\n{motion}".strip(), style)
        if len(sources) > _FILES:
            text_in(theme.DIM, f"and {len(sources) - _FILES} more")
    imgui.push_font(style.regular, theme.SMALL)
    rows = [("points", f"{scene.count:,}".replace(",", "\u2009") if scene.count < 1e6 else count_text(scene.count))]
    rows.append(("format", scene.meta.format or "unknown"))
    rows.append(("units", units_text(session.facts)))
    extent = scene.bounds[1] - scene.bounds[0]
    sides = [f"{length:.3g}" if length < 1000 else f"{length:.0f}" for length in extent]
    whole = "\u2009×\u2009".join(sides)
    room = imgui.get_content_region_avail().x - style.px(_FACTS) - 2 * imgui.get_style().cell_padding.x
    rows.append(("extent", whole if imgui.calc_text_size(whole).x <= room else " × ".join(sides)))  # wraps at spaces
    rows.append(("spacing", f"{scene.spacing:.3g}"))
    facts(rows, style, "scan facts", first=_FACTS)
    imgui.pop_font()
    if session.shown_scan.preview and session.loads.current is not None:
        small("Preview; all points follow.", style, theme.WARN)
    if (reading := session.loads.reading).on:
        small(reading.text, style, theme.WARN if reading.state.problem else theme.TEXT)


def _motion(session: Session, number: int) -> str:
    """A line about how the file of this number was moved, "" where it was not."""
    records, scene = session.facts.records, session.scene
    rows = None if records is None else records.move_of(number)
    return f"Moved: {motion_text(rows, scene.bounds.mean(axis=0))}\n" if rows is not None and scene is not None else ""


def _files(session: Session, actions: Actions, style: Theme, parts: list[FilePart]) -> None:
    """The files of the scene, each with an eye that shows it and a name that flies to it."""
    hidden = set(session.document.hidden_stations)
    with_scroll = len(parts) > _FILES
    if with_scroll:
        imgui.begin_child("files", ImVec2(0, _FILES * imgui.get_frame_height_with_spacing()))
    clipper = imgui.ListClipper()
    clipper.begin(len(parts), imgui.get_frame_height_with_spacing())
    while clipper.step():
        for number in range(clipper.display_start, clipper.display_end):
            part = parts[number]
            imgui.push_id(number)
            on = not hidden.issuperset(part.numbers)
            if _eye("##file", on, _SHOW_FILE if part.can_hide else _SHARED, style, disabled=not part.can_hide):
                actions.show_points_of(part, not on)
            imgui.same_line()
            motion = _motion(session, number)
            moved = f"{_MOVED} " if motion else ""
            if link(moved + fitted(Path(part.path).name, imgui.get_content_region_avail().x - imgui.calc_text_size(moved).x),
                    beside_buttons=True):
                actions.fly_to_file(part)
            if imgui.begin_popup_context_item("menu"):
                if imgui.selectable("Remove from the scene", False)[0]:
                    actions.remove_file(part)
                imgui.end_popup()
            hint(f"{part.path}\n{motion}A click flies to it", style)
            imgui.pop_id()
    if with_scroll:
        imgui.end_child()


def _eye(name: str, on: bool, about: str, style: Theme, *, disabled: bool = False) -> bool:
    """The switch of what is shown.  Returns whether it was pressed."""
    imgui.begin_disabled(disabled)
    imgui.push_style_color(imgui.Col_.text, theme.TEXT if on else theme.DIM)
    pressed = icon_button(f"{icons.SHOWN if on else icons.HIDDEN}{name}", about, style, side=imgui.get_frame_height())
    imgui.pop_style_color()
    imgui.end_disabled()
    return pressed


def _group(group: Group, style: Theme, *, marks: bool) -> None:
    """One group of rows, which folds.  marks: whether the row that the tool works on is marked."""
    imgui.dummy(ImVec2(0, style.px(2)))
    if not section(f"{group.title}  {group.count}###{group.title}", style, opened=group.opened):
        return
    first = group.row(0)
    line = imgui.get_frame_height_with_spacing() + (imgui.get_text_line_height() if first.value else 0.0)
    imgui.push_id(group.title)
    with_scroll = group.count > _ROWS
    if with_scroll:
        imgui.begin_child("rows", ImVec2(0, _ROWS * line))
    clipper = imgui.ListClipper()
    clipper.begin(group.count, line)
    while clipper.step():
        for number in range(clipper.display_start, clipper.display_end):
            imgui.push_id(number)
            _row(group, number, group.row(number), style, marks=marks)
            imgui.pop_id()
    if with_scroll:
        imgui.end_child()
    imgui.pop_id()


def _row(group: Group, number: int, row: Row, style: Theme, *, marks: bool) -> None:
    if group.show is not None and row.shown is not None:
        if _eye("##shown", row.shown, "Show it", style):
            group.show(number, not row.shown)
        imgui.same_line(0, style.px(2))
    at, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    height = imgui.get_frame_height() + (imgui.get_text_line_height() if row.value else 0.0)
    pressed = imgui.selectable("##row", row.chosen and marks, 0, ImVec2(room, height))[0]
    hint(row.about or row.name, style)
    _menu(group, number, row)
    draw, pad = imgui.get_window_draw_list(), imgui.get_style().frame_padding.y
    inside = room - style.px(24)
    if row.colour is None:
        draw.add_text(ImVec2(at.x + style.px(3), at.y + pad), packed(theme.DIM), group.icon)
    else:
        side, top = style.px(12), at.y + 0.5 * (imgui.get_frame_height() - style.px(12))
        red, green, blue = (level / 255 for level in row.colour)
        draw.add_rect_filled(ImVec2(at.x + style.px(4), top), ImVec2(at.x + style.px(4) + side, top + side),
                             packed(ImVec4(red, green, blue, 1.0)), style.px(2))
    name = ImVec2(at.x + style.px(24), at.y + pad)
    if row.aside:
        wide = imgui.calc_text_size(row.aside).x
        draw.add_text(ImVec2(at.x + room - wide - style.px(4), at.y + pad), packed(theme.DIM), row.aside)
        inside -= wide + style.px(8)
    draw.add_text(name, packed(theme.TEXT if row.shown is not False else theme.DIM), fitted(row.name, inside))
    if row.value:
        below = ImVec2(name.x, name.y + imgui.get_text_line_height())
        draw.add_text(below, packed(theme.ACCENT), fitted(row.value, inside))
    if pressed:
        group.click(number)


def _menu(group: Group, number: int, row: Row) -> None:
    """The menu that the right button opens on a row."""
    if not (group.commands or group.rename) or not imgui.begin_popup_context_item("menu"):
        return
    if group.rename is not None:
        imgui.set_next_item_width(imgui.calc_text_size("m" * 16).x)
        changed, name = imgui.input_text("##rename", row.name)
        if changed and len(name) <= _NAME_LETTERS:
            group.rename(number, name)
    for text, what in group.commands.items():
        if imgui.selectable(text, False)[0]:
            what(number)
    imgui.end_popup()


def _notices(session: Session, actions: Actions, style: Theme) -> None:
    if not (notices := current_notices(session)):
        return
    heading(f"{icons.NOTICE}  Notices", style)
    for number, notice in enumerate(notices):
        imgui.push_id(number)
        small(notice.text, style, theme.TEXT)
        if notice.offer is not None and link(notice.offer.label):
            actions.act_on_notice(notice.offer)
        imgui.dummy(ImVec2(0, style.px(2)))
        imgui.pop_id()
