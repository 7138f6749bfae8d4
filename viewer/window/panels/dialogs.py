"""What asks for attention: a message, the controls, a load under way.  Drawn from the session's state."""

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from ..flight.mouse import GESTURES, PRESETS
from ..interaction.controls import CONTROLS, Control
from ..kit import theme
from ..kit.chosen_button import ChosenButton
from ..kit.theme import Theme, fitted, text_in
from ..kit.widgets import DOCKED, button
from ..session.panel_actions import Actions
from ..session.session import Session

_MODAL = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_saved_settings
)


_GROUP_WIDTH = 400.0


def _centre() -> None:
    size = imgui.get_io().display_size
    imgui.set_next_window_pos(ImVec2(size.x / 2, size.y / 2), 0, ImVec2(0.5, 0.5))
    imgui.set_next_window_bg_alpha(1.0)


def draw_message(session: Session, actions: Actions, style: Theme, chosen: ChosenButton) -> None:
    """The dialog of ``session.notices.message``; its buttons and Esc close it.  chosen: at first the first one."""
    message, is_open = session.notices.message, imgui.is_popup_open("message")
    if message is None and not is_open:
        return
    if not is_open:
        imgui.open_popup("message")
    _centre()
    width = min(style.px(520), imgui.get_io().display_size.x - style.px(96))
    if not imgui.begin_popup_modal("message", None, _MODAL)[0]:
        return
    if message is None:  # closed by Esc
        imgui.close_current_popup()
        imgui.end_popup()
        return
    imgui.push_font(style.bold, theme.TITLE)
    imgui.text_unformatted(message.title)
    imgui.pop_font()
    imgui.push_text_wrap_pos(style.px(16) + width)
    imgui.text_unformatted(message.text)
    imgui.pop_text_wrap_pos()
    imgui.dummy(ImVec2(width, style.px(4)))
    gap = style.px(8)
    widths = [max(style.px(110), imgui.calc_text_size(answer.label).x + style.px(28)) for answer in message.answers]
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + width - sum(widths) - gap * (len(widths) - 1))
    labels = [answer.label for answer in message.answers]
    entered = chosen.follow(message, labels, labels[0], appearing=imgui.is_window_appearing())
    pressed = labels.index(entered) if entered else None
    for number, answer in enumerate(message.answers):
        if number:
            imgui.same_line(0, gap)
        if button(f"{answer.label}##{number}", style, width=widths[number], primary=answer.label == chosen.label):
            pressed = number
    if pressed is not None:
        actions.answer(pressed)
        imgui.close_current_popup()
    imgui.end_popup()


_HALVES = (("Move", "Gamepad", "Keep"), ("See", "Tools", "Work", "Window"))  # of the help page, left and right


def draw_help(session: Session, style: Theme, key_name: Callable[[Control], str]) -> None:
    """The table of controls.  key_name: what the person's own keyboard prints on a control's key."""
    if not session.help:
        return
    size, px = imgui.get_io().display_size, style.px
    _centre()
    imgui.set_next_window_size_constraints(ImVec2(0, 0), ImVec2(size.x - px(28), size.y - px(28)))
    flags = DOCKED & ~imgui.WindowFlags_.no_scrollbar
    imgui.begin("help", None, flags | imgui.WindowFlags_.always_auto_resize)
    imgui.push_font(style.bold, theme.TITLE)
    imgui.text_unformatted("Controls")
    imgui.pop_font()
    for number, groups in enumerate(_HALVES):
        if number and size.x > px(2 * _GROUP_WIDTH + 96):
            imgui.same_line(0, px(28))
        imgui.begin_group()
        for group in groups:
            _group(group, _rows(group, session.flight.mouse, key_name), style)
        imgui.end_group()
    text_in(theme.DIM, "F1 or Esc closes this")
    imgui.end()


def _rows(group: str, mouse: str, key_name: Callable[[Control], str]) -> list[tuple[str, str]]:
    """(control, what it does); the mouse as the person has chosen it."""
    rows = [(key_name(control), control.help) for control in CONTROLS[group] if control.action not in GESTURES]
    return rows + (PRESETS[mouse].rows if group == "Move" else [])


def _group(group: str, rows: list[tuple[str, str]], style: Theme) -> None:
    imgui.push_font(style.bold, theme.FONT_SIZE)
    text_in(theme.ACCENT, group)
    imgui.pop_font()
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.no_pad_outer_x
    metrics = imgui.get_style()
    room = imgui.get_io().display_size.x - style.px(28) - 2 * metrics.window_padding.x - metrics.scrollbar_size
    if imgui.begin_table(group, 2, flags, ImVec2(min(style.px(_GROUP_WIDTH), room), 0)):
        imgui.table_setup_column("", imgui.TableColumnFlags_.width_fixed, style.px(124))
        imgui.table_setup_column("", imgui.TableColumnFlags_.width_stretch)
        for name, text in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_unformatted(name)
            imgui.table_next_column()
            imgui.push_text_wrap_pos(0.0)
            text_in(theme.DIM, text)
            imgui.pop_text_wrap_pos()
        imgui.end_table()
    imgui.dummy(ImVec2(0, style.px(4)))


def draw_load(session: Session, actions: Actions, style: Theme) -> None:
    """The load under way: what it does, how far it is, a way to stop it."""
    work = session.loads.current
    if work is None:
        return
    px = style.px
    width = min(px(420), imgui.get_io().display_size.x - px(80))
    if session.scene is None:
        _centre()
    else:  # the picture, a preview, can be worked on: its middle stays free, below the switch of views
        area = session.area.layout.picture
        imgui.set_next_window_pos(ImVec2(area.left + area.width / 2, area.top + px(56)), 0, ImVec2(0.5, 0.0))
    imgui.begin("load", None, DOCKED | imgui.WindowFlags_.always_auto_resize)
    if imgui.is_window_appearing() and session.notices.message is None:  # above what lies over the picture
        imgui.internal.bring_window_to_display_front(imgui.internal.get_current_window())
    imgui.push_font(style.bold, theme.FONT_SIZE)
    imgui.text_unformatted(fitted(work.title, width))
    imgui.pop_font()
    fraction = work.fraction
    bar = fraction if fraction is not None else -0.6 * imgui.get_time()  # below zero: it only says that work goes on
    imgui.progress_bar(bar, ImVec2(width, px(8)), "")
    share = f", {100 * fraction:.0f} %" if fraction is not None else ""
    imgui.align_text_to_frame_padding()
    text_in(theme.DIM, work.label[:1].upper() + work.label[1:] + share)
    imgui.same_line()
    imgui.set_cursor_pos_x(imgui.get_style().window_padding.x + width - px(110))
    if button("Cancel", style, width=style.px(110)):
        actions.cancel_load()
    imgui.end()
