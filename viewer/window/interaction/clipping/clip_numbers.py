"""The numbers of a clip, to be typed: its centre in the file's coordinates, and the size of a box along its own axes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ....picture.clip import Box, Clip, vector
from ...kit.number_field import number_input, say_at_field

AXES = ("x", "y", "z")
SIDES = ("length", "width", "height")
"""Of a box along its first, second and third axis; they are the file's until it is turned."""

FARTHEST = 10.0
"""How far a clip reaches beyond the scan at most, in its largest extents."""


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


def clip_fields(ui: Any, clip: Clip, places: int, bounds: np.ndarray, store: Callable[[str, Clip, str], object]) -> None:
    """Rows of fields.  What is typed is limited to sizes and places that can be seen beside the scan, and that is said at the
    field.  places: decimals that are shown.  bounds: (2, 3) of the scan.  store: takes what was done, the clip as typed, and
    what was typed in."""
    extent = float(np.ptp(bounds, axis=0).max())
    for axis, name in enumerate(AXES):
        limits = bounds[0, axis] - FARTHEST * extent, bounds[1, axis] + FARTHEST * extent
        value = limited_field(ui, name, clip.centre[axis], f"%.{places}f", limits)
        if value is not None:
            store(f"Move {clip.name}", with_centre(clip, axis, value), name)
    if not isinstance(clip, Box):
        return
    for axis, name in enumerate(SIDES):
        value = limited_field(ui, name, 2 * clip.half[axis], f"%.{places}f", size_limits(extent))
        if value is not None:
            store(f"Size of {clip.name}", with_size(clip, axis, value), name)


def limited_field(ui: Any, name: str, value: float, form: str, limits: tuple[float, float]) -> float | None:
    """A field behind its name.  limits: lowest and highest; where the lowest is above 0, the number is a size.  Returns the
    number that was typed, within the limits; None where none was."""
    if name in (*AXES, *SIDES):
        ui.align_text_to_frame_padding()
        ui.text_unformatted(name)
        ui.same_line(ui.calc_text_size("m" * 5).x)
    ui.set_next_item_width(-1)
    changed, read = number_input(ui, f"##{name}", value, form)
    if not changed:
        return None
    if limits[0] > 0 and read <= 0:
        say_at_field(ui, f"{name} {read:g}: expected a size above 0; it stays as it was")
        return None
    found = float(np.clip(read, *limits))
    if found != read:
        say_at_field(ui, f"{name} {read:g} is limited to {found:g}: {FARTHEST:g} times the scan's extent is seen at most")
    return found


def size_limits(extent: float) -> tuple[float, float]:
    """Of sides and thicknesses.  extent: the scan's largest."""
    return 1e-6 * extent, 2 * FARTHEST * extent
