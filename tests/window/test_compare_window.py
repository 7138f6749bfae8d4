"""Two dates in a real window, by X key and pointer events: compared, and coloured in a saved picture."""

import time

import numpy as np
import pytest
from PIL import Image
from real_window import RealWindow, until, x_display
from test_orthographic_window import shot

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
TOOL, START = (214, 350), (1107, 280)
"""The icon of the tool, and its button, in a window of 1280 x 720."""


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


def colours(window) -> np.ndarray:
    """(n, 3) of the pixels of the middle of a saved picture that are not background."""
    with Image.open(shot(window)) as image:
        pixels = np.asarray(image.convert("RGB"))[60:-160, 60:-200].reshape(-1, 3).astype(int)
    return pixels[pixels.sum(axis=1) > 150]


def test_two_dates_are_compared_by_clicks_and_the_change_is_red(display, tmp_path, seed):
    scans = [tmp_path / "before.xyz", tmp_path / "after.xyz"]
    for number, (path, raised) in enumerate(zip(scans, (0.0, 0.03), strict=True)):
        np.savetxt(path, room(seed + number, raised), fmt="%.4f")
    window = RealWindow(display, tmp_path, "view", *scans, "--view", "filled")
    window.wait_for_title("·")
    until(lambda: [*(tmp_path / "cache").glob("[!.]*/meta.json")], "all points")
    time.sleep(4.0)
    window.keys("x")
    time.sleep(1.0)
    grey = colours(window)
    assert (np.ptp(grey, axis=1) < 12).mean() > 0.95
    window.click(*TOOL)
    time.sleep(1.0)
    window.click(*START)

    def red() -> float:
        found = colours(window)
        return float((found[:, 0] > found[:, 2] + 40).mean())

    until(lambda: red() > 0.02, "the change")
    made = colours(window)
    assert (made[:, 2] > made[:, 0] + 40).mean() < 0.01, "nothing sank"
    window.keys("ctrl+q")
    assert window.ended() == 0, "a comparison is no work to be saved"
