"""Every chord of the table of controls, pressed as X key events in a real window: it acts once, and the camera stays."""

import json

import pytest
from x_keyboard import needs_xdotool
from x_server import run_with_display

from pointglass.viewer.window.interaction.controls import by_chord

pytestmark = [pytest.mark.window, pytest.mark.timeout(400)]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    needs_xdotool()
    folder = tmp_path_factory.mktemp("chords")
    done = run_with_display("drive_chords.py", folder, seconds=300)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return json.loads((folder / "chords.json").read_text())


@pytest.mark.parametrize("key", by_chord())
def test_a_chord_acts_once_also_while_flying_and_never_flies_itself(report, key):
    control, found = by_chord()[key], report[key]
    assert found["rest"] == found["w"] == [control.action]
    assert found.get("shift", [control.action]) == [control.action]
    assert found["rest held"] == [] and found["rest moved"] == 0.0
    assert found["w held"] == ["forward"]
    assert found["dialog"] == ([control.action] if control.everywhere else [])


def test_a_key_that_is_held_within_a_long_frame_flies(report):
    assert 0.01 < report["within a frame"] <= 0.1 < report["in a long frame"] < 0.6  # seconds at full speed


def test_the_table_has_the_chords_that_keep_work():
    assert {control.action for control in by_chord().values()} >= {"save", "save_as", "quit", "undo", "redo"}
