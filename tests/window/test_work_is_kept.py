"""A person tries to lose work in a real window: keys, clicks and the close button as X events, kill -9, and a second start."""

import contextlib
import os
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
from real_window import RealWindow, until, x_display

from pointglass.viewer.window.session.autosave import read_unsaved
from pointglass.viewer.work.moved_scans import ends_of
from pointglass.viewer.work.project import places_in, read_project

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


@pytest.fixture
def scan(tmp_path, seed):
    """A room of 8 x 6 x 3 m as text."""
    rng = np.random.default_rng(seed)
    size = np.array([8.0, 6.0, 3.0])
    xyz = rng.random((60_000, 3)) * size
    wall = rng.integers(0, 6, len(xyz))
    xyz[np.arange(len(xyz)), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    (tmp_path / "scans").mkdir()
    path = tmp_path / "scans" / "room.xyz"
    np.savetxt(path, np.hstack([xyz, rng.integers(60, 250, (len(xyz), 3))]), fmt="%.4f")
    return path


def opened(display, scan, *arguments) -> RealWindow:
    window = RealWindow(display, scan.parents[1], *(arguments or ("view", scan)), "--view", "filled")
    if arguments != ("view",):
        window.wait_for_title("room")
    return window


def all_points(scan, window) -> None:
    """Waits until a window shows the scan completely."""
    until(lambda: [*(scan.parents[1] / "cache").glob("[!.]*/meta.json")], "all points")
    window.rest()


def dimmed(window: RealWindow) -> bool:
    """Whether a question is open: the window behind it is dimmed, the status bar too."""
    from PIL import ImageGrab

    where = window.xdo("getwindowgeometry", "--shell", window.window)
    left, top, width, height = (int(line.split("=")[1]) for line in where.splitlines()[1:5])
    box = (left + width // 2, top + height - 3, left + width // 2 + 4, top + height - 1)
    return np.array(ImageGrab.grab(box, xdisplay=window.environment["DISPLAY"])).max() < 0.9 * STATUS_BAR


STATUS_BAR = 0x25
"""Of 255: the greatest channel of the status bar, viewer.window.kit.theme.PANEL."""


def autosaves(scan):
    return sorted((scan.parents[1] / "state" / "autosave").glob("[!.]*.json"))


def measured(file) -> bool:
    """Whether an autosave holds a measurement that is ended."""
    found = read_unsaved(file)
    return found is not None and bool(found.document.measurements)


def measure(window: RealWindow) -> None:
    """Measures a distance, with the tool: no click is lost, whatever the window does meanwhile."""
    window.click(480, 400)
    window.click(720, 300)
    try:
        until(lambda: "•" in window.title, "the measurement")
    except AssertionError:  # what the window shows says why
        window.picture("not-measured")
        raise


def answered(window: RealWindow, done, what: str) -> None:
    """Presses Enter, the question's first answer, until the window has done it: the question comes when the loop has time."""

    def press() -> None:
        with contextlib.suppress(AssertionError):  # the window may have gone meanwhile
            window.keys("Return")

    until(lambda: done() or press() or waited(done, 2.0), what)


def waited(condition, seconds: float) -> bool:
    """Whether a condition came true in this time."""
    end = time.monotonic() + seconds
    while not (found := bool(condition())) and time.monotonic() < end:
        time.sleep(0.1)
    return found


def test_a_measurement_survives_kill_9_and_is_restored_by_the_next_start(display, scan):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    (file,) = until(lambda: [file for file in autosaves(scan) if measured(file)], "the autosave")
    window.process.send_signal(signal.SIGKILL)
    assert window.ended() == -signal.SIGKILL
    found = read_unsaved(file)
    assert found is not None
    made = found.document.measurements
    assert len(made) >= 1
    window = opened(display, scan)
    answered(window, lambda: "• room.xyz" in window.title, "the restored work")
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    assert read_project(project).measurements == made
    until(lambda: not autosaves(scan), "the autosave's end")
    window.wait_for_title("room.pointglass")
    assert "•" not in window.title
    window.close()
    assert window.ended() == 0


def test_the_close_button_asks_chords_work_in_flight_and_a_folder_that_is_gone_loses_nothing(display, scan, tmp_path):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    for ask in (lambda: window.keys("ctrl+q"), window.close):
        ask()
        window.rest()
        assert window.process.poll() is None
        window.keys("Escape")
        window.rest()
    window.xdo("keydown", "e")
    window.keys("ctrl+s")  # while flying
    window.xdo("keyup", "e")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    window.wait_for_title("room.pointglass")
    window.keys("Home")  # wherever the flight has led
    measure(window)
    until(lambda: autosaves(scan), "the autosave")
    away = tmp_path / "away"
    os.rename(scan.parent, away)
    try:
        window.keys("ctrl+s")
        window.rest()
        assert "•" in window.title and window.process.poll() is None, "not saved, and said so"
        window.keys("Return")
    finally:
        os.rename(away, scan.parent)
    window.close()
    answered(window, lambda: window.process.poll() is not None, "the end, after Save")
    assert window.ended() == 0
    assert len(read_project(project).measurements) >= 2 and not autosaves(scan)


NAME_FIELD = 1140, 131
"""Logical pixels: the name of the first measurement in the panel of the tool, at a window of 1280 x 720."""

DISCARD = 726, 400
"""Of the question whether changes are saved, which lies in the middle."""


def test_a_project_saved_right_after_typing_has_every_letter(display, scan):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    all_points(scan, window)  # a preview has a line more in the panel
    name = "Distance from the door to the window, at the height of the handle"
    window.click(*NAME_FIELD)
    window.xdo("type", "--delay", "1", name)  # faster than the interface takes the keys
    window.xdo("key", "ctrl+s")
    window.xdo("key", "ctrl+q")  # all is saved: no question
    assert window.ended() == 0
    (made,) = read_project(scan.with_name("room.pointglass")).measurements
    assert made.name.endswith(name)
    assert not autosaves(scan)


def test_work_discarded_for_a_scan_that_cannot_be_opened_survives_the_end_of_the_process(display, scan):
    (scan.parents[1] / "broken.las").write_bytes(b"LASF" + bytes(400))
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    (file,) = until(lambda: [file for file in autosaves(scan) if measured(file)], "the autosave")
    window.keys("o")
    window.rest()
    window.keys("ctrl+a")
    window.xdo("type", "--delay", "30", str(scan.parents[1] / "broken.las"))
    window.xdo("key", "Return")
    window.rest()
    window.click(*DISCARD)
    window.rest()
    window.keys("Return")  # it cannot be opened
    assert "• room.xyz" in window.title
    window.process.send_signal(signal.SIGTERM)
    window.ended()
    assert measured(file), "the work is still offered"


def test_a_file_that_took_the_place_of_the_open_scan_is_told_once_and_the_work_is_kept(display, scan):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    all_points(scan, window)
    loaded = scan.stat().st_size, ends_of(scan)
    rows = scan.read_text().splitlines(keepends=True)
    scan.write_text("".join(rows[: len(rows) // 2]))  # another scan under the name of the first
    assert (scan.stat().st_size, ends_of(scan)) != loaded
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    window.keys("ctrl+q")
    assert window.ended() == 0
    made = read_project(project).measurements
    (place,) = places_in(project).values()
    assert (place.size, place.ends) == loaded and made
    told = opened(display, scan, "view", project)
    until(lambda: dimmed(told), "the message that the scan is another file")
    told.keys("Return")
    until(lambda: not dimmed(told), "its end")
    told.keys("ctrl+s")
    until(lambda: places_in(project)[str(scan)].ends == ends_of(scan), "the project with the scan that is there now")
    told.keys("ctrl+q")
    assert told.ended() == 0 and read_project(project).measurements == made
    window = opened(display, scan, "view", project)
    all_points(scan, window)
    assert not dimmed(window), "a scan that was edited on purpose is told once"
    window.keys("ctrl+q")
    assert window.ended() == 0 and read_project(project).measurements == made


def test_tab_and_arrows_choose_the_button_that_enter_presses(display, scan):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    project = scan.with_name("room.pointglass")
    window.xdo("mousemove", "--window", window.window, 640, 100)
    for answer in (("Tab", "Tab"), ("Left",), ("shift+Tab",), ("Right", "Right")):  # Cancel: the last of three
        window.keys("ctrl+q")
        until(lambda: dimmed(window), "the question")
        window.keys(*answer, "Return")
        until(lambda: not dimmed(window), "its end")
        assert window.process.poll() is None and "• room.xyz" in window.title and not project.exists()
    window.keys("ctrl+q")
    until(lambda: dimmed(window), "the question")
    window.keys("Tab", "Return")  # Discard
    assert window.ended() == 0 and not project.exists() and not autosaves(scan)


def test_escape_right_after_ctrl_q_answers_its_question_and_the_tool_stays(display, scan):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    window.xdo("key", "--delay", "0", "ctrl+q", "Escape")
    window.rest()  # the question has gone
    window.click(480, 300)
    window.click(720, 400)

    def made() -> int:
        return max((len(found.document.measurements) for file in autosaves(scan) if (found := read_unsaved(file))), default=0)

    until(lambda: made() == 2, "a second measurement")
    assert window.process.poll() is None
    window.process.kill()


def test_a_project_whose_file_is_deleted_or_written_by_another_program_is_asked_about(display, scan):
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    all_points(scan, window)
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    window.wait_for_title("room.pointglass")
    made = read_project(project).measurements
    project.unlink()
    window.keys("ctrl+q")
    until(lambda: dimmed(window), "the question")
    window.keys("Escape")
    until(lambda: not dimmed(window), "its end")
    window.keys("ctrl+q")
    until(lambda: dimmed(window), "the question")
    window.keys("Return")  # Save
    until(project.exists, "the project")
    assert window.ended() == 0 and read_project(project).measurements == made
    window = opened(display, scan, "view", project)
    all_points(scan, window)
    theirs = project.read_bytes().replace(b'"Distance"', b'"Theirs"')
    project.write_bytes(theirs)
    window.keys("ctrl+q")
    until(lambda: dimmed(window), "the question, where another program has written the file")
    window.keys("Tab", "Return")  # Discard
    assert window.ended() == 0 and project.read_bytes() == theirs


def test_ctrl_z_is_the_key_that_prints_z_on_a_french_keyboard(display, scan):
    """There it lies where W is, which flies forward."""
    if not shutil.which("setxkbmap"):
        pytest.skip("setxkbmap is not installed (apt install x11-xkb-utils)")
    window = opened(display, scan)
    window.keys("t")
    measure(window)
    try:
        subprocess.run(["setxkbmap", "fr"], env=window.environment, check=True)
        window.keys("ctrl+z")
        until(lambda: "•" not in window.title, "the undo")
        window.keys("ctrl+y")
        until(lambda: "•" in window.title, "the redo")
    finally:
        subprocess.run(["setxkbmap", "us"], env=window.environment, check=True)
    window.process.kill()
