"""Numbers typed for a clip: what they move, and that no number changes nothing."""

from unittest.mock import MagicMock

import numpy as np
import pytest

from pointglass.viewer.picture.clip import Box, Slab, contains, vector
from pointglass.viewer.window.interaction.clipping.clip_numbers import AXES, SIDES, draw_numbers, with_centre, with_size
from pointglass.viewer.window.interaction.clipping.clip_tool import turned
from pointglass.viewer.window.kit.sliders import number_input


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


@pytest.mark.parametrize("typed", [float("nan"), float("inf"), -1.0, 0.0])
def test_no_number_and_no_size_change_nothing(typed):
    stored, ui = [], MagicMock()
    ui.input_double.return_value = (True, typed)
    draw_numbers(ui, Box((7.0, 7.0, 7.0), (1.0, 1.0, 1.0)), 3, lambda *given: stored.append(given[2]))
    assert [call.args[0] for call in ui.input_double.call_args_list] == [f"##{name}" for name in AXES + SIDES]
    assert stored == (list(AXES) if np.isfinite(typed) else [])


@pytest.mark.parametrize(("read", "expected"), [(1.235, 1.23456789), (1.2354, 1.2354), (1.2345678, 1.2345678), (2.0, 2.0)])
def test_a_field_that_is_left_as_it_was_keeps_the_digits_that_it_does_not_show(read, expected):
    ui = MagicMock()
    ui.input_double.return_value = (True, read)
    assert number_input(ui, "##x", 1.23456789, "strip %.3f m wide") == (read == expected, expected)
