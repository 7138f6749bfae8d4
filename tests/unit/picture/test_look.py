"""The look's tables and NumPy references against slow, plain definitions."""

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.colour_modes import CLASSES, category_colours, levels, ramp_colours
from pointglass.viewer.picture.look import Look, disc, enlarged, eye_dome, tone_curves, toned


def test_nothing_set_changes_nothing(seed):
    curves = tone_curves(Look())
    assert (curves == np.arange(256)[:, None]).all()
    alpha = np.random.default_rng(seed).integers(0, 256, (20, 20, 1))
    image = (np.random.default_rng(seed + 1).random((20, 20, 3)) * alpha).astype(np.uint8)
    image = np.concatenate([image, alpha.astype(np.uint8)], axis=-1)
    whole = image[..., 3] == 255
    assert (toned(image, curves)[whole] == image[whole]).all()
    assert np.abs(toned(image, curves).astype(int) - image).max() <= 1


def test_a_stop_doubles_the_light_of_dark_levels():
    def light(level):
        return ((level / 255 + 0.055) / 1.055) ** 2.4

    curves = tone_curves(Look(exposure=1.0))
    for level in (30, 60, 120):
        assert light(curves[level, 1]) == pytest.approx(2 * light(level), rel=0.03)
    assert (curves[-1] == 255).all()


def test_brightness_keeps_black_and_white():
    for brightness in (-1.0, 0.7):
        curves = tone_curves(Look(brightness=brightness))
        assert (curves[0] == 0).all() and (curves[-1] == 255).all()
        assert (curves[100] > 100).all() == (brightness > 0)


def test_white_balance_keeps_the_luminance_of_grey():
    for look in (Look(temperature=1.0), Look(tint=-1.0), Look(temperature=-0.6, tint=0.4)):
        curves = tone_curves(look)
        light = np.array([((c / 255 + 0.055) / 1.055) ** 2.4 for c in curves[80].astype(float)])
        assert light @ (0.2126, 0.7152, 0.0722) == pytest.approx(((80 / 255 + 0.055) / 1.055) ** 2.4, rel=0.03)
    warm = tone_curves(Look(temperature=1.0))
    assert warm[80, 0] > 80 > warm[80, 2]


def test_levels_are_the_nearest_of_256(seed):
    random = np.random.default_rng(seed)
    values = random.uniform(-2, 3, 1000)
    found = levels(values, -1.0, 2.0)
    centres = -1.0 + np.arange(256) / 255 * 3.0
    nearest = np.abs(values[:, None] - centres).argmin(axis=1)
    assert (np.abs(found - nearest) <= 1).all() and (found == nearest).mean() > 0.99
    assert levels(np.array([1.0, 1.5]), 1.0, 1.0).tolist() == [0, 255]


def test_ramps_pass_through_their_ends_and_classes_have_their_colour():
    assert ramp_colours("grey").tolist() == [[i] * 3 for i in range(256)]
    assert ramp_colours("viridis")[[0, -1]].tolist() == [[68, 1, 84], [253, 231, 37]]
    assert all(tuple(category_colours("class")[code]) == colour for code, (_, colour) in CLASSES.items())


def test_enlarged_points_are_discs_with_the_nearest_in_front(seed):
    random = np.random.default_rng(seed)
    for size in (1, 2, 3, 5, 8):
        depth = np.where(random.random((17, 23)) < 0.2, random.uniform(1, 9, (17, 23)), np.inf).astype(np.float32)
        image = np.where(np.isfinite(depth)[..., None], random.integers(1, 256, (17, 23, 4)), 0).astype(np.uint8)
        out, nearest = enlarged(image, depth, size)
        for y in range(17):
            for x in range(23):
                held = [(depth[y - dy, x - dx], y - dy, x - dx) for dx, dy in disc(size)
                        if 0 <= y - dy < 17 and 0 <= x - dx < 23]  # fmt: skip
                z, j, i = min(held, key=lambda at: at[0])
                assert nearest[y, x] == z and (out[y, x] == image[j, i]).all()


def test_discs_grow_with_their_size():
    assert [len(disc(size)) for size in (1, 2, 3)] == [1, 4, 9]
    for size in range(1, 16):
        assert abs(len(disc(size)) - np.pi * size**2 / 4) < 0.35 * size**2 + 1


def test_eye_dome_darkens_what_lies_behind_an_edge():
    depth = np.full((9, 9), 4.0, np.float32)
    depth[:, :4] = 2.0
    depth[0] = np.inf
    shade = eye_dome(depth, 0.01)
    assert (shade[2:-1, 4] < 0.9).all()
    assert (shade[2:, 5:] == 1.0).all() and (shade[:, :4] == 1.0).all() and (shade[0] == 1.0).all()
    assert shade[4, 4] == pytest.approx(np.exp(-300 * 0.01 * 3 / 8))


@pytest.mark.parametrize("values", [{"colour_by": "mood"}, {"exposure": 9.0}, {"point_size": 0}, {"edl": float("nan")},
                                    {"low": float("inf")}, {"tint": 2.0}])
def test_bad_values_are_refused(values):
    with pytest.raises(InputError, match=str(next(iter(values.values())))):
        Look(**values)
