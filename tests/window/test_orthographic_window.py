"""Orthographic views in a real window, by X key and pointer events: what F12 saves is what `render --like` draws again, and a
project keeps the view."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image
from real_window import until, x_display
from test_work_is_kept import all_points, opened, scan  # noqa: F401  (a fixture)

from pointglass.viewer.window.kit import theme
from pointglass.viewer.work.pictures.shot_metadata import read_shot
from pointglass.viewer.work.project import read_project

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
PICTURE = 600, 400
"""A place over the picture, of a window of 1280 x 720."""
ICON = 214, 614
"""Of orthographic views, in the tool bar."""


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


def shot(window):
    """F12: the file that it saves."""
    folder = window.folder
    before = set(folder.glob("pointglass*.png"))
    window.keys("F12")
    (made,) = until(lambda: set(folder.glob("pointglass*.png")) - before, "the picture")
    until(lambda: made.stat().st_size > 0, "its content")
    window.rest()
    return made


def test_a_view_is_orthographic_zooms_at_the_pointer_and_is_drawn_again_from_its_picture(display, scan):  # noqa: F811
    window = opened(display, scan)
    all_points(scan, window)
    first = read_shot(shot(window)).spec.camera
    assert first.orthographic is None
    window.keys("x")
    window.rest()
    picture = shot(window)
    camera = read_shot(picture).spec.camera
    assert camera.orthographic is not None and np.array_equal(camera.camera_to_world, first.camera_to_world)
    out = window.folder / "again"
    done = subprocess.run([sys.executable, "-m", "pointglass.viewer", "render", scan, "--like", picture, "--out", out],
                          env=window.environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (again,) = out.glob("*.png")
    assert np.array_equal(np.asarray(Image.open(again)), np.asarray(Image.open(picture)))
    window.xdo("mousemove", "--sync", "--window", window.window, *PICTURE)
    for _ in range(3):
        window.xdo("click", 4)
    window.rest()
    near = read_shot(shot(window)).spec.camera
    assert near.orthographic == pytest.approx(camera.orthographic * 0.85**3)
    fixed = [pixel for pixel in np.mgrid[: near.width : 2, : near.height : 2].reshape(2, -1).T.tolist()
             if np.abs(near.project(camera.unproject([pixel], 3.0))[0][0] - pixel).max() < 1.0]
    assert fixed, "one place of the picture stays, at every depth"
    assert np.abs(np.mean(fixed, 0) - PICTURE).max() < 300, "it is at the pointer, beside the panels"
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    kept = read_project(project).view
    assert kept is not None and kept.orthographic == near.orthographic
    window.keys("x")
    window.rest()
    back = read_shot(shot(window)).spec.camera
    assert back.orthographic is None and np.allclose(back.view_rotation, near.view_rotation)
    window.click(*ICON)
    window.rest()
    window.picture("icon")
    with Image.open(window.folder / "icon.png") as screen:
        colour = np.array(screen.getpixel((ICON[0] - 12, ICON[1] - 12)))[:3] / 255
    accent = theme.ACCENT.x, theme.ACCENT.y, theme.ACCENT.z
    assert np.abs(colour - accent).max() < 0.01, "switched on, also under the pointer"
    window.keys("ctrl+q")
    assert window.ended() == 0
