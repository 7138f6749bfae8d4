"""The reference implementation in torch against plain loops: soft z-buffer, fill and network input."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from untyped import any_typed

from pointglass.model.common.linear_light import LEVELS, TO_LINEAR, TO_SRGB
from pointglass.model.reference.fill_constants import FOR_NETWORK, FOR_PICTURE
from pointglass.model.reference.projection import (
    NOISE_SCALE,
    SoftZ,
    depth_feature,
    frame,
    network_input,
    pixels,
    rasterise,
    unpack_points,
)
from pointglass.model.reference.pull_push import FIRST_LEVEL, averaging_weight, background, pull_push

CAMERA = SimpleNamespace(width=9, height=7, fx=5.0, fy=5.5, cx=4.5, cy=3.5)


@given(st.integers(0, 2**32 - 1), st.sampled_from([(0.02, 0.1), (0.0, 0.125), (0.0, 0.0), (0.02, 0.0)]),
       st.booleans(), st.booleans(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_rasteriser_equals_a_plain_loop(seed, tolerance, rounded, linear, unlit):
    """Depths are quantised, so that some lie exactly at the tolerance; colours include black and nearly black."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 2, (300, 3))
    points[:, 2] = np.round(8 * points[:, 2]) / 8
    rgb = rng.integers(0, 256, (300, 3))
    rgb[::6], rgb[1::6, :2] = 0, 0
    soft = SoftZ(tolerance[0], tolerance[1], rounded, linear, unlit)
    x, y, z = torch.from_numpy(points).unbind(1)
    index, inside = pixels(x, y, z, CAMERA, rounded=rounded)
    raster = rasterise(index, z[inside], torch.from_numpy(rgb)[inside], CAMERA.width, CAMERA.height, soft)
    cells: dict = {}
    for (px, py, pz), colour in zip(points, rgb, strict=True):
        if pz <= 0:
            continue
        u, v = CAMERA.fx * (px * (1 / pz)) + CAMERA.cx, CAMERA.fy * (py * (1 / pz)) + CAMERA.cy
        u, v = (u + 0.5, v + 0.5) if rounded else (u, v)
        if 0 <= u < CAMERA.width and 0 <= v < CAMERA.height:
            cells.setdefault((int(v), int(u)), []).append((pz, colour))
    for j in range(CAMERA.height):
        for i in range(CAMERA.width):
            held = cells.get((j, i))
            if not held:
                assert torch.isinf(raster.depth[j, i]) and raster.count[j, i] == 0
                continue
            nearest = min(d for d, _ in held)
            far = max(nearest * (1 + tolerance[0]), nearest + tolerance[1])
            chosen = [c for d, c in held if d <= far and not (unlit and not c.any())]
            assert raster.depth[j, i] == nearest and raster.count[j, i] == len(chosen)
            sums = np.sum([TO_LINEAR[c] if linear else c for c in chosen or [np.zeros(3, int)]], axis=0)
            mean = (2 * sums + len(chosen)) // (2 * max(len(chosen), 1))  # rounded half up
            assert raster.colour[:, j, i].tolist() == (TO_SRGB[mean] if linear else mean).tolist()


def test_sums_of_many_points_in_a_pixel_are_exact():
    """In float32 the sum would be wrong beyond some ten thousand points."""
    count = 300_000
    raster = rasterise(torch.zeros(count, dtype=torch.int64), torch.ones(count), torch.full((count, 3), 255), 1, 1, SoftZ(0, 0))
    assert raster.colour.flatten().tolist() == [255] * 3 and raster.count.item() == count


def test_linear_light_is_rounded_to_the_nearest_srgb_level():
    for light in range(LEVELS):
        apart = np.abs(TO_LINEAR - light)
        assert TO_SRGB[light] == np.flatnonzero(apart == apart.min())[-1]


def test_float64_points_use_a_float64_lens():
    """A long lens with a distant principal point: in float32 the point would be one column off."""
    camera = SimpleNamespace(width=9, height=7, fx=2.0**24 + 1, fy=2.0**24 + 3, cx=4.5 - 2.0**24, cy=3.5 - 2.0**24)
    one = torch.ones(1, dtype=torch.float64)
    index, inside = pixels(one, one, one, camera)
    assert inside.all() and index.tolist() == [6 * 9 + 5]


