"""What is laid behind a picture, against exact fractions, pixel by pixel."""

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from PIL import Image
from test_export import CAMERAS, FakeRenderer

from pointglass.viewer.command_table import make_parser
from pointglass.viewer.commands.render_pictures import export_pictures
from pointglass.viewer.picture.background import COLOURS, as_saved, composite, rows, straight
from pointglass.viewer.picture.settings import BACKGROUNDS, Settings
from pointglass.viewer.picture.spec import PictureSpec

HALF = Fraction(1, 2)


def picture(seed: int, size=(13, 17)) -> np.ndarray:
    """Premultiplied, no colour above its alpha, with every kind of alpha."""
    rng = np.random.default_rng(seed)
    alpha = rng.choice(np.array([0, 1, 127, 254, 255, *rng.integers(0, 256, 5)]), (*size, 1))
    return np.concatenate([rng.integers(0, alpha + 1, (*size, 3)), alpha], axis=2).astype(np.uint8)


def test_every_background_has_colours_but_the_one_that_has_none():
    assert set(COLOURS) | {"transparent"} == set(BACKGROUNDS)


@pytest.mark.parametrize("height", [1, 2, 7, 720])
@pytest.mark.parametrize("background", COLOURS)
def test_rows_go_from_the_top_colour_to_the_bottom_colour(background, height):
    top, bottom = COLOURS[background]
    found = rows(background, height)
    assert found.shape == (height, 1, 3) and found.dtype == np.uint8
    for row in range(height):
        place = (row + HALF) / height
        exact = [(1 - place) * a + place * b for a, b in zip(top, bottom, strict=True)]
        assert found[row, 0].tolist() == [floor(value + HALF) for value in exact]


@pytest.mark.parametrize("background", COLOURS)
def test_what_is_not_covered_shows_the_background(background, seed):
    image = picture(seed)
    found, behind = composite(image, background), rows(background, len(image))
    assert found.shape == (*image.shape[:2], 3)
    for y, x in np.ndindex(image.shape[:2]):
        *rgb, alpha = image[y, x].tolist()
        exact = [c + Fraction(b * (255 - alpha), 255) for c, b in zip(rgb, behind[y, 0].tolist(), strict=True)]
        assert all(abs(value - e) <= HALF for value, e in zip(found[y, x].tolist(), exact, strict=True))


def test_black_leaves_the_colours_as_they_are(seed):
    image = picture(seed)
    assert np.array_equal(as_saved(image, "black"), image[..., :3])


def test_transparent_colours_are_those_before_alpha_multiplied_them(seed):
    image = picture(seed)
    found = as_saved(image, "transparent")
    assert np.array_equal(found, straight(image)) and np.array_equal(found[..., 3], image[..., 3])
    again = (found[..., :3].astype(int) * found[..., 3:] * 2 + 255) // 510  # premultiplied again, to the nearest
    assert np.array_equal(again, image[..., :3])
    for y, x in np.ndindex(image.shape[:2]):
        *rgb, alpha = image[y, x].tolist()
        exact = [Fraction(255 * c, alpha) if alpha else Fraction(0) for c in rgb]
        assert all(abs(value - e) <= HALF for value, e in zip(found[y, x, :3].tolist(), exact, strict=True))


@pytest.mark.parametrize("background", BACKGROUNDS)
def test_a_picture_is_saved_over_the_background_asked_for(tmp_path, background, seed):
    image = picture(seed)

    class Renderer(FakeRenderer):
        def render(self, camera, settings, views=None, *_, **__):
            frame = super().render(camera, settings, views)
            frame.image = lambda view: image
            return frame

    options = make_parser().parse_args(["render", "s.laz", "--cameras", "c.json", "--out", "o", "--background", background])
    made: object = Renderer()
    spec = PictureSpec(CAMERAS[0], Settings(view="filled"), background=options.background)
    export_pictures(made, [spec], tmp_path)  # pyright: ignore
    saved = Image.open(tmp_path / "a.png")
    assert saved.mode == ("RGBA" if background == "transparent" else "RGB")
    assert np.array_equal(np.asarray(saved), as_saved(image, background))


def test_nothing_asked_for_is_saved_as_it_always_was(tmp_path):
    options = make_parser().parse_args(["render", "s.laz", "--cameras", "c.json", "--out", "o"])
    assert options.background == "black"
