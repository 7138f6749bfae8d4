"""The small pictures by which start viewpoints are chosen: the compiled loop against plain Python, and what a score means."""

import numpy as np
import pytest

from pointglass.viewer.work.places.small_picture import picture_sample, score
from pointglass.viewer.work.places.small_picture_kernel import draw_squares
from pointglass.viewer.work.places.standing_place import view_axes


def plain_depth(points, spacing, eye, axes, width, height, focal, levels):
    """(height, width) depth of the nearest square, as draw_squares documents it."""
    depth = np.full((height, width), np.inf)
    for point, apart in zip(points.astype(float), spacing.astype(float), strict=True):
        right, up, back = (point - eye) @ axes
        if -back <= 1e-9:
            continue
        u, v = right / -back * focal + width / 2, height / 2 - up / -back * focal
        if not (0 <= u < width and 0 <= v < height):
            continue
        level = next((k for k in range(levels) if 1 << k >= apart / -back * focal), levels - 1)
        row, column = int(v) >> level << level, int(u) >> level << level
        block = depth[row : row + (1 << level), column : column + (1 << level)]
        np.minimum(block, -back, out=block)
    return depth


def test_the_compiled_loop_draws_what_plain_python_draws(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 3, (400, 3)).astype(np.float32)
    spacing, level = rng.uniform(0.01, 1.5, 400).astype(np.float32), rng.random(400).astype(np.float32)
    eye, axes = rng.normal(0, 1, 3), view_axes(rng.normal(size=3))
    depth, gap, held, lit, light = np.zeros((5, 21, 34), np.float32)
    draw_squares(points, spacing, level, eye, axes, 34, 21, 19.0, 5, 1.08, depth, gap, held, lit, light)
    plain = plain_depth(points, spacing, eye, axes, 34, 21, 19.0, 5)
    assert np.array_equal(np.isfinite(depth), np.isfinite(plain))
    assert np.allclose(depth[np.isfinite(depth)], plain[np.isfinite(plain)], rtol=1e-5)
    assert (light <= held + 1e-6).all() and (lit <= held).all() and held.sum() > 0


def wall(distance: float, spacing: float, seed: int = 1) -> np.ndarray:
    """Points of a wall at x = ``distance``, 20 m wide and high."""
    count = int(400 / spacing**2)
    yz = np.random.default_rng(seed).uniform(-10, 10, (count, 2))
    return np.column_stack([np.full(count, distance), yz])


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_a_wall_of_single_dots_hides_what_is_behind_it_and_counts_little(share):
    """Whatever share of the scan's points the sample has."""
    rng = np.random.default_rng(2)
    seen = {}
    for spacing in (0.01, 0.06):
        points = np.concatenate([wall(1.2, spacing), wall(6.0, spacing)])
        kept = points[rng.random(len(points)) < share * min(1.0, (spacing / 0.04) ** 2)]
        sample = picture_sample(kept, np.full(len(kept), 0.5), len(kept) / len(points), spacing, 1.0)
        seen[spacing] = score(sample, np.zeros(3), np.array([1.0, 0.0, 0.0]), 1.5)
        assert seen[spacing].covered > 0.9
    assert seen[0.06].sharp < 0.25 < 0.8 < seen[0.01].sharp
    assert seen[0.06].worth < 0.4 * seen[0.01].worth


def test_a_surface_within_reach_of_an_arm_is_in_the_way():
    points = wall(0.3, 0.02)
    sample = picture_sample(points, np.full(len(points), 0.5), 1.0, 0.02, 1.0)
    assert score(sample, np.zeros(3), np.array([1.0, 0.0, 0.0]), 1.5).near > 0.5
    assert score(sample, np.array([-2.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), 1.5).near == 0.0


def test_nothing_is_seen_where_there_are_no_points():
    sample = picture_sample(np.zeros((0, 3)), np.zeros(0), 1.0, 1.0, 1.0)
    assert score(sample, np.zeros(3), np.array([1.0, 0.0, 0.0]), 1.5).worth == 0.0
