"""The timeline of a camera path: a strip with its keyframes where the film passes them, to scrub and to select them on.

The film moves at constant speed, so the path decides when a keyframe is passed: a keyframe has a place in the order, and no
time that a person could drag.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...kit import theme
from ...kit.theme import Theme, packed
from ...kit.widgets import tooltip_beside

HEIGHT = 34.0
"""Design units; a marker of MARKER and the line of seconds below it."""
MARKER = 6.0
"""Half the diagonal of a keyframe's marker, design units; REACH around its middle a click takes it."""
REACH = 9.0


@dataclass(frozen=True)
class TimelineEvent:
    """scrubbed: seconds to show, or None.  selected: number of the keyframe that was clicked, or None."""

    scrubbed: float | None = None
    selected: int | None = None


def column(seconds: float, length: float, width: float, margin: float) -> float:
    """Where a time lies on a strip ``width`` wide, between margins; the inverse is :func:`seconds_at`."""
    return margin + (seconds / length if length > 0 else 0.0) * max(width - 2 * margin, 1e-6)


def seconds_at(x: float, length: float, width: float, margin: float) -> float:
    """The time at a column of the strip, from 0 to ``length``."""
    return min(max((x - margin) / max(width - 2 * margin, 1e-6), 0.0), 1.0) * length


def nearest_marker(x: float, columns: Sequence[float], reach: float) -> int | None:
    """The keyframe whose marker lies within ``reach`` of a column, the nearest of several, the later of equal ones."""
    near = [(abs(x - at), -number) for number, at in enumerate(columns) if abs(x - at) <= reach]
    return -min(near)[1] if near else None


class Timeline:
    """selected: number of the keyframe that is selected, or None."""

    def __init__(self) -> None:
        self.selected: int | None = None
        self._scrubs = False

    def draw(self, ui: Any, style: Theme, passing: Sequence[float], at: float, length: float) -> TimelineEvent:
        """Draws the strip as wide as the panel.  passing: seconds at which the film passes each keyframe.  at: shown now."""
        width, height = ui.get_content_region_avail().x, style.px(HEIGHT)
        margin, size = style.px(MARKER + 2), style.px(MARKER)
        corner = ui.get_cursor_screen_pos()
        ui.invisible_button("##timeline", (width, height))
        mouse, middle = ui.get_io().mouse_pos, corner.y + size + style.px(3)
        columns = [column(seconds, length, width, margin) for seconds in passing]
        over = nearest_marker(mouse.x - corner.x, columns, style.px(REACH)) if ui.is_item_hovered() else None
        event = self._event(ui, over, mouse.x - corner.x, length, width, margin)
        draw = ui.get_window_draw_list()
        line = packed(theme.DIM)
        draw.add_line((corner.x + margin, middle), (corner.x + width - margin, middle), line, style.px(2))
        for number, x in enumerate(columns):
            lit = number in (self.selected, over)
            self._diamond(draw, corner.x + x, middle, size, packed(theme.ACCENT if lit else theme.TEXT))
        head = corner.x + column(at, length, width, margin)
        draw.add_line((head, corner.y), (head, corner.y + 2 * size + style.px(6)), packed(theme.ACCENT), style.px(2))
        text = f"{at:.1f} of {length:.1f} s"
        ui.push_font(style.regular, theme.SMALL)
        draw.add_text((corner.x + margin, corner.y + 2 * size + style.px(6)), packed(theme.TEXT), text)
        ui.pop_font()
        if over is not None and not self._scrubs:
            tooltip_beside(ui, f"keyframe {over + 1}, passed after {passing[over]:.1f} s")
        return event

    def _event(self, ui: Any, over: int | None, x: float, length: float, width: float, margin: float) -> TimelineEvent:
        if ui.is_item_activated():
            self._scrubs = over is None
            if over is not None:
                self.selected = over
                return TimelineEvent(selected=over)
        if ui.is_item_active() and self._scrubs:
            return TimelineEvent(scrubbed=seconds_at(x, length, width, margin))
        if not ui.is_item_active():
            self._scrubs = False
        return TimelineEvent()

    @staticmethod
    def _diamond(draw: Any, x: float, y: float, size: float, colour: int) -> None:
        draw.add_quad_filled((x - size, y), (x, y - size), (x + size, y), (x, y + size), colour)
