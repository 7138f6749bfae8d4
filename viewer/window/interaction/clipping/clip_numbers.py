"""The numbers of a clip, to be typed: its centre in the file's coordinates, and the size of a box along its own axes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ....picture.clip import Box, Clip, vector
from ...kit.sliders import number_input

AXES = ("x", "y", "z")
SIDES = ("length", "width", "height")
"""Of a box along its first, second and third axis; they are the file's until it is turned."""


def with_centre(clip: Clip, axis: int, value: float) -> Clip:
    """The clip moved along an axis of the file to ``value``, a coordinate."""
    centre = np.array(clip.centre)
    centre[axis] = value
    return replace(clip, centre=vector(centre))


def with_size(box: Box, axis: int, value: float) -> Box:
    """The box with ``value``, file units above 0, as its size along one of its axes; its centre stays."""
    half = np.array(box.half)
    half[axis] = value / 2
    return replace(box, half=vector(half))


def draw_numbers(ui: Any, clip: Clip, places: int, store: Callable[[str, Clip, str], object]) -> None:
    """Rows of fields.  places: decimals that are shown.  store: takes what was done, the clip as typed, and what was typed in,
    so that the letters of one number are one step."""
    for axis, name in enumerate(AXES):
        changed, value = _field(ui, name, clip.centre[axis], places)
        if changed and np.isfinite(value):
            store(f"Move {clip.name}", with_centre(clip, axis, value), name)
    if not isinstance(clip, Box):
        return
    for axis, name in enumerate(SIDES):
        changed, value = _field(ui, name, 2 * clip.half[axis], places)
        if changed and np.isfinite(value) and value > 0:
            store(f"Size of {clip.name}", with_size(clip, axis, value), name)


def _field(ui: Any, name: str, value: float, places: int) -> tuple[bool, float]:
    ui.align_text_to_frame_padding()
    ui.text_unformatted(name)
    ui.same_line(ui.calc_text_size("m" * 5).x)
    ui.set_next_item_width(-1)
    return number_input(ui, f"##{name}", value, f"%.{places}f")
