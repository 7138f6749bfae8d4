"""What the window remembers comes back, goes behind the command line, and a damaged file stops no window."""

import json

import pytest
from window_session import session

from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.session.preferences import (
    FILE,
    Preferences,
    preferences_of,
    read_preferences,
    take_preferences,
    with_preferences,
    write_preferences,
)


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path / "state"))
    return tmp_path / "state"


def test_what_a_session_had_is_had_by_the_next_one(state):
    assert read_preferences() == Preferences()
    made, _ = session()
    made.area.panels.inspector = False
    made.view_settings.background = "sky"
    made.work.shot_scale, made.flight.mouse = 3, "orbit"
    made.area.window_size = (1500, 900)
    write_preferences(preferences_of(made))
    kept = read_preferences()
    assert (kept.width, kept.height, kept.outliner, kept.inspector) == (1500, 900, True, False)
    assert (kept.background, kept.shot_scale, kept.mouse) == ("sky", 3, "orbit")
    following, _ = session()
    take_preferences(following, kept)
    following.area.window_size = (1500, 900)
    assert preferences_of(following) == kept
    assert [path.name for path in state.iterdir() if path.is_file()] == [FILE]


def test_the_command_line_goes_before_what_is_remembered():
    kept = Preferences(quality="fast", detail=0.5)
    assert with_preferences(Settings(), kept, ["scan.laz"]) == Settings(quality="fast", detail=0.5)
    assert with_preferences(Settings(), kept, ["scan.laz", "--quality", "balanced"]) == Settings(detail=0.5)
    assert with_preferences(Settings(), kept, ["--detail=1", "--qual=balanced", "scan.laz"]) == Settings()


@pytest.mark.parametrize("text", ["", "[]", "{", '"a"', '{"width": -5}', '{"background": "pink"}', '{"quality": "none"}',
                                  '{"detail": 1e9}', '{"mouse": "none"}', '{"shot_scale": 99}'])
def test_a_damaged_file_is_as_good_as_none(state, text, caplog):
    state.mkdir()
    (state / FILE).write_text(text)
    assert read_preferences() == Preferences() and str(state / FILE) in caplog.text


def test_fields_that_are_unknown_or_of_another_kind_are_left_out(state):
    state.mkdir()
    (state / FILE).write_text(json.dumps({"inspector": "no", "outliner": False, "later": 1, "width": True}))
    assert read_preferences() == Preferences(outliner=False)


def test_a_folder_that_cannot_be_written_is_said_in_the_log(state, caplog):
    state.write_text("a file")
    write_preferences(Preferences())
    assert "cannot be written" in caplog.text
