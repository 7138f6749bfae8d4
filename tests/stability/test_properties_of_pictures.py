"""Properties of the image pyramid, the fill, the depth filter's units and reprojection, on random input."""

import numpy as np
import torch
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from test_properties_of_cameras import random_rotation

from pointglass.model.data.dataset import MemoryPicture
from pointglass.model.evaluation.metrics.flicker import reprojection
from pointglass.model.reference.depth_filter import LEVELS, keep_mask
from pointglass.model.reference.hole_test import opaque_pixels
from pointglass.model.reference.projection import depth_feature
from pointglass.model.reference.pull_push import pull_push
from pointglass.model.reference.pyramid import RING, bilinear, clamped, half, parents, quads, shifted

seeds = st.integers(0, 2**32 - 1)
sides = st.integers(1, 40)


def picture(seed: int, height: int, width: int, channels: int = 1) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).random((channels, height, width)))


@given(seeds, sides, sides)
@settings(deadline=None)
def test_quads_hold_every_pixel_once_and_parents_lead_back(seed, height, width):
    image = picture(seed, height, width)
    children = quads(image, -1.0)
    assert all(c.shape[-2:] == (half(height), half(width)) for c in children)
    top_row, bottom_row = (torch.stack(pair, -1).flatten(-2) for pair in (children[:2], children[2:]))
    back = torch.stack([top_row, bottom_row], -2).flatten(-3, -2)
    assert torch.equal(back[..., :height, :width], image)
    assert (back[..., height:, :] == -1).all() and (back[..., width:] == -1).all()
    top = torch.stack(children).amax(0)
    assert (parents(top, height, width) >= image).all()
    rows, columns = torch.arange(height) // 2, torch.arange(width) // 2
    assert torch.equal(parents(top, height, width), top[..., rows[:, None], columns[None, :]])


@given(seeds, sides, sides)
@settings(deadline=None)
def test_neighbours_are_the_pixels_beside(seed, height, width):
    image = picture(seed, height, width)[0]
    padded = np.pad(image.numpy(), 1, constant_values=-1)
    edge = np.pad(image.numpy(), 1, mode="edge")
    for dx, dy in RING:
        inner = slice(1 + dy, 1 + dy + height), slice(1 + dx, 1 + dx + width)
        assert np.array_equal(shifted(image, dx, dy, -1.0).numpy(), padded[inner])
        assert np.array_equal(clamped(image, dx, dy).numpy(), edge[inner])


@given(seeds, st.integers(1, 60), st.integers(1, 60))
@settings(deadline=None)
def test_bilinear_is_that_of_the_textbook(seed, height, width):
    """Against the formula at every pixel, and exact on what is affine, away from the border."""
    coarse = picture(seed, half(height), half(width))[0]
    made = bilinear(coarse, height, width).numpy()
    low = coarse.numpy()
    j, i = np.mgrid[0:height, 0:width]
    y, x = (j + 0.5) / 2 - 0.5, (i + 0.5) / 2 - 0.5
    y0, x0 = np.floor(y).astype(int), np.floor(x).astype(int)
    fy, fx = y - y0, x - x0
    rows, columns = (np.clip([a, a + 1], 0, side - 1) for a, side in ((y0, low.shape[0]), (x0, low.shape[1])))
    above, below = (low[r, columns[0]] * (1 - fx) + low[r, columns[1]] * fx for r in rows)
    expected = above * (1 - fy) + below * fy
    assert np.allclose(made, expected, atol=1e-14)
    assert made.min() >= low.min() - 1e-14 and made.max() <= low.max() + 1e-14


@given(seeds, st.integers(1, 70), st.integers(1, 70), st.floats(0, 1))
@settings(deadline=None, max_examples=examples(20))
def test_filling_keeps_what_is_measured_and_adds_no_new_value(seed, height, width, share):
    rng = np.random.default_rng(seed)
    mask = torch.from_numpy(rng.random((height, width)) < share)
    image = picture(seed, height, width, 5)
    for dtype in (torch.float32, torch.float64):
        given = image.to(dtype)
        made = pull_push(given, mask)
        assert made.isfinite().all() and torch.equal(made[:, mask], given[:, mask])
        if mask.any():
            slack = 1e-5 if dtype == torch.float32 else 1e-12
            low, high = given[:, mask].amin(1), given[:, mask].amax(1)
            assert (made >= low[:, None, None] - slack).all() and (made <= high[:, None, None] + slack).all()
        else:
            assert not made.any()
    assert opaque_pixels(mask)[mask].all()


@given(seeds, st.integers(1, 60), st.integers(1, 60))
@settings(deadline=None, max_examples=examples(20))
def test_filling_a_mirrored_picture_mirrors_the_filling(seed, height, width):
    """Where the sides are powers of two, or the pyramid's blocks do not mirror."""
    height, width = 1 << height.bit_length(), 1 << width.bit_length()
    mask = torch.from_numpy(np.random.default_rng(seed).random((height, width)) < 0.2)
    image = picture(seed, height, width, 4)
    assert torch.allclose(pull_push(image.flip(-1), mask.flip(-1)), pull_push(image, mask).flip(-1), atol=1e-12)
    assert torch.equal(opaque_pixels(mask.flip(0)), opaque_pixels(mask).flip(0))


