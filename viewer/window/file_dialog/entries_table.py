"""The list of a folder in the file dialog: a table that is sorted by a click on a heading, and drawn as far as it is seen."""

from datetime import datetime

from imgui_bundle import ImVec2, imgui

from ..kit import theme
from ..kit.theme import Theme, fitted, packed, text_in
from .file_choice import FileChoice
from .folder_list import Entry, size_text

_SIZE, _DATE = 84.0, 136.0
"""Widths of two columns, design units."""
_COLUMNS = ("name", "size", "date")


def draw_entries(choice: FileChoice, style: Theme, height: float) -> None:
    """Folders and files with size and date; a click on a heading sorts.  height: pixels."""
    flags = (imgui.TableFlags_.scroll_y | imgui.TableFlags_.sortable | imgui.TableFlags_.borders_outer
             | imgui.TableFlags_.sizing_fixed_fit)
    imgui.push_style_color(imgui.Col_.table_border_strong, theme.LINE)
    shown = imgui.begin_table("entries", 3, flags, ImVec2(imgui.get_content_region_avail().x, height))
    imgui.pop_style_color()
    if not shown:
        return
    stretch, fixed = imgui.TableColumnFlags_.width_stretch, imgui.TableColumnFlags_.width_fixed
    imgui.table_setup_scroll_freeze(0, 1)
    imgui.table_setup_column("Name", stretch | imgui.TableColumnFlags_.default_sort)
    imgui.table_setup_column("Size", fixed, style.px(_SIZE))
    imgui.table_setup_column("Changed", fixed, style.px(_DATE))
    imgui.push_style_color(imgui.Col_.table_header_bg, theme.FIELD)
    imgui.table_headers_row()
    imgui.pop_style_color()
    specs = imgui.table_get_sort_specs()
    if specs is not None and specs.specs_count:
        chosen = specs.get_specs(0)
        choice.order = _COLUMNS[chosen.column_index]
        choice.descending = chosen.get_sort_direction() == imgui.SortDirection.descending
    rows = choice.rows
    clipper = imgui.ListClipper()
    clipper.begin(len(rows))
    if choice.moved and choice.cursor >= 0:
        clipper.include_item_by_index(choice.cursor)
    while clipper.step():
        for number in range(clipper.display_start, clipper.display_end):
            _row(choice, style, number, rows[number])
    if choice.moved and choice.cursor < 0:
        imgui.set_scroll_y(0.0)
    choice.moved = False
    if not rows:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.push_text_wrap_pos(0.0)
        text_in(theme.WARN if choice.listing.problem else theme.DIM, _empty(choice))
        imgui.pop_text_wrap_pos()
    imgui.end_table()


def _row(choice: FileChoice, style: Theme, number: int, entry: Entry) -> None:
    px = style.px
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.push_id(number)
    at, line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_double_click | (
        imgui.SelectableFlags_.no_auto_close_popups)
    selected = number == choice.cursor or entry.name in choice.chosen
    if selected:  # and under the pointer
        imgui.push_style_color(imgui.Col_.header_hovered, (theme.ACCENT.x, theme.ACCENT.y, theme.ACCENT.z, 0.4))
    pressed = imgui.selectable("##row", selected, flags)[0]
    if selected:
        imgui.pop_style_color()
    if number == choice.cursor and choice.moved:
        imgui.set_scroll_here_y(0.5)
    draw = imgui.get_window_draw_list()
    if entry.folder:
        _folder_icon(draw, at.x, at.y + 0.5 * line, px)
    text = fitted(entry.name, imgui.get_content_region_avail().x - px(22))
    draw.add_text(ImVec2(at.x + px(22), at.y), packed(theme.DIM if entry.hidden else theme.TEXT), text)
    if pressed:
        io = imgui.get_io()
        if imgui.is_mouse_double_clicked(imgui.MouseButton_.left) and not (io.key_ctrl or io.key_shift):
            choice.open_row(number)
        else:
            choice.select(number, toggle=io.key_ctrl, span=io.key_shift)
    imgui.pop_id()
    imgui.table_next_column()
    size = size_text(entry.size)
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(style.px(_SIZE - 16) - imgui.calc_text_size(size).x, 0))
    text_in(theme.DIM, size)
    imgui.table_next_column()
    if entry.modified is not None:
        text_in(theme.DIM, _date(entry.modified))


def _date(seconds: float) -> str:
    try:
        return f"{datetime.fromtimestamp(seconds):%Y-%m-%d %H:%M}"
    except (ValueError, OverflowError, OSError):  # a file system may hold any number
        return ""


def _empty(choice: FileChoice) -> str:
    if choice.listing.problem:
        return choice.listing.problem
    if not choice.listing.finished:
        return "Listing…"
    if choice.listing.entries and choice.request.kind != "folder":
        return "Nothing here has this name or ending."
    return "This folder is empty." if not choice.listing.entries else "There is no folder in this one."


def _folder_icon(draw: imgui.ImDrawList, left: float, middle: float, px) -> None:
    colour = packed(theme.ACCENT)
    draw.add_rect_filled(ImVec2(left + px(1), middle - px(6)), ImVec2(left + px(8), middle - px(3)), colour, px(1.5))
    draw.add_rect_filled(ImVec2(left + px(1), middle - px(4)), ImVec2(left + px(16), middle + px(6)), colour, px(2))