def test_unpack_reads_every_field():
    words = torch.tensor([[0x0002_0001, 0xABCD_0003, 0x07_30_20_10]])
    steps, rgb, _ = unpack_points(words)
    assert steps.tolist() == [[1, 2, 3]] and rgb.tolist() == [[0x10, 0x20, 0x30]]


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (17, 12), (64, 64)])
def test_fill_keeps_measured_pixels_and_stays_within_their_range(shape):
    rng = np.random.default_rng(4)
    image = torch.from_numpy(rng.random((3, *shape)))
    mask = torch.from_numpy(rng.random(shape) < 0.2)
    mask.view(-1)[0] = True
    filled = pull_push(image, mask)
    assert torch.equal(filled[:, mask], image[:, mask])
    low, high = image[:, mask].amin(1), image[:, mask].amax(1)
    assert (filled >= low[:, None, None] - 1e-12).all() and (filled <= high[:, None, None] + 1e-12).all()


def test_fill_of_a_constant_is_constant_and_of_nothing_is_zero():
    mask = torch.from_numpy(np.random.default_rng(0).random((30, 41)) < 0.05)
    assert torch.allclose(pull_push(torch.full((3, 30, 41), 0.4, dtype=torch.float64), mask), torch.tensor(0.4).double())
    assert not pull_push(torch.ones(3, 30, 41), torch.zeros(30, 41, dtype=torch.bool)).any()


