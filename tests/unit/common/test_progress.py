"""Progress in a pipe: a line every few seconds of long work, nothing of short work, nothing beside the window's sink."""

import io
import sys

import pytest

from pointglass.viewer.common import progress as module
from pointglass.viewer.common.errors import Cancelled
from pointglass.viewer.common.progress import duration_text, progress, set_sink


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    monkeypatch.setattr(module, "_FIRST_LINE", 8.0)  # tests/conftest.py silences it
    return now


def test_long_work_writes_a_line_every_few_seconds(clock, capsys):
    with progress(200, "rendering", "picture") as meter:
        for _ in range(200):
            clock[0] += 0.5
            meter.update(1)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "pointglass: rendering: 16 of 200 pictures (8 %), about 1 min 32 s left"
    assert lines[1] == "pointglass: rendering: 26 of 200 pictures (13 %), about 1 min 27 s left"
    assert len(lines) == 19 and all(line.startswith("pointglass: rendering: ") for line in lines)


def test_the_time_left_is_told_when_the_speed_is_known_and_without_what_is_done_once(clock, capsys):
    with progress(119, "rendering", "view") as meter:
        for seconds in (62.0, 6.0, 6.0, 6.0, 1.0):
            clock[0] += seconds
            meter.update(1)
        meter.update(0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "pointglass: rendering: 1 of 119 views (0 %), 1 min 2 s so far" and "left" not in lines[1] + lines[2]
    assert lines[3] == "pointglass: rendering: 4 of 119 views (3 %), about 11 min 30 s left"


def test_short_work_is_silent(clock, capsys):
    with progress(10, "rendering", "picture") as meter:
        for _ in range(10):
            clock[0] += 0.7
            meter.update(1)
    assert capsys.readouterr() == ("", "")


def test_a_total_that_is_not_known_is_not_promised_and_the_end_is_silent(clock, capsys):
    for total in (0, 3):
        with progress(total, "reading \x1b[31m", " points") as meter:
            clock[0] += 20
            meter.update(0)
            clock[0] += 20
            meter.update(5)
    assert capsys.readouterr().err.splitlines() == [f"pointglass: reading \\x1b[31m{text} so far" for text in (
        ", 20 s", ": 5 points, 40 s", ": 0 of 3 points, 20 s")]


def test_the_windows_sink_is_told_instead(clock, capsys):
    told = []
    set_sink(lambda *state: told.append(state) or len(told) < 2)
    try:
        with pytest.raises(Cancelled), progress(9, "reading") as meter:
            for _ in range(9):
                clock[0] += 60
                meter.update(1)
    finally:
        set_sink(None)
    assert told == [("reading", 1, 9), ("reading", 2, 9)] and capsys.readouterr().err == ""


def test_a_reader_that_has_gone_does_not_stop_the_work(clock, monkeypatch):
    gone = io.StringIO()
    gone.close()
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress(9, "reading") as meter:
        monkeypatch.setattr(sys, "stderr", gone)
        clock[0] += 60
        meter.update(1)
    monkeypatch.setattr(sys, "stderr", None)  # pythonw
    with progress(9, "reading") as meter:
        clock[0] += 60
        meter.update(1)


@pytest.mark.parametrize("seconds, text", [(0.2, "1 s"), (59.4, "59 s"), (72, "1 min 12 s"), (12_000, "3 h 20 min")])
def test_durations(seconds, text):
    assert duration_text(seconds) == text
