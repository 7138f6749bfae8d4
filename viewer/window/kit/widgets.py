"""Rows and buttons that the panels are made of.  Each is drawn in the imgui window that is open."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from imgui_bundle import ImVec2, imgui

from ...picture.settings import CHOICES, Settings
from . import theme
from .layout import Rect
from .sliders import CLAMP, LOGARITHMIC, slider_float
from .theme import Theme, packed, text_in
from .worker import Worker

DOCKED = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)
"""Flags of a window that has its place."""
FLOATING = DOCKED | imgui.WindowFlags_.always_auto_resize
PASSIVE = FLOATING | imgui.WindowFlags_.no_inputs
LIT = tuple((slot, theme.ACCENT) for slot in (imgui.Col_.button, imgui.Col_.button_hovered, imgui.Col_.button_active)) + (
    (imgui.Col_.text, theme.ACCENT_TEXT),)  # fmt: skip
"""Colours of a button that is switched on: the same under the pointer."""
MARGIN = 14.0
_TOOLTIP = 20.0
"""Width of a tooltip's text, at most, in heights of the font."""
_LABEL = 92.0


def begin_docked(name: str, rect: Rect, style: Theme, *, padding: tuple[float, float] = (14, 12), scroll: bool = True) -> None:
    """Begins a window that fills ``rect``; ``imgui.end`` ends it."""
    imgui.set_next_window_pos(ImVec2(rect.left, rect.top))
    imgui.set_next_window_size(ImVec2(rect.width, rect.height))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(style.px(padding[0]), style.px(padding[1])))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    imgui.set_next_window_bg_alpha(1.0)
    flags = DOCKED & ~imgui.WindowFlags_.no_scrollbar if scroll else DOCKED
    if imgui.get_io().want_text_input:  # Tab leads to the next field
        flags &= ~imgui.WindowFlags_.no_nav_inputs
    imgui.begin(name, None, flags | imgui.WindowFlags_.no_bring_to_front_on_focus)
    imgui.pop_style_var(3)


def to_the_right(width: float) -> None:
    """Places what comes next, so many pixels wide, on the line of the last item, ending where the content ends (left of a
    scroll bar)."""
    imgui.same_line(imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x - width)


def heading(text: str, style: Theme, *, beside_buttons: bool = False) -> None:
    """The title of a section.  beside_buttons: as low as the icons of buttons on its line."""
    if imgui.get_cursor_pos_y() > style.px(40):
        imgui.dummy(ImVec2(0, style.px(3)))
    line = imgui.get_frame_height()
    imgui.push_font(style.bold, theme.FONT_SIZE)
    if beside_buttons:
        at, size = imgui.get_cursor_screen_pos(), imgui.calc_text_size(text)
        imgui.get_window_draw_list().add_text(ImVec2(at.x, at.y + max(0.0, (line - size.y) / 2)), packed(theme.TEXT), text)
        imgui.dummy(size)
    else:
        imgui.text_unformatted(text)
    imgui.pop_font()


def section(title: str, style: Theme, *, opened: bool = False) -> bool:
    """The title of a section that folds.  opened: at first.  Returns whether it is open."""
    imgui.set_next_item_open(opened, imgui.Cond_.once)
    imgui.push_font(style.bold, theme.FONT_SIZE - 1)
    imgui.push_style_color(imgui.Col_.header, theme.NOTHING)
    imgui.push_style_var(imgui.StyleVar_.frame_border_size, 0.0)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(style.px(5), style.px(4)))
    is_open = imgui.collapsing_header(title)
    imgui.pop_style_var(2)
    imgui.pop_style_color()
    imgui.pop_font()
    return is_open


COMPACT = 6.0
"""Design units between the text of a compact button and its sides."""


def compact_button(label: str, style: Theme) -> bool:
    """A button as high as a field and hardly wider than its text, for several in a row.  Returns whether it was pressed."""
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(style.px(COMPACT), imgui.get_style().frame_padding.y))
    pressed = imgui.button(label)
    imgui.pop_style_var()
    return pressed


def compact_width(labels: Iterable[str], style: Theme) -> float:
    """Pixels that compact buttons take beside an item, with the gap before each."""
    gap = imgui.get_style().item_spacing.x
    return sum(imgui.calc_text_size(label).x + 2 * style.px(COMPACT) + gap for label in labels)


def small(text: str, style: Theme, colour=theme.DIM) -> None:
    """Wrapped small text."""
    imgui.push_font(style.regular, theme.SMALL)
    imgui.push_text_wrap_pos(0.0)
    text_in(colour, text)
    imgui.pop_text_wrap_pos()
    imgui.pop_font()


def hint(text: str, style: Theme) -> None:
    """A tooltip of the item before, also where that is disabled.  style: of the window, for whom calls label and button."""
    if text and imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled):
        tooltip_beside(imgui, text)


def tooltip_beside(ui: Any, text: str) -> None:
    """A tooltip at the left or right of the window that is open, as high as the item before, so that it does not cover what
    follows.  ui: the ``imgui`` module."""
    low, size, em = ui.get_window_pos(), ui.get_io().display_size, ui.get_font_size()
    right, top, width = low.x + ui.get_window_width(), ui.get_item_rect_min().y, _TOOLTIP * em
    if low.x > width + 2 * em:
        ui.set_next_window_pos(ImVec2(low.x - em / 2, top), 0, ImVec2(1.0, 0.0))
    elif size.x - right > width + 2 * em:
        ui.set_next_window_pos(ImVec2(right + em / 2, top))
    ui.push_style_var(ui.StyleVar_.window_padding, ImVec2(0.8 * em, 0.6 * em))
    ui.begin_tooltip()
    ui.push_text_wrap_pos(width)
    ui.text_unformatted(text)
    ui.pop_text_wrap_pos()
    ui.end_tooltip()
    ui.pop_style_var()


