"""What drags and the wheel do by preset, and that the table of controls says it of the one that is usual."""

import pytest

from pointglass.viewer.window.flight.mouse import DEFAULT, DRAGS, GESTURES, PRESETS
from pointglass.viewer.window.interaction.controls import CONTROLS


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_can_look_orbit_move_and_zoom(name):
    mouse = PRESETS[name]
    assert set(mouse.drags) <= set(DRAGS) and {"look", "orbit", "pan"} <= set(mouse.drags.values())
    assert {mouse.turn(control=False), mouse.turn(control=True)} == {"zoom", "speed"}
    assert all(text in GESTURES.values() for _, text in mouse.rows)


def test_shift_changes_only_drags_that_have_an_entry_for_it():
    mouse = PRESETS["fly"]
    assert (mouse.drag("middle", shift=True), mouse.drag("middle", shift=False)) == ("pan", "orbit")
    assert mouse.drag("left", shift=True) == mouse.drag("left", shift=False) == "look"
    assert mouse.drag("fourth", shift=False) is None


def test_the_table_of_controls_says_what_the_usual_preset_does():
    said = {control.action: control.help for control in CONTROLS["Move"] if control.action in GESTURES}
    assert said == GESTURES and set(PRESETS[DEFAULT].drags.values()) | {"zoom", "speed"} == set(said)
