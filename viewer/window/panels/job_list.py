"""Work that goes on beside the window, with its progress, the time left and a way to give it up; and what it has saved."""

from collections.abc import Sequence
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from ...common.text import left_text
from ..kit import icons, theme
from ..kit.theme import Theme, fitted, packed
from ..kit.widgets import hint, icon_button, link, section, small
from ..kit.worker import Worker
from ..session.panel_actions import Actions

_BAR = 4.0
"""Height of a bar of progress, design units."""


def draw_job_list(workers: Sequence[Worker], saved: Sequence[Path], actions: Actions, style: Theme) -> None:
    """In the outliner, while there are any.  saved: the latest last."""
    count = len(workers) + len(saved)
    title = "Jobs" if workers else "Saved files"
    if not count or not section(f"{title}  {count}###Jobs", style, opened=True):
        return
    for number, worker in enumerate(workers):
        imgui.push_id(number)
        _job(worker, style)
        imgui.pop_id()
    for number, path in enumerate(reversed(saved)):
        imgui.push_id(len(workers) + number)
        _result(path, actions, style)
        imgui.pop_id()


def _job(worker: Worker, style: Theme) -> None:
    side, room, left = imgui.get_frame_height(), imgui.get_content_region_avail().x, imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(fitted(worker.title, room - side))
    hint(worker.label or worker.title, style)
    imgui.same_line(left + room - side)
    if icon_button(f"{icons.REMOVE}##cancel", "Give it up", style, side=side):
        worker.cancel()
    at, share = imgui.get_cursor_screen_pos(), worker.fraction or 0.0
    draw, high = imgui.get_window_draw_list(), style.px(_BAR)
    draw.add_rect_filled(at, ImVec2(at.x + room, at.y + high), packed(theme.FIELD_DOWN), high / 2)
    if share > 0:
        draw.add_rect_filled(at, ImVec2(at.x + share * room, at.y + high), packed(theme.ACCENT), high / 2)
    imgui.dummy(ImVec2(room, high))
    if worker.cancelled:
        small("Stopping…", style)
    elif not worker.total:
        small("Beginning…", style)
    else:
        left = worker.seconds_left
        small(f"{share:.0%}" + (f", {left_text(left)} left" if left is not None else ""), style)


def _result(path: Path, actions: Actions, style: Theme) -> None:
    """A file that was saved: its name opens it, the folder beside it is opened by the icon."""
    side, room = imgui.get_frame_height(), imgui.get_content_region_avail().x
    left, top = imgui.get_cursor_pos_x(), imgui.get_cursor_pos_y()
    if link(f"{fitted(path.name, room - 2 * side)}##open", beside_buttons=True):
        actions.open_saved(path)
    hint(f"{path}\nA click opens it", style)
    imgui.same_line(left + room - 2 * side)
    imgui.set_cursor_pos_y(top)
    if icon_button(f"{icons.OPEN}##folder", "Open its folder", style, side=side):
        actions.open_saved(path.parent)
    imgui.same_line(0, 0)
    imgui.set_cursor_pos_y(top)
    if icon_button(f"{icons.REMOVE}##forget", "Take it off this list; the file stays", style, side=side):
        actions.forget_saved(path)
