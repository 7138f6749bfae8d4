"""Noise from pairs of points of two stations: texture finer than the point spacing is told from noise."""

import itertools

import numpy as np
import pytest

from pointglass.model.appearance.noise import estimate_noise
from pointglass.model.appearance.noise_kernels import STRIDE, nearest_of_others

SIDE = 4.0  # metres
COUNT = 200_000
SPACING = SIDE * np.sqrt(3 / COUNT)
CONTRAST = 0.08


def walls(random: np.random.Generator) -> np.ndarray:
    """(COUNT, 3): a floor and two walls of SIDE metres, in random order."""
    xyz = random.uniform(0, SIDE, (COUNT, 3))
    xyz[np.arange(COUNT), random.integers(0, 3, COUNT)] = 0.0
    return xyz


def texture(xyz: np.ndarray, length: float, random: np.random.Generator) -> np.ndarray:
    """(n,) of standard deviation 1: waves of about this length in all directions."""
    total = np.zeros(len(xyz))
    for _ in range(32):
        along = random.normal(size=3)
        total += np.cos(xyz @ (along * 7.7 / length / np.linalg.norm(along)) + random.uniform(0, 2 * np.pi))
    return total / 4


def coloured(luma: np.ndarray) -> np.ndarray:
    return np.repeat(np.clip(np.rint(luma * 255), 1, 255).astype(np.uint8)[:, None], 3, axis=1)


@pytest.mark.parametrize("length", [0.25, 0.5, 2.0])
@pytest.mark.parametrize("sigma", [0.0, 0.05])
def test_texture_finer_than_the_spacing_is_told_from_noise_where_stations_overlap(length, sigma, seed):
    """Length: in point spacings.  One station alone takes nearly all texture of these lengths for noise."""
    random = np.random.default_rng(seed)
    xyz, station = walls(random), random.integers(0, 2, COUNT)
    luma = 0.5 + CONTRAST * texture(xyz, length * SPACING, random) + 0.03 * station + random.normal(0, 1, COUNT) * sigma
    alone = estimate_noise(xyz, coloured(luma)).overall
    both = estimate_noise(xyz, coloured(luma), station).overall
    assert alone > np.hypot(sigma, 0.8 * CONTRAST)
    # a quarter of the spacing is found among the 200 nearest of 40,000 pairs only
    left = 0.65 if length == 0.25 else 0.3
    assert both < np.hypot(1.1 * sigma, left * CONTRAST)
    assert both >= 0.6 * sigma


def test_stations_that_disagree_leave_the_estimate_of_each(seed):
    """Two surveys a spacing apart: their pairs tell more than the noise, and the smaller estimate is taken."""
    random = np.random.default_rng(seed)
    xyz, station = walls(random), random.integers(0, 2, COUNT)
    luma = 0.5 + CONTRAST * texture(xyz + SPACING * station[:, None], 40 * SPACING, random) + random.normal(0, 0.02, COUNT)
    assert 0.012 < estimate_noise(xyz, coloured(luma), station).overall < 0.022


def test_points_that_stand_in_two_files_do_not_hide_noise(seed):
    random = np.random.default_rng(seed)
    xyz = walls(random)[: COUNT // 2]
    luma = 0.5 + random.normal(0, 0.03, len(xyz))
    twice, station = np.concatenate([xyz, xyz]), np.repeat([0, 1], len(xyz))
    found = estimate_noise(twice, coloured(np.concatenate([luma, luma])), station).overall
    assert found > 0.024


def test_the_nearest_of_others_is_that_of_all_distances(seed):
    random = np.random.default_rng(seed)
    sizes, begins, ends = np.array([40, 3, 25, 60, 30]), np.array([0, 0, 0, 3, 3]), np.array([3, 3, 3, 5, 5])
    starts = np.append(0, np.cumsum(sizes))
    xyz, value = random.normal(size=(starts[-1], 3)).astype(np.float32), random.random(starts[-1]).astype(np.float32)
    for a, b in itertools.pairwise(starts):
        xyz[a:b] = xyz[a:b][np.argsort(xyz[a:b, 0])]
    distance, difference = np.full((2, len(xyz)), 9.0, np.float32)
    nearest_of_others(xyz, value, starts, begins, ends, distance, difference)
    for s, (a, b) in enumerate(itertools.pairwise(starts)):
        others = [row for k in range(begins[s], ends[s]) if k != s for row in range(starts[k], starts[k + 1])]
        for i in range(a, b):
            if (i - a) % STRIDE:
                assert distance[i] == difference[i] == 9.0
                continue
            square = ((xyz[others] - xyz[i]) ** 2).sum(axis=1)
            assert distance[i] == pytest.approx(square.min(), rel=1e-4)
            assert difference[i] == value[i] - value[others[int(square.argmin())]]
