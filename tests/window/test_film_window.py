"""A film in a real window, by X key and pointer events: a title is typed, saved with the project and undone; the film is killed
with -9 while its frames are made, and the next start makes the same bytes as `video`."""

import subprocess
import sys
import time

import pytest
from real_window import until, x_display
from test_work_is_kept import all_points, dimmed, opened, scan, waited  # noqa: F401  (a fixture)

from pointglass.viewer.commands.film.resumed_video import frames_beside
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import write_camera_path
from pointglass.viewer.work.document import CameraPath, Document, FilmFormat, FilmTitle, Keyframe, ScanFile
from pointglass.viewer.work.project import read_project, write_project
from pointglass.viewer.work.viewpoint import Viewpoint

pytestmark = [pytest.mark.window, pytest.mark.timeout(900)]
TITLE, RENDER = (1160, 411), (1123, 594)
"""Of the Film panel in a window of 1280 x 720: the field of the title, and, scrolled to the end, the button."""
SECONDS, RATE, SIZE = 0.125, 24.0, (1280, 720)


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


def begin_film(window) -> None:
    """Scrolls to the button, presses it and saves under the name that is proposed."""
    window.xdo("mousemove", "--sync", "--window", window.window, 1180, 300)
    for _ in range(12):
        window.xdo("click", 5)
        time.sleep(0.1)
    window.rest()
    window.click(*RENDER)
    try:
        until(lambda: dimmed(window), "the dialog")
    except AssertionError:  # what the window shows says why
        window.picture("no-dialog")
        raise

    def begun() -> bool:
        window.keys("Return")  # one that comes before the field has the keyboard is lost
        return waited(lambda: not dimmed(window), 8.0)

    until(begun, "the end of the dialog")


def test_a_typed_title_is_saved_and_a_film_that_was_killed_is_gone_on_with(display, scan):  # noqa: F811
    project, out = scan.with_suffix(".pointglass"), scan.with_name("room.mp4")
    cameras = [from_fov(*SIZE, 60, look_at((2.0 + n, 3.0, 1.5), (6.0, 3.0, 1.2)), f"key_{n:03d}") for n in range(2)]
    keys = tuple(Keyframe(SECONDS * n, Viewpoint.of(camera, f"Key {n}")) for n, camera in enumerate(cameras))
    film = CameraPath(keys, fps=RATE, format=FilmFormat(size=SIZE))
    write_project(project, Document(scans=(ScanFile(str(scan)),), path=film))
    window = opened(display, scan, "view", project)
    all_points(scan, window)
    window.keys("k")
    window.rest()
    window.click(*TITLE)
    window.xdo("type", "--delay", "120", "Hall 7")
    window.rest()
    window.keys("Escape", "ctrl+s")
    until(lambda: read_project(project).path.title == FilmTitle("Hall 7"), "the title in the project")
    begin_film(window)
    until(lambda: len(list(frames_beside(out).glob("*.png"))) >= 1, "a frame", 300.0)
    window.process.kill()
    window.ended()
    assert frames_beside(out).is_dir()
    kept = {path: path.stat().st_mtime_ns for path in frames_beside(out).glob("*.png")}

    window = opened(display, scan, "view", project)
    all_points(scan, window)
    window.keys("k")
    window.rest()
    assert not out.exists(), "the empty file of the killed film would be asked about"
    begin_film(window)
    until(lambda: len(list(frames_beside(out).glob("*.png"))) > len(kept) or out.stat().st_size > 0, "more frames", 300.0)
    assert all(path.stat().st_mtime_ns == made for path, made in kept.items() if path.exists()), "frames are kept"
    until(lambda: out.exists() and out.stat().st_size > 0 and not frames_beside(out).exists(), "the film", 300.0)
    window.process.kill()
    window.ended()
    path, again = scan.with_name("path.json"), scan.with_name("again.mp4")
    write_camera_path(path, cameras, fps=RATE, seconds=SECONDS, title=FilmTitle("Hall 7"))
    done = subprocess.run([sys.executable, "-m", "pointglass.viewer", "video", scan, "--path", path, "--out", again,
                           "--view", "neural", "--background", "plain"], env=window.environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert again.read_bytes() == out.read_bytes()
