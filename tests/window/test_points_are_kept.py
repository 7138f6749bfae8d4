"""Points that a person has clicked: their exact places, read from a file that takes a while, and those not ended yet."""

import signal
import time

import numpy as np
import pytest
from real_window import until, x_display
from test_work_is_kept import answered, autosaves, opened, scan, waited  # noqa: F401  (a fixture)

from pointglass.viewer.window.session.autosave import read_unsaved
from pointglass.viewer.work.project import read_project

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
LINES = 800_000
"""Of a text that takes half a second to read from its beginning; a grid's cell in it is coarser than its last digit."""


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """A room of 8 x 6 x 3 m as a large text, and its coordinates."""
    rng = np.random.default_rng(4)
    size = np.array([80_000, 60_000, 30_000])
    xyz = rng.integers(0, size, (LINES, 3))
    wall = rng.integers(0, 6, LINES)
    xyz[np.arange(LINES), wall % 3] = np.where(wall < 3, 0, size[wall % 3])
    xyz = xyz * 1e-4
    path = tmp_path_factory.mktemp("large") / "scans" / "room.xyz"
    path.parent.mkdir()
    path.write_text("".join(f"{x:.4f} {y:.4f} {z:.4f} {r} {r} 99\n" for (x, y, z), r in zip(xyz.tolist(), wall.tolist())))
    return path, xyz


def begun(of) -> bool:
    """Whether the autosave holds a point of a measurement that is not ended."""
    found = [read_unsaved(file) for file in autosaves(of)]
    return any(each is not None and each.begun is not None for each in found)


def measure(window, of) -> None:
    """Measures one distance: no click is lost, whatever the window does meanwhile."""
    window.click(480, 400)
    until(lambda: begun(of), "the first point")
    window.click(720, 300)
    until(lambda: "•" in window.title, "the measurement")


def exact(measurements, xyz) -> bool:
    """Whether every measured place is one of the file."""
    places = [point.position for item in measurements for point in item.points]
    return bool(places) and all((np.abs(xyz - place).max(axis=1) < 1e-9).any() for place in places)


def test_saving_waits_for_points_that_are_read_and_undo_does_not_lose_their_places(display, large):
    text, xyz = large
    window = opened(display, text)
    project = text.with_name("room.pointglass")
    window.keys("t")
    measure(window, text)
    window.keys("ctrl+s")
    until(project.exists, "the project")
    window.wait_for_title("room.pointglass")
    time.sleep(3.0)  # what could still arrive has arrived
    assert "•" not in window.title
    assert exact(read_project(project).measurements, xyz)
    before = read_project(project).measurements
    measure(window, text)
    window.keys("ctrl+z")
    until(lambda: "•" not in window.title, "the undo")
    time.sleep(3.0)
    assert "•" not in window.title, "what was undone does not come back"
    window.keys("ctrl+shift+z")
    until(lambda: "•" in window.title, "the redo")
    window.keys("ctrl+s")
    until(lambda: "•" not in window.title, "the save")
    made = read_project(project).measurements
    assert len(made) > len(before) and exact(made, xyz)
    window.close()
    assert window.ended() == 0


def test_quitting_saves_points_that_are_still_read(display, large):
    text, xyz = large
    project = text.with_name("room.pointglass")
    project.unlink(missing_ok=True)
    window = opened(display, text)
    window.keys("t")
    measure(window, text)
    window.keys("ctrl+q")
    answered(window, lambda: window.process.poll() is not None, "the end, after Save")
    assert window.ended() == 0
    assert exact(read_project(project).measurements, xyz)
    assert not autosaves(text)


def test_points_of_a_measurement_that_is_not_ended_survive_kill_9(display, scan):  # noqa: F811
    window = opened(display, scan)
    window.keys("t")
    window.click(480, 420)
    until(lambda: begun(scan), "the first point")
    (file,) = autosaves(scan)
    assert "•" not in window.title, "nothing of the project has changed"
    window.process.send_signal(signal.SIGKILL)
    window.ended()
    found = read_unsaved(file)
    assert found is not None and found.begun is not None and not found.document.measurements
    written = file.stat().st_mtime_ns
    window = opened(display, scan)

    def restored() -> bool:
        """Whether the new window has taken over the autosave, and written it."""
        return file.exists() and file.stat().st_mtime_ns != written and begun(scan)

    until(lambda: window.keys("Return") or waited(restored, 10.0), "the restored point")
    window.click(720, 400)
    until(lambda: "•" in window.title, "the second point")
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    (made,) = read_project(project).measurements
    assert made.points[0].position == found.begun.points[0].position and made.kind == found.begun.kind == "distance"
    until(lambda: not autosaves(scan), "the autosave's end")
    window.close()
    assert window.ended() == 0
