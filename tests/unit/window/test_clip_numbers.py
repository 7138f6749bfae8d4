"""Numbers typed for a clip: what they move, and that no number changes nothing."""

from unittest.mock import MagicMock

import numpy as np
import pytest

from pointglass.viewer.picture.clip import Box, Slab, contains, vector
from pointglass.viewer.window.interaction.clipping.clip_numbers import clip_fields, with_centre, with_size
from pointglass.viewer.window.interaction.clipping.clip_tool import turned
from pointglass.viewer.window.kit.number_field import number_input


@pytest.mark.parametrize("axis", range(3))
def test_a_turned_box_has_the_size_that_was_typed_along_its_own_axis_and_keeps_its_centre(seed, axis):
    rng = np.random.default_rng(seed)
    centre, half, size = rng.normal(size=3) * 1e5, rng.uniform(1, 5, 3), float(rng.uniform(0.5, 20))
    box = turned(Box(vector(centre), vector(half)), float(rng.uniform(0, 360)), np.array([0.0, 0.0, 1.0]))
    assert isinstance(box, Box)
    made = with_size(box, axis, size)
    assert made.centre == box.centre and made.axes == box.axes
    edge = np.array(made.axes[axis]) * size / 2
    inside, outside = centre + 0.999 * edge, centre + 1.001 * edge
    assert contains((made,), np.array([inside, outside, centre - 0.999 * edge])).tolist() == [True, False, True]


def test_a_typed_coordinate_moves_along_one_axis_of_the_file_to_the_last_digit():
    slab = Slab((1.0, 2.0, 3.0), (0.0, 0.0, 1.0), 0.5)
    assert with_centre(slab, 0, 691234.5678).centre == (691234.5678, 2.0, 3.0)


def left_with(text: str | None) -> MagicMock:
    """The interface in the frame in which a field is left with this text; None: while it is typed in."""
    ui = MagicMock(**{"get_window_pos.return_value.x": 900.0, "get_window_width.return_value": 300.0,
                      "get_font_size.return_value": 14.0, "get_item_rect_min.return_value.y": 80.0})
    ui.is_item_deactivated.return_value = text is not None
    ui.internal.get_input_text_state.return_value.text_src = text
    return ui


@pytest.mark.parametrize(("typed", "centre", "side", "said"), [
    (None, None, None, ("", "")),
    ("nan", None, None, ("\u201cnan\u201d is not a number", "\u201cnan\u201d is not a number")),
    ("1e999", None, None, ("\u201c1e999\u201d is not a number",) * 2),
    ("12abc", None, None, ("\u201c12abc\u201d is not a number",) * 2),
    ("-1", -1.0, None, ("", "width -1: expected a size above 0; it stays as it was")),
    ("0", 0.0, None, ("", "width 0: expected a size above 0")),
    ("1e30", 44.0, 80.0, ("x 1e+30 is limited to 44: 10 times the scan's extent", "width 1e+30 is limited to 80")),
])  # fmt: skip
def test_what_is_no_number_or_far_beyond_the_scan_is_limited_and_said_when_its_field_is_left(typed, centre, side, said):
    ui, stored = left_with(typed), {}
    clip_fields(ui, Box((7.0, 7.0, 7.0), (1.0, 1.0, 1.0)), 3, np.array([[0.0] * 3, [4.0] * 3]),
                lambda what, clip, field: stored.update({field: clip}))
    fields = [call.args[0] for call in ui.input_double.call_args_list]
    lines = [call.args[0] for call in ui.text_unformatted.call_args_list]
    for name, text in zip(("x", "width"), said, strict=True):
        assert f"##{name}" in fields and (not text or any(text in line for line in lines)), lines
    assert (stored["x"].centre[0] if "x" in stored else None) == centre
    assert (2 * stored["width"].half[1] if "width" in stored else None) == side


@pytest.mark.parametrize(("text", "expected"), [
    ("strip 1.235 m wide", 1.23456789), ("1.2354", 1.2354), ("1.2345678 m", 1.2345678), ("2", 2.0), ("", 1.23456789),
    ("strip 2 m", 2.0), ("two", 1.23456789), (" -2.5e-1 ", -0.25), (".5", 0.5), ("2 ft", 1.23456789),
])  # fmt: skip
def test_a_field_that_is_left_as_it_was_keeps_the_digits_that_it_does_not_show(text, expected):
    changed, value = number_input(left_with(text), "##x", 1.23456789, "strip %.3f m wide")
    assert value == expected and changed == (expected != 1.23456789)
