"""The hole test from the picture alone, on shapes with a known answer; the shader is compared with this implementation."""

import itertools

import numpy as np
import pytest
import torch

from pointglass.model.reference.hole_test import (
    DIRECTIONS,
    KERNEL,
    KERNEL_SUM,
    far_inside,
    fine_levels,
    opaque_pixels,
    strides,
    window_reach,
)


def disc(side: int, radius: float, x: float | None = None, y: float | None = None) -> torch.Tensor:
    rows, columns = torch.meshgrid(torch.arange(side) + 0.5, torch.arange(side) + 0.5, indexing="ij")
    return (columns - (x or side / 2)) ** 2 + (rows - (y or side / 2)) ** 2 < radius**2


def test_holes_are_filled_and_the_sky_is_not():
    mask = torch.zeros(256, 256, dtype=torch.bool)
    mask[100:, :] = True
    mask[150:170, 100:120] = False  # a hole in the ground
    inside = opaque_pixels(mask)
    assert inside[150:170, 100:120].all()
    assert not inside[:98].any(), "not a pixel above the horizon, but for small gaps beside it"


@pytest.mark.parametrize("side", [256, 512, 1024])
def test_sparse_points_of_one_surface_are_opaque_up_to_the_border(side):
    """With a spacing of a quarter of the reach, in pictures of any size; there is no open margin either."""
    reach = side // 16
    generator = torch.Generator().manual_seed(side)
    sparse = torch.rand(side, side, generator=generator) < (4 / reach) ** 2
    inside = opaque_pixels(sparse)
    assert inside.float().mean() > 0.99 and inside[reach:-reach, reach:-reach].float().mean() > 0.998


def test_the_inside_of_a_ring_is_a_hole_up_to_the_reach_and_background_beyond():
    side = 512
    reach = side // 16
    for radius, closed in ((reach // 2, True), (3 * reach, False)):
        ring = disc(side, radius + 12) & ~disc(side, radius)
        middle = opaque_pixels(ring)[side // 2 - 2 : side // 2 + 2, side // 2 - 2 : side // 2 + 2]
        assert middle.all() if closed else not middle.any(), radius


def test_the_opening_between_two_pipes_is_background():
    mask = torch.zeros(512, 512, dtype=torch.bool)
    mask[:, 240:248] = mask[:, 280:288] = True
    assert not opaque_pixels(mask)[40:-40, 252:276].any()
    mask[200:210, 240:288] = True  # a bar across does not change that
    assert not opaque_pixels(mask)[240:-40, 252:276].any()


def test_single_points_are_not_a_surface():
    points = torch.zeros(512, 512, dtype=torch.bool)
    points[100, 100] = points[110, 130] = points[300, 310] = True
    assert opaque_pixels(points).sum() < 20


def test_outlines_do_not_depend_on_the_grid_of_cells():
    """A round notch in a disc gives the same result at any offset to the grid, except for a pixel at its border."""
    shares = []
    for shift in range(0, 64, 7):
        mask = disc(640, 200, 320 + shift, 320 + shift) & ~disc(640, 90, 500 + shift, 320 + shift)
        filled = opaque_pixels(mask) & ~mask
        shares.append(int(filled.sum()))
        edges = torch.cat([(filled[1:] != filled[:-1]).sum(1), (filled[:, 1:] != filled[:, :-1]).sum(0)])
        assert edges.max() < 45, "a straight border along a row or column, 64 pixels long, say"
    assert max(shares) - min(shares) < 0.05 * max(max(shares), 2000)


def test_rotated_and_mirrored_pictures_give_rotated_and_mirrored_results(seed):
    """For sides that are multiples of 4, where cells coincide with cells."""
    rng = np.random.default_rng(seed)
    mask = torch.from_numpy(rng.random((384, 384)) < 0.002) | disc(384, 80, 150, 220)
    inside = opaque_pixels(mask)
    for turns in range(4):
        assert torch.equal(opaque_pixels(mask.rot90(turns)), inside.rot90(turns))
    assert torch.equal(opaque_pixels(mask.flip(0)), inside.flip(0))


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (4, 4), (63, 64), (127, 9), (128, 1), (131, 257), (1080, 1920)])
def test_any_size(size, seed):
    height, width = size
    mask = torch.from_numpy(np.random.default_rng(seed).random(size) < 0.05)
    inside = opaque_pixels(mask)
    assert inside.shape == size and (inside | ~mask).all()
    assert not opaque_pixels(torch.zeros_like(mask)).any() and opaque_pixels(torch.ones_like(mask)).all()
    assert 1 <= fine_levels(width, height) <= 2 and (strides(width, height) != []) == (max(size) >= 128)


def test_far_inside_excludes_pixels_near_background():
    """It contains the middle of a disc and of a filled hole, and only opaque pixels."""
    mask = disc(512, 150)
    deep = far_inside(mask)
    assert deep[disc(512, 100)].all() and not deep[~disc(512, 145)].any()
    pierced = mask & ~disc(512, 12)
    assert torch.equal(far_inside(pierced), deep)
    assert (opaque_pixels(pierced) | ~far_inside(pierced)).all()


def test_adjacent_windows_leave_no_gap():
    assert len(set(DIRECTIONS)) == 16 and sum(KERNEL) ** 2 == KERNEL_SUM
    for side in range(128, 8192, 64):
        steps = strides(side, side // 2)
        assert steps[0] == 1 and abs(8 * steps[-1] - side / 16) < 8, "from the nearest cells to the reach"
        assert all(2 * window_reach(stride) + 1 >= stride for stride in steps), "as wide as the step from one to the next"
        passes = [window_reach(b) - window_reach(a) > 2 * window_reach(a) + 1 for a, b in itertools.pairwise(steps)]
        assert sum(passes) <= 1 and not any(passes[1:]), "wider windows are made of narrower ones in one pass, the first in two"


@pytest.mark.parametrize("shape, alike", [("notch", 0.04), ("sparse", 0.2)])
def test_the_result_does_not_depend_on_resolution(shape, alike):
    """One view in pictures of 640 to 1280 pixels, with points and gaps in proportion, up to the largest spacing that closes."""
    shares = []
    for side in (640, 768, 960, 1100, 1280):
        if shape == "notch":
            mask = disc(side, 0.3 * side) & ~disc(side, 0.07 * side, 0.7 * side)
        else:
            mask = torch.zeros(side, side, dtype=torch.bool)
            places = torch.rand(700, 2, generator=torch.Generator().manual_seed(5)) * 0.6 + 0.2
            mask[(places[:, 0] * side).long(), (places[:, 1] * side).long()] = True
        shares.append(float(opaque_pixels(mask).float().mean()))
    assert max(shares) - min(shares) < alike * max(shares), shares