def pillar(spacing: int) -> tuple[torch.Tensor, torch.Tensor]:
    """A pillar, columns 72 to 88 at depth 2, in front of a wall at depth 4 with a shadow of 32 columns on each side.

    Returns the image (5, H, W), of a grey for each surface, depth feature and that grey again, and the mask.  spacing: of the
    points, pixels at the pillar."""
    at = torch.arange(160)
    front = (at >= 72) & (at < 88)
    shadow = (at >= 40) & (at < 120) & ~front
    rows = torch.arange(64)
    depth, grey = torch.where(front, 2.0, 4.0), torch.where(front, 0.2, 0.8)
    step = torch.where(front, spacing, max(1, spacing // 2))
    mask = (at % step == 0) & (rows[:, None] % step == 0) & ~shadow
    row = torch.stack([grey, grey, grey, depth_feature(depth, 2.0 * spacing, 1.0), grey])
    return row[:, None].repeat(1, 64, 1).double(), mask


@pytest.mark.parametrize("spacing", [1, 2, 4])
def test_a_shadow_beside_a_pillar_is_filled_from_the_wall_behind_it(spacing):
    """Except a few point spacings along the pillar.  A fill without depth smears the pillar half the way.  Gaps of the pillar,
    no wider than its points, stay its own."""
    image, mask = pillar(spacing)
    made, plain = pull_push(image, mask), pull_push(image[:3], mask)
    shadow = slice(42, 72 - 4 * spacing)
    assert (made[0, :, shadow] - 0.8).abs().mean() < 0.3 * (plain[0, :, shadow] - 0.8).abs().mean()
    assert (made[0, :, 80 - 2 : 80 + 2] - 0.2).abs().max() < 0.02


def test_fill_depends_on_depth_alone_and_applies_to_all_channels(seed):
    rng = np.random.default_rng(seed)
    image, mask = pillar(2)
    weight = torch.where(mask, torch.from_numpy(rng.random(mask.shape)), 0.0)
    made = pull_push(image, weight)
    assert torch.equal(made[4], made[0]) and torch.equal(pull_push(image[:4], weight), made[:4])
    other = torch.from_numpy(rng.random(mask.shape))
    assert torch.equal(pull_push(torch.cat([image[:4], other[None]]), weight)[:4], made[:4])


def test_noisy_points_count_less_where_they_are_sparse_but_not_those_nearer_than_the_others():
    kept = torch.zeros(64, 128)
    kept[::6, :64:6], kept[:, 64:] = 1.0, 1.0  # six pixels apart, and everywhere
    feature = torch.zeros(64, 128)
    feature[30, 30] = -0.1  # 24 % nearer
    shown, given = (averaging_weight(kept, torch.full((64, 128), 0.06), feature, by) for by in (FOR_PICTURE, FOR_NETWORK))
    assert torch.equal(shown[:, 80:], kept[:, 80:]) and shown[30, 30] == given[30, 30] == 1.0
    others = kept[:, :48].clone()
    others[30, 30] = 0.0
    assert torch.allclose(shown[:, :48][others > 0], torch.tensor(1 / (1 + 0.06**2 / 0.03**2)))
    assert (given[:, :48][others > 0] < 1).all() and (given >= shown).all()


def test_at_constant_depth_the_fill_is_plain_pull_push(seed):
    rng = np.random.default_rng(seed)
    mask = torch.from_numpy(rng.random((70, 51)) < 0.02)
    image = torch.from_numpy(rng.random((4, 70, 51)))
    image[3] = 1.5
    assert torch.allclose(pull_push(image, mask)[:3], pull_push(image[:3], mask), atol=1e-12)


def test_the_farthest_sample_always_has_weight_1(seed):
    features = torch.from_numpy(np.random.default_rng(seed).uniform(-2, 2, (4, 1000)))
    for level in range(12):
        kept = torch.stack(background(list(features), level))
        assert (kept.gather(0, features.argmax(0)[None]) == 1).all() and (kept >= 0).all() and (kept <= 1).all()
    assert background([torch.tensor(x) for x in (0.0, 0.02, 0.06, 0.06)], FIRST_LEVEL + 4)[0] == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_depth_feature_has_no_unit(scale):
    depth = torch.tensor([[0.5, 2.0], [50.0, torch.inf]]) * scale
    feature = depth_feature(depth, 700.0, 0.01 * scale)
    assert torch.allclose(feature, depth_feature(depth / scale, 700.0, 0.01), atol=1e-5)
    assert feature[1, 1] == 0 and feature.abs().max() <= 2.0


def test_depth_feature_counts_doublings_and_is_bounded():
    depth = 700.0 * 0.01 * 2.0 ** torch.tensor([[-20.0, -8, -4, 0, 1, 8, 8.5, 20]])
    assert depth_feature(depth, 700.0, 0.01)[0].tolist() == pytest.approx([-2, -2, -1, 0, 0.25, 2, 2, 2], abs=1e-6)


def test_soft_z_is_in_the_units_of_the_file():
    assert SoftZ.preset("auto", 0.5, 3.0, unlit=True) == SoftZ(1 / 128, 0.5, linear=True, unlit=True)
    assert SoftZ.preset("paper-code", 0.5, 3.0) == SoftZ(0.0, any_typed(pytest.approx(0.06)), rounded=True)
    assert SoftZ.preset("paper-text", 0.5, 3.0) == SoftZ(0.0, any_typed(pytest.approx(0.06)))


def test_a_pixel_without_a_colour_is_not_in_the_mask():
    index, z, rgb = torch.tensor([0, 1]), torch.ones(2), torch.tensor([[0, 0, 0], [0, 0, 9]])
    for unlit in (True, False):
        raster, mask = frame(index, z, rgb, SimpleNamespace(width=3, height=1), SoftZ(0.01, 0.0, unlit=unlit), preset="off")
        assert mask.tolist() == [[not unlit, True, False]] and torch.isfinite(raster.depth).tolist() == [[True, True, False]]


def test_network_input_has_its_six_channels():
    index = torch.tensor([0, 4])
    raster = rasterise(index, torch.tensor([1.0, 2.0]), torch.tensor([[255, 0, 51], [0, 255, 51]]), 3, 2, SoftZ(0.01, 0.0))
    made = network_input(raster, torch.isfinite(raster.depth), 10.0, 0.1, 0.03)
    assert made.shape == (6, 2, 3) and torch.allclose(made[5], torch.tensor(NOISE_SCALE * 0.03))
    assert made[3].flatten().tolist() == [1, 0, 0, 0, 1, 0]
    assert made[:3, 0, 0].tolist() == pytest.approx([1.0, 0.0, 0.2])
    assert (made[2] - 0.2).abs().max() < 1e-6