def label(text: str, explained: str, style: Theme, *, width: float = -1.0) -> None:
    """The name at the left of a row, with a tooltip.  width: of the next widget, pixels; -1: the rest of the row."""
    imgui.align_text_to_frame_padding()
    text_in(theme.DIM, text)
    hint(explained, style)
    imgui.same_line(style.px(_LABEL))
    imgui.set_next_item_width(width)


def button(text: str, style: Theme, *, width: float = 0.0, primary: bool = False, disabled: str = "",
           explained: str = "") -> bool:
    """A button.  disabled: the reason, "" where it can be pressed.  explained: its tooltip."""
    if primary:
        for slot, colour in ((imgui.Col_.button, theme.ACCENT), (imgui.Col_.button_hovered, theme.TEXT),
                             (imgui.Col_.button_active, theme.DIM), (imgui.Col_.text, theme.ACCENT_TEXT)):  # fmt: skip
            imgui.push_style_color(slot, colour)
    imgui.begin_disabled(bool(disabled))
    pressed = imgui.button(text, ImVec2(width, 0))
    imgui.end_disabled()
    if primary:
        imgui.pop_style_color(4)
    hint(disabled or explained, style)
    return pressed


def link(text: str, *, beside_buttons: bool = False) -> bool:
    """A button that looks like coloured text.  beside_buttons: as low as the text of buttons on its line."""
    if beside_buttons:
        imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + imgui.get_style().frame_padding.y)
    for slot in (imgui.Col_.button, imgui.Col_.button_hovered, imgui.Col_.button_active):
        imgui.push_style_color(slot, (0, 0, 0, 0))
    imgui.push_style_color(imgui.Col_.text, theme.ACCENT)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    imgui.push_style_var(imgui.StyleVar_.frame_border_size, 0.0)
    pressed = imgui.button(text)
    if imgui.is_item_hovered():
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        imgui.get_window_draw_list().add_line(ImVec2(low.x, high.y), ImVec2(high.x, high.y), packed(theme.ACCENT))
    imgui.pop_style_var(2)
    imgui.pop_style_color(4)
    return pressed


def slider(name: str, value: float, least: float, most: float, form: str) -> float:
    """A logarithmic slider.  Returns the value chosen; typed text that is not a number within the limits is ignored."""
    changed, chosen = slider_float(name, value, least, most, form, LOGARITHMIC | CLAMP)
    return chosen if changed and least <= chosen <= most else value


def combo(name: str, value: str, table: dict[str, str], style: Theme, *, disabled: dict[str, str] | None = None,
          names: dict[str, str] | None = None) -> str:
    """A list of choices.  table: key -> tooltip.  disabled: key -> reason.  names: key -> what is shown, the key by default."""
    reasons, shown = disabled or {}, names or {}
    if imgui.begin_combo(name, shown.get(value, value)):
        for option, explained in table.items():
            reason = reasons.get(option, "")
            flags = imgui.SelectableFlags_.disabled if reason else 0
            if imgui.selectable(shown.get(option, option), option == value, flags)[0]:
                value = option
            hint(reason or explained, style)
        imgui.end_combo()
    return value


def setting(settings: Settings, name: str, text: str, style: Theme, *, disabled: dict[str, str] | None = None) -> Settings:
    """A row that chooses one entry of a table of viewer.picture.settings.CHOICES."""
    table, value = CHOICES[name], getattr(settings, name)
    label(text, table[value], style)
    chosen = combo(f"##{name}", value, table, style, disabled=disabled)
    return settings if chosen == value else replace(settings, **{name: chosen})


def icon_button(icon: str, explained: str, style: Theme, *, side: float, lit: bool = False) -> bool:
    """A square button without an edge.  icon: of kit.icons, with imgui's ``##name``.  side: pixels.  lit: it stays so under the
    pointer, which rests on it after the click that lit it."""
    colours = LIT if lit else ((imgui.Col_.button, theme.NOTHING),)
    for slot, colour in colours:
        imgui.push_style_color(slot, colour)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    imgui.push_style_var(imgui.StyleVar_.frame_border_size, 0.0)
    pressed = imgui.button(icon, ImVec2(side, side))
    imgui.pop_style_var(2)
    imgui.pop_style_color(len(colours))
    hint(explained, style)
    return pressed


def facts(rows: Iterable[tuple[str, str]], style: Theme, name: str = "facts", *, first: float = 76.0) -> None:
    """Names and values in two columns.  first: width of the names, design units."""
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.no_pad_outer_x
    if imgui.begin_table(name, 2, flags):
        imgui.table_setup_column("", imgui.TableColumnFlags_.width_fixed, style.px(first))
        imgui.table_setup_column("", imgui.TableColumnFlags_.width_stretch)
        for title, value in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            text_in(theme.DIM, title)
            imgui.table_next_column()
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(value)
            imgui.pop_text_wrap_pos()
        imgui.end_table()


def work_rows(ui: Any, worker: Worker) -> None:
    """Rows of long work that goes on: what it does, how far it is, and Cancel.  ui: the ``imgui`` module, inside a window."""
    ui.text_wrapped(worker.label or worker.title)
    ui.progress_bar(worker.fraction or 0.0)
    if ui.button("Cancel"):
        worker.cancel()
