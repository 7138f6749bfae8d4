"""The legend over a saved picture (viewer.work.pictures.picture_legend): its colours, its place, at every size."""

from dataclasses import replace

import numpy as np
import pytest

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.colour_modes import ramp_colours
from pointglass.viewer.work.pictures.picture_legend import Legend, with_legend
from pointglass.viewer.work.pictures.picture_scale_bar import bar_length, with_scale_bar

ROWS = (((225, 90, 70), "6 building"), ((60, 130, 230), "9 water"), ((30, 120, 40), "5 high vegetation"))


def box(before: np.ndarray, after: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row, first and last column that changed."""
    rows, columns = np.nonzero((before != after).any(axis=2))
    return rows.min(), rows.max(), columns.min(), columns.max()


@pytest.mark.slow
@pytest.mark.parametrize("height", [480, 720, 1440, 2880])
@pytest.mark.parametrize("channels", [3, 4])
def test_each_colour_stands_in_a_swatch_of_its_own_from_top_to_bottom(seed, height, channels):
    random = np.random.default_rng(seed)
    picture = random.integers(0, 20, (height, height * 4 // 3, channels), np.uint8)
    kept = picture.copy()
    made = with_legend(picture, Legend("classification", ROWS))
    assert np.array_equal(picture, kept) and made.shape == picture.shape and made.dtype == np.uint8
    places = []
    unit = max(height / 720, 0.75)
    for colour, _ in ROWS:
        seen = np.abs(made[..., :3].astype(int) - colour).max(axis=2) < 6
        assert 0.6 * (13 * unit) ** 2 < seen.sum() < 1.6 * (13 * unit) ** 2 + 40
        places.append(np.nonzero(seen)[0].mean())
    assert np.allclose(np.diff(places), 22 * unit, atol=1.5)
    _, last, first_column, last_column = box(picture, made)
    assert abs(height - last - 14 * unit) < 3 and abs(first_column - 14 * unit) < 3 and last_column < 0.5 * picture.shape[1]
    if channels == 4:
        assert made[int(places[0]), int(20 * unit), 3] > 200


@pytest.mark.parametrize("height", [480, 1440])
def test_a_ramp_runs_from_low_to_high(height):
    picture = np.zeros((height, height * 4 // 3, 3), np.uint8)
    ramp = ramp_colours("viridis")
    made = with_legend(picture, Legend("coordinate along the up axis", ramp=ramp, low="-1.25 m", high="3.5 m"))
    _, _, first_column, last_column = box(picture, made)
    seen = [np.argwhere((made == ramp[level]).all(axis=2)) for level in (0, 255)]
    assert all(len(places) for places in seen)
    assert seen[0][:, 1].mean() < first_column + 0.25 * (last_column - first_column)
    assert seen[1][:, 1].mean() > first_column + 0.75 * (last_column - first_column)
    assert (made.min(axis=2) > 180).sum() > 100, "title and ends are written"


def test_a_text_wider_than_the_picture_is_cut_off():
    made = with_legend(np.zeros((120, 160, 3), np.uint8), Legend("coordinate along the up axis " * 9, ROWS * 9))
    assert made.shape == (120, 160, 3) and made.any()


@pytest.mark.parametrize("metres", [1.0, 0.3048, None])
@pytest.mark.parametrize("height", [300, 720, 2160])
def test_a_scale_bar_is_as_long_as_it_says(seed, height, metres):
    random = np.random.default_rng(seed)
    pose = look_at((0.0, 0.0, 5.0), (1.0, 0.3, 0.0))
    camera = replace(from_fov(height * 16 // 9, height, 60.0, pose), orthographic=float(10 ** random.uniform(-1, 3)))
    black = np.zeros((height, camera.width, 3), np.uint8)
    made = with_scale_bar(black, camera, metres)
    assert np.array_equal(with_scale_bar(black, replace(camera, orthographic=None), metres), black)
    bright = (made > 200).all(axis=2)
    row = int(bright.sum(axis=1).argmax())
    columns = np.flatnonzero(bright[row])
    ends = camera.unproject(np.array([[columns[0] + 0.5, row], [columns[-1] + 0.5, row]]), np.full(2, 3.0))
    length = float(np.linalg.norm(ends[1] - ends[0]))
    stated = bar_length(160 * max(height / 720, 0.75) * camera.orthographic / camera.fx)
    assert abs(length / stated - 1) < (2 + 1.5 * height / 720) / (columns[-1] - columns[0]), "within the width of its ends"
    power = stated / 10 ** np.floor(np.log10(stated) + 1e-9)
    assert min(abs(power - step) for step in (1, 2, 5)) < 1e-9