@given(seeds, st.integers(2, 70), st.integers(2, 70), st.integers(-60, 60))
@settings(deadline=None, max_examples=examples(20))
def test_the_filters_own_preset_knows_no_unit(seed, height, width, power):
    """Scaled by a power of two the mask is the same to the bit, by anything else but for ties."""
    rng = np.random.default_rng(seed)
    depth = torch.from_numpy(np.where(rng.random((height, width)) < 0.4, rng.choice([2.0, 5.0, 9.0], (height, width))
                                      * rng.uniform(1, 1.02, (height, width)), np.inf).astype(np.float32))
    mask = keep_mask(depth)
    assert torch.equal(keep_mask(depth * 2.0**power), mask)
    assert not mask[~torch.isfinite(depth)].any()
    assert torch.equal(keep_mask(depth, "off"), torch.isfinite(depth))


@given(seeds, sides, sides, st.sampled_from(list(LEVELS)))
@settings(deadline=None, max_examples=examples(20))
def test_every_preset_keeps_the_nearest_point_of_all(seed, height, width, preset):
    rng = np.random.default_rng(seed)
    depth = torch.from_numpy(np.where(rng.random((height, width)) < 0.5, 10.0 ** rng.uniform(-2, 4, (height, width)), np.inf))
    mask = keep_mask(depth, preset)
    assert not mask[~torch.isfinite(depth)].any()
    if torch.isfinite(depth).any():
        assert mask.view(-1)[depth.view(-1).argmin()]


@given(st.floats(-6, 8), st.floats(0, 5), st.floats(-8, 6), st.floats(-6, 6))
@settings(deadline=None)
def test_the_depth_feature_is_bounded_and_knows_no_unit(depth, focal, spacing, scale):
    z, f, s = (torch.tensor(10.0**v, dtype=torch.float64) for v in (depth, focal, spacing))
    one = depth_feature(z[None], float(f), float(s))
    other = depth_feature(z[None] * 10.0**scale, float(f), float(s) * 10.0**scale)
    assert one.abs() <= 2 and torch.allclose(one, other, atol=1e-9)


# Reprojection


def wall_seen(rng, *, away: float = 0.0, scale: float = 1.0, turn: float = 0.15):
    """Two cameras beside each other before one wall: (before, after, rotation and position of both)."""
    normal = np.array([*rng.uniform(-0.3, 0.3, 2), 1.0])
    world = random_rotation(rng)
    origin = rng.normal(size=3) * away
    made = []
    for number in range(2):
        angles = rng.uniform(-turn, turn, 3) * number
        skew = np.array([[0, -angles[2], angles[1]], [angles[2], 0, -angles[0]], [-angles[1], angles[0], 0]])
        local = np.linalg.qr(np.eye(3) + skew)[0]
        local = local * np.sign(np.diag(local))
        place = rng.uniform(-0.3, 0.3, 3) * number
        height, width, fl = (int(rng.integers(20, 40)), int(rng.integers(20, 40)), float(rng.uniform(25, 60)))
        j, i = np.mgrid[0:height, 0:width] + 0.5
        ray = np.stack([(i - width / 2) / fl, -(j - height / 2) / fl, -np.ones_like(i)], -1) @ local.T
        reach = (-5.0 - place @ normal) / (ray @ normal)  # the wall: normal . p = -5
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = world @ local, (world @ place) * scale + origin
        z = (reach * scale).astype(np.float32)
        made.append(MemoryPicture(np.zeros((height, width, 3), np.uint8), fl, pose, z))
    return made


@given(seeds, st.sampled_from([0.0, 1e3, 1e6]), st.sampled_from([1e-3, 1.0, 1e3]))
@settings(deadline=None, max_examples=examples(20))
def test_reprojection_finds_the_same_point_of_the_wall(seed, away, scale):
    """By another way: through the world point's homogeneous coordinates and the inverse of the other pose."""
    before, after = wall_seen(np.random.default_rng(seed), away=away * scale, scale=scale)
    back = reprojection(before, after)
    j, i = np.mgrid[0 : before.height, 0 : before.width] + 0.5
    z = before.z.astype(np.float64)
    local = np.stack([(i - before.cx) / before.fl * z, -(j - before.cy) / before.fl * z, -z, np.ones_like(z)], -1)
    there = local @ (np.linalg.inv(after.camera_to_world) @ before.camera_to_world).T
    u, v = after.cx + after.fl * there[..., 0] / -there[..., 2], after.cy - after.fl * there[..., 1] / -there[..., 2]
    inside = (u > 0.51) & (v > 0.51) & (u < after.width - 0.51) & (v < after.height - 0.51)
    assert back.valid.numpy()[inside].all()  # both see the wall, so wherever it is in the picture it agrees
    grid = (back.grid.numpy() + 1) / 2 * (after.width, after.height)
    assert np.abs(grid - np.stack([u, v], -1))[back.valid.numpy()].max(initial=0) < 1e-3


@given(seeds)
@settings(deadline=None, max_examples=examples(20))
def test_reprojection_onto_itself_is_the_same_picture(seed):
    rng = np.random.default_rng(seed)
    before, _ = wall_seen(rng)
    back = reprojection(before, before)
    colours = torch.from_numpy(rng.random((3, before.height, before.width))).float()
    assert back.valid.all() and torch.allclose(back.warp(colours), colours, atol=1e-4)
    assert back.change(colours, colours) < 1e-4


@given(seeds)
@settings(deadline=None, max_examples=examples(20))
def test_reprojection_without_depth_compares_nothing(seed):
    rng = np.random.default_rng(seed)
    before, after = wall_seen(rng)
    assert before.z is not None
    holes = rng.random(before.z.shape) < 0.4
    before.z[holes] = np.inf
    assert not reprojection(before, after).valid.numpy()[holes].any()
