"""The graph of a height profile in the panel, and its file."""

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .....model.common.files.atomic_write import write_atomic
from ....common.errors import InputError
from ....common.text import table_places
from ....work.measuring.measure_shapes import profile_line
from ....work.measuring.measure_table import LOSS
from ...kit.widgets import tooltip_beside

if TYPE_CHECKING:
    from ....work.measuring.measurement import Measurement

HEIGHT = 90.0
"""Of the graph, design units."""
_GAP = 1.5
"""Stations that are farther apart than so many steps have no line between them: nothing was measured there."""


def draw_profile(ui: Any, measurement: "Measurement", unit: str, scale: float) -> None:
    """Heights over stations; the scale of heights is as large as fits.  The pointer reads a station."""
    profile = measurement.profile
    assert profile is not None
    stations, heights = np.array(profile.stations), np.array(profile.heights)
    corner, wide, tall = ui.get_cursor_screen_pos(), ui.get_content_region_avail().x, HEIGHT * scale
    low, high = float(heights.min()), float(heights.max())
    end = profile.step * (round(float(stations[-1]) / profile.step - 0.5) + 1)
    room = max(high - low, 1e-9 * max(abs(high), 1.0), profile.step / 10)
    middle = (low + high) / 2
    x = corner.x + stations / end * wide
    y = corner.y + tall * (0.5 - 0.88 * (heights - middle) / room)
    ink, frame = ui.get_color_u32(ui.Col_.plot_lines), ui.get_color_u32(ui.Col_.frame_bg)
    lines = ui.get_window_draw_list()
    lines.add_rect_filled(ui.ImVec2(corner.x, corner.y), ui.ImVec2(corner.x + wide, corner.y + tall), frame, 4.0)
    for k in range(len(x) - 1):
        if stations[k + 1] - stations[k] <= _GAP * profile.step:
            lines.add_line(ui.ImVec2(x[k], y[k]), ui.ImVec2(x[k + 1], y[k + 1]), ink, 1.5 * scale)
    ui.invisible_button("##profile", ui.ImVec2(max(wide, 1.0), tall))
    if ui.is_item_hovered():
        k = int(np.abs(x - ui.get_mouse_pos().x).argmin())
        lines.add_line(ui.ImVec2(x[k], corner.y), ui.ImVec2(x[k], corner.y + tall), ink, 1.0)
        tooltip_beside(ui, f"at {stations[k]:.3f} {unit}: height {heights[k]:.3f} {unit}, {profile.counts[k]} points")
    ui.text_wrapped(f"heights {low:.3f} to {high:.3f} {unit}, strip {profile.width:.3f} {unit} wide")


def write_profile(path: Path, measurement: "Measurement") -> None:
    """A CSV table of the stations: distance from the first end, height, number of points, place.  Raises InputError."""
    profile = measurement.profile
    assert profile is not None
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(("station", "height", "count", "x", "y", "z"))
    size = float(np.abs([point.position for point in measurement.points]).max())
    for station, height, count, place in zip(profile.stations, profile.heights, profile.counts, profile_line(measurement),
                                             strict=True):  # fmt: skip
        along, up, *at = table_places((station, height, *place.tolist()), size, LOSS * profile.step)
        writer.writerow([along, up, count, *at])
    try:
        write_atomic(path, lambda beside: beside.write_text(out.getvalue(), newline=""))
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=path, remedy="save it elsewhere") from None
