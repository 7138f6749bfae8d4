"""Notes in a real window, by X key and pointer events: written, kept by Esc, chosen from lists by arrow keys, saved, restored,
and reported."""

import csv
import re
import signal
import time
import zipfile

import pytest
from real_window import until, x_display
from test_work_is_kept import all_points, answered, autosaves, dimmed, opened, scan  # noqa: F401  (a fixture)

from pointglass.viewer.window.session.autosave import read_unsaved
from pointglass.viewer.work.project import read_project

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
LISTED = 100, 236
"""Of the outliner: the first row below its groups' titles."""
STATUS, REPORT = (1150, 215), (1105, 356)
"""Of the panel with one note, at a window of 1280 x 720."""


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


def notes_of(of) -> list:
    """Those in the autosaves."""
    return [note for file in autosaves(of) if (found := read_unsaved(file)) for note in found.document.annotations]


def texts(of) -> list[str]:
    return [note.text for note in notes_of(of)]


def written(window, of, text: str) -> None:
    """A click writes a note and its text takes the keys, without another click, and those typed before it is there."""
    window.click(600, 420)
    window.xdo("type", "--delay", "12", text)
    until(lambda: texts(of) == [text], f"the text; there is {texts(of)}")


def saved_as(window, ending: str, path):
    """Report…, with this ending."""
    def saved() -> bool:
        return path.exists() and path.stat().st_size > 0  # an empty file reserves its name

    window.click(*REPORT)
    until(lambda: dimmed(window), "the dialog")
    window.rest()
    window.keys("ctrl+a")
    window.xdo("type", "--delay", "12", str(path))
    window.rest()
    try:
        answered(window, lambda: path.exists(), f"the {ending}")
        until(saved, f"the {ending}")
    except AssertionError:  # what the window shows says why
        window.picture("not-saved")
        raise
    window.rest()
    return path


def test_a_note_is_kept_through_escape_a_crash_and_saving_and_goes_into_every_report(display, scan):  # noqa: F811
    window = opened(display, scan)
    all_points(scan, window)
    window.keys("l")
    written(window, scan, "Crack, 3 mm wide")
    window.xdo("key", "Escape")
    time.sleep(3.0)
    assert texts(scan) == ["Crack, 3 mm wide"], "Esc leaves the field and keeps what was typed"
    window.process.send_signal(signal.SIGKILL)
    window.ended()
    window = opened(display, scan)
    answered(window, lambda: "• room.xyz" in window.title, "the restored work")
    all_points(scan, window)
    folder = scan.parents[1]
    window.click(*LISTED)  # selects the tool and chooses the note
    window.rest()
    for keys in (("Down", "Down", "Return"), ("Up", "Escape")):  # to the third of the list; Esc leaves it
        window.click(*STATUS)
        window.rest()
        for key in keys:
            window.xdo("key", key)
            window.rest()
        until(lambda: [note.status for note in notes_of(scan)] == ["done"], "the status")
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    (note,) = read_project(project).annotations
    assert (note.text, note.status) == ("Crack, 3 mm wide", "done") and note.view is not None and note.made
    pages = saved_as(window, "report", folder / "r.pdf").read_bytes()
    assert pages.startswith(b"%PDF") and len(re.findall(rb"/Type /Page\b", pages)) >= 1
    issues = zipfile.ZipFile(saved_as(window, "issues", folder / "r.bcf"))
    assert sum(name.endswith("snapshot.png") for name in issues.namelist()) == 1
    (row,) = csv.DictReader(saved_as(window, "table", folder / "r.csv").open(encoding="utf-8"))
    assert row["text"] == "Crack, 3 mm wide" and float(row["x"]) == pytest.approx(note.position[0], abs=1e-9)
    window.keys("ctrl+q")
    assert window.ended() == 0
