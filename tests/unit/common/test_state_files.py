"""What the program remembers for itself: nothing in it keeps the window from opening."""

import json
import logging
import os

import pytest

from pointglass.viewer.common.state_files import read_state, write_state
from pointglass.viewer.window.file_dialog.remembered_folders import RememberedFolders
from pointglass.viewer.window.session.preferences import Preferences, read_preferences, write_preferences
from pointglass.viewer.window.session.recent import recent_scans

BAD = {
    "brackets": b"[" * 100_000, "braces": b'{"a":' * 100_000, "no JSON": b"nonsense", "not UTF-8": b"\xff\xfe{}", "empty": b"",
    "NUL": b"\0" * 100, "a number": b"3", "5000 digits": b"9" * 5000, "null": b"null", "a text": b'"x"',
    "torn": b'{"width": 12', "out of range": b'{"width": 5, "height": 99999999}',
    "wrong types": b'{"width": "5", "last": 3, "recent": {"a": 1}}', "infinite": b'{"detail": Infinity, "width": 1e999}',
    "huge": b"[" + b"0," * (9 << 20) + b"0]", "rows": b'[{"paths": 3}, 4, {"paths": ["a"], "title": "x", "points": Infinity}]',
}


@pytest.fixture
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path / "state"))
    (tmp_path / "state").mkdir()
    return tmp_path / "state"


@pytest.mark.parametrize("what", BAD)
def test_no_state_keeps_the_window_from_opening(state, what, caplog):
    names = ("window.json", "recent.json", "folders.json")
    for name in names:
        (state / name).write_bytes(BAD[what])
    assert isinstance(read_preferences(), Preferences) and isinstance(recent_scans(), list)
    assert isinstance(RememberedFolders().recent, list)
    for name in names:
        aside = state / f"{name}.unreadable"
        assert aside.exists() != (state / name).exists()
        if aside.exists():
            assert aside.read_bytes() == BAD[what]
    assert (state / "window.json").exists() or "window.json.unreadable" in caplog.text
    write_preferences(Preferences(width=999))
    assert read_preferences().width == 999


def test_a_line_says_it_once(state, caplog):
    (state / "window.json").write_bytes(BAD["brackets"])
    with caplog.at_level(logging.WARNING):
        read_preferences()
        read_preferences()
    assert len(caplog.records) == 1 and "kept as window.json.unreadable" in caplog.records[0].getMessage()


def test_a_pipe_is_not_waited_for(state):
    os.mkfifo(state / "window.json")
    (state / "recent.json").mkdir()
    assert read_preferences() == Preferences() and recent_scans() == []


def test_what_is_remembered_is_for_its_owner_and_whole(tmp_path):
    path = tmp_path / "new" / "a.json"
    write_state(path, {"a": 1})
    assert path.parent.stat().st_mode & 0o077 == 0 and read_state(path, dict, {}) == {"a": 1}
    path.write_text(json.dumps([1]))
    assert read_state(path, lambda found: found["a"], "otherwise") == "otherwise"
