"""A wall with a step that is fitted as one plane: its tilt is as uncertain as the step makes it; that of a flat wall is not."""

import numpy as np
import pytest

from pointglass.viewer.work.fits.fit import Fit, fit_of
from pointglass.viewer.work.fits.measured import in_cloud

NOISE = 0.008


def wall(random, step: float) -> np.ndarray:
    """(n, 3) points of a wall along x and z of 3 x 2 m, whose right half stands back by ``step``."""
    xyz = np.column_stack([random.uniform(-1.5, 1.5, 20_000), np.zeros(20_000), random.uniform(-1.0, 1.0, 20_000)])
    xyz[:, 1] = np.where(xyz[:, 0] > 0, step, 0.0) + random.normal(0.0, NOISE, len(xyz))
    return xyz


def fitted_wall(random, step: float) -> Fit:
    xyz = wall(random, step)
    click = np.array([-0.1, 0.0, 0.1])
    return fit_of(in_cloud(xyz, click), click, "plane", 0.02, 1e-4)


def error(fit: Fit) -> float:
    """Of the tilt, degrees: both halves of the wall are upright and along x."""
    return float(np.degrees(np.arccos(min(abs(fit.direction[1]), 1.0))))


@pytest.mark.parametrize("step", [0.02, 0.03])
def test_the_tilt_of_two_walls_fitted_as_one_is_within_its_uncertainty(step, seed):
    random = np.random.default_rng(seed)
    fit = fitted_wall(random, step)
    assert fit.high > 1.2, "it reaches over the step"
    assert 0.3 < error(fit) < fit.tilt_uncertainty < 10.0


def test_the_halves_of_a_flat_wall_leave_its_uncertainty_small(seed):
    random = np.random.default_rng(seed)
    fits = [fitted_wall(random, 0.0) for _ in range(5)]
    assert np.median([fit.tilt_uncertainty for fit in fits]) < 0.05  # of one in some hundred, a half is turned by chance
    assert np.mean([error(fit) < fit.tilt_uncertainty for fit in fits]) >= 0.8
