"""The compiled loop of viewer.work.places.standing_place against plain numpy."""

from dataclasses import dataclass

import numpy as np
import pytest

from pointglass.viewer.work.places import standing_place as s


@dataclass
class Cloud:
    """A standing_place.Sampled of which only points, level and metre are read here."""

    points: np.ndarray
    level: np.ndarray
    metre: float
    low: np.ndarray
    high: np.ndarray
    spacing: float = 1.0


def plain_surroundings(points, level, metre, position):
    """nearest, lit, level and free as in standing_place.Surroundings, of all points."""
    away = points - position
    flat = np.hypot(away[:, 0], away[:, 1])
    slope = away[:, 2] / np.maximum(flat, 1e-9)
    azimuth = ((np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5) * s.AZIMUTHS).astype(int) % s.AZIMUTHS
    far = flat > s.TOO_NEAR * metre
    body = far & (away[:, 2] > s.BODY[0] * metre) & (away[:, 2] < s.BODY[1] * metre)
    obstacles = np.full(s.AZIMUTHS, np.inf)
    np.minimum.at(obstacles, azimuth[body], flat[body])
    free = np.min([np.roll(obstacles, k) for k in range(-s.WAY, s.WAY + 1)], axis=0)
    use = far & (np.abs(slope) < s.STEEPEST_SLOPE)
    row = np.clip(((slope[use] + s.STEEPEST_SLOPE) / (2 * s.STEEPEST_SLOPE) * s.ROWS).astype(int), 0, s.ROWS - 1)
    nearest, lit, light, held = (np.full((s.AZIMUTHS, s.ROWS), start) for start in (np.inf, 0.0, 0.0, 0.0))
    at = azimuth[use], row
    np.minimum.at(nearest, at, flat[use])
    np.add.at(held, at, 1)
    np.add.at(lit, at, level[use] > 0)
    np.add.at(light, at, level[use])
    return np.where(np.isinf(nearest), 0.0, nearest), lit / np.maximum(held, 1), light / np.maximum(held, 1), free


@pytest.mark.parametrize("count", [0, 1, 300, 40_000])
@pytest.mark.parametrize(("metre", "shift"), [(1.0, 0.0), (1000.0, 0.0), (0.3048, 3.5e6)])
def test_the_loop_equals_plain_numpy(count, metre, shift, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * 4 * metre + shift
    level = (rng.uniform(0.1, 1, count) * (rng.uniform(size=count) > 0.3)).astype(np.float32)
    position = rng.normal(size=3) * metre + shift
    near = s.surroundings(Cloud(points, level, metre, position, position), position)
    for made, plain in zip((near.nearest, near.lit, near.level, near.free),
                           plain_surroundings(points, level, metre, position), strict=True):
        assert np.allclose(made, plain, rtol=1e-12, atol=0)
