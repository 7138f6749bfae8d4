"""A mesh beside a scan in a real window, by X key and pointer events: what F12 saves is what `render --like` draws again, it is
hidden, shown again by undo, measured from, saved with the project and there when that is opened."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from PIL import Image
from real_window import until, x_display
from test_orthographic_window import shot
from test_work_is_kept import all_points, autosaves, opened, scan  # noqa: F401  (a fixture)

from pointglass.viewer.window.session.autosave import read_unsaved
from pointglass.viewer.work.pictures.shot_metadata import read_shot
from pointglass.viewer.work.project import read_project

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
EYE = 22, 227
"""Of the outliner, at a window of 1280 x 720: the eye of the first mesh."""


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


def red(picture) -> int:
    """Pixels of the mesh, which alone is red."""
    image = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    return int(((image[..., 0] > 100) & (image[..., 1] < 30) & (image[..., 2] < 30)).sum())


def meshes_of(of) -> list:
    """Those in the autosaves."""
    return [layer for file in autosaves(of) if (found := read_unsaved(file)) for layer in found.document.meshes]


def measured_in(of) -> list:
    """Measurements in the autosaves."""
    return [made for file in autosaves(of) if (found := read_unsaved(file)) for made in found.document.measurements]


def test_a_mesh_is_shown_hidden_saved_and_opened_again(display, scan):  # noqa: F811
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    box.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))  # y is up in a glTF
    box.apply_translation((4.0, 1.5, -3.0))
    box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255]))
    mesh = scan.with_name("box.glb")
    box.export(mesh)
    window = opened(display, scan, "view", scan, mesh)
    all_points(scan, window)
    until(lambda: meshes_of(scan), "the mesh in the document")
    window.rest()
    picture = shot(window)
    (layer,) = read_shot(picture).spec.edits.meshes
    assert (layer.path, layer.up) == ("box.glb", "y") and len(layer.checksum) == 64
    whole = red(picture)
    assert whole > 2000
    out = window.folder / "again"
    done = subprocess.run([sys.executable, "-m", "pointglass.viewer", "render", scan, "--like", picture, "--out", out],
                          env=window.environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (again,) = out.glob("*.png")
    assert np.array_equal(np.asarray(Image.open(again)), np.asarray(Image.open(picture)))
    for away in (9, 3, 0):  # RealWindow.click would begin left of the window
        window.xdo("mousemove", "--sync", "--window", window.window, EYE[0] + away, EYE[1])
    window.rest()
    window.xdo("click", 1)
    until(lambda: not meshes_of(scan)[0].visible, "the eye's click")
    window.rest()
    assert red(shot(window)) == 0
    window.keys("ctrl+z")
    window.rest()
    assert red(shot(window)) == whole
    window.keys("1", "t")  # raw: what is not background was measured
    window.rest()
    window.picture("screen")
    screen = np.asarray(Image.open(window.folder / "screen.png").convert("RGB")).astype(int)
    shown = (screen[..., 0] > 60) & (screen[..., 1:] < 30).all(axis=2)
    rows, columns = np.nonzero(shown)
    window.click(int(np.median(columns)), int(np.median(rows)))
    scanned = (screen[..., 1:].max(axis=2) >= 90) & (np.ptp(screen, axis=2) > 60)  # neither the red box nor panels
    beside = next((x, y) for y in range(640, 100, -1) for x in range(250, 1058) if scanned[y, x])
    window.click(*beside)
    (made,) = until(lambda: measured_in(scan), "the distance from the mesh")
    ends = {point.scan: np.array(point.position) for point in made.points}
    assert np.abs(ends["model box.glb"] - (4.0, 3.0, 1.5)).max() == pytest.approx(1.0, abs=1e-6), "a place on the box"
    assert len(ends) == 2 and all(point.spacing > 0 for point in made.points if point.scan != "model box.glb")
    window.keys("ctrl+s")
    project = scan.with_name("room.pointglass")
    until(project.exists, "the project")
    (kept,) = read_project(project).meshes
    assert kept.visible and kept.path == str(mesh) and '"box.glb"' in project.read_text("utf-8")
    window.keys("ctrl+q")
    assert window.ended() == 0
    window = opened(display, scan, "view", project)
    window.rest()
    assert red(until(lambda: picture if red(picture := shot(window)) else None, "the mesh of the project")) > 2000
    window.keys("ctrl+q")
    assert window.ended() == 0
