"""Two dates, and a scan and a model, in a real window, by X key and pointer events: compared, coloured in a saved picture, and
side by side."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from dated_scans import dates_in_colour
from PIL import Image
from real_window import RealWindow, until, x_display
from test_meshes_window import meshes_of
from test_orthographic_window import shot

from pointglass.viewer.work.pictures.shot_metadata import read_shot
from pointglass.viewer.work.project import read_project

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
TOOL, START, BESIDE, GRIP = (214, 350), (1107, 280), (1084, 313), (624, 345)
"""The icon of the tool, its button, the box "side by side" and the grip of the handle, in a window of 1280 x 720."""
START_WITH_MODEL = 1107, 276


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


def room(seed: int, raised: float) -> np.ndarray:
    """(n, 6) points and colours of a grey room of 6 x 5 x 3 m; half of its floor is raised."""
    rng = np.random.default_rng(seed)
    size = np.array([6.0, 5.0, 3.0])
    xyz = rng.random((150_000, 3)) * size
    wall = rng.integers(0, 6, len(xyz))
    xyz[np.arange(len(xyz)), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    xyz[(wall == 2) & (xyz[:, 0] > 3), 2] += raised
    return np.column_stack([xyz + rng.normal(0, 0.001, xyz.shape), np.full((len(xyz), 3), 128)])


def colours(picture) -> np.ndarray:
    """(n, 3) of the pixels of the middle of a saved picture that are not background."""
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB"))[60:-160, 60:-200].reshape(-1, 3).astype(int)
    return pixels[pixels.sum(axis=1) > 150]


def red(picture) -> float:
    """Share of the pixels."""
    found = colours(picture)
    return float((found[:, 0] > found[:, 2] + 40).mean())


def drawn_again(window, scans, picture) -> bool:
    """Whether `render --like` writes the same file."""
    out = window.folder / f"again {picture.stem}"
    done = subprocess.run([sys.executable, "-m", "pointglass.viewer", "render", *scans, "--like", picture, "--out", out],
                          env=window.environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return (out / picture.name).read_bytes() == picture.read_bytes()


def test_two_dates_are_compared_by_clicks_and_the_red_change_is_kept_in_the_project(display, tmp_path, seed):
    scans = [tmp_path / "before.xyz", tmp_path / "after.xyz"]
    for number, (path, raised) in enumerate(zip(scans, (0.0, 0.03), strict=True)):
        np.savetxt(path, room(seed + number, raised), fmt="%.4f")
    window = RealWindow(display, tmp_path, "view", *scans, "--view", "filled")
    window.wait_for_title("·")
    until(lambda: [*(tmp_path / "cache").glob("[!.]*/meta.json")], "all points")
    window.rest()
    window.keys("x")
    window.rest()
    grey = colours(shot(window))
    assert (np.ptp(grey, axis=1) < 12).mean() > 0.95
    window.click(*TOOL)
    window.rest()
    window.click(*START)
    until(lambda: red(shot(window)) > 0.02, "the change")
    picture = shot(window)
    made = colours(picture)
    assert (made[:, 2] > made[:, 0] + 40).mean() < 0.01, "nothing sank"
    assert drawn_again(window, scans, picture)
    window.keys("ctrl+s")
    project = tmp_path / "before.pointglass"
    until(project.exists, "the project")
    window.keys("ctrl+q")
    assert window.ended() == 0, "nothing is left to be saved"
    kept = read_project(project).comparison
    assert kept is not None and kept.figures is not None and kept.figures.points == 150_000
    window = opened_again(display, tmp_path, project)
    until(lambda: red(shot(window)) > 0.02, "the change, which the project has")
    window.keys("ctrl+z")
    window.keys("ctrl+q")
    assert window.ended() == 0


def opened_again(display, tmp_path, project) -> RealWindow:
    """A window with the project, in whose folder there are no pictures of the one before."""
    for old in tmp_path.glob("pointglass*.png"):
        old.unlink()
    window = RealWindow(display, tmp_path, "view", project)
    window.wait_for_title("·")
    return window


def blue(picture) -> float:
    """Share of the pixels."""
    found = colours(picture)
    return float((found[:, 2] > found[:, 0] + 40).mean())


def test_a_scan_is_compared_with_a_model_by_clicks_which_is_kept_drawn_again_and_undone(display, tmp_path, seed):
    scan, model = tmp_path / "room" / "scan.xyz", tmp_path / "room" / "design.obj"
    scan.parent.mkdir()
    np.savetxt(scan, room(seed, 0.03), fmt="%.4f")
    box = trimesh.creation.box((6.0, 5.0, 3.0))
    box.apply_translation((3.0, 2.5, 1.5))
    box.export(model)
    window = RealWindow(display, tmp_path, "view", scan, model, "--view", "filled")
    window.wait_for_title("·")
    until(lambda: meshes_of(scan), "the mesh in the document")
    window.rest()
    window.keys("x")
    window.rest()
    window.click(*TOOL)
    window.rest()
    assert blue(shot(window)) < 0.01
    window.click(*START_WITH_MODEL)
    until(lambda: blue(shot(window)) > 0.02, "the floor, which lies inside the model")
    picture = shot(window)
    found = colours(picture)
    assert (found[:, 0] > found[:, 2] + 40).mean() < 0.01, "nothing lies outside"
    spec = read_shot(picture).spec
    assert spec.edits.comparison.before == ("design.obj", 12) and not spec.edits.meshes[0].visible
    assert drawn_again(window, [scan], picture)
    window.keys("ctrl+s")
    project = scan.with_name("scan.pointglass")
    until(project.exists, "the project")
    kept = read_project(project).comparison
    assert kept is not None and (kept.method, kept.figures.points) == ("c2m", 150_000)
    window.keys("ctrl+z")
    until(lambda: blue(shot(window)) < 0.01 and read_shot(shot(window)).spec.edits.meshes[0].visible, "the mesh shown again")
    window.keys("ctrl+y")
    until(lambda: not read_shot(shot(window)).spec.edits.meshes[0].visible, "the comparison again")
    window.keys("ctrl+q")
    assert window.ended() == 0
    window = opened_again(display, tmp_path, project)
    until(lambda: blue(shot(window)) > 0.02, "the distances, which the project has")
    window.keys("ctrl+q")
    assert window.ended() == 0


def shares(picture) -> tuple[float, float]:
    """Share of red pixels left, and of blue ones right, of the handle of a saved picture, among those that are coloured."""
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)[60:-120]
    spec = read_shot(picture).spec
    column = round(spec.split_at * pixels.shape[1])
    found = []
    for side, (high, low) in ((pixels[:, :column], (0, 2)), (pixels[:, column:], (2, 0))):
        coloured = np.ptp(side, axis=2) > 60
        assert coloured.any()
        found.append(float((side[..., high] > side[..., low])[coloured].mean()))
    return found[0], found[1]


def test_a_handle_between_two_dates_is_dragged_and_its_picture_drawn_again(display, tmp_path, seed):
    scans = dates_in_colour(tmp_path, seed)
    window = RealWindow(display, tmp_path, "view", *scans, "--view", "filled")
    window.wait_for_title("·")
    until(lambda: [*(tmp_path / "cache").glob("[!.]*/meta.json")], "all points")
    window.rest()
    window.click(*TOOL)
    window.rest()
    window.click(*BESIDE)
    window.rest()
    first = shot(window)
    assert read_shot(first).spec.other_edits is not None and min(shares(first)) > 0.99, "each date alone at its side"
    x, y = GRIP
    window.xdo("mousemove", "--sync", "--window", window.window, x, y)
    window.xdo("mousedown", 1)
    for step in (40, 90, 150):
        window.xdo("mousemove", "--sync", "--window", window.window, x + step, y)
        window.rest()
    window.xdo("mouseup", 1)
    window.rest()
    window.keys("2")
    window.rest()
    picture = shot(window)
    spec = read_shot(picture).spec
    assert spec.views == ("filled", "filtered") and spec.split_at == pytest.approx(0.5 + 150 / spec.camera.width, abs=0.01)
    assert min(shares(picture)) > 0.99
    assert drawn_again(window, scans, picture)
    window.keys("v")
    window.rest()
    assert read_shot(shot(window)).spec.other_edits is None, "all points in the whole picture"
    window.keys("ctrl+q")
    assert window.ended() == 0
