"""Profiles along a line follow the true ground, without what hangs above it, and are refused where there is none."""

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.work.fits.measured import in_cloud
from pointglass.viewer.work.measuring.height_grid import MOST
from pointglass.viewer.work.measuring.profile import measured_profile


def ground(flat: np.ndarray) -> np.ndarray:
    return 0.3 * np.sin(1.5 * flat[:, 0]) + 0.1 * flat[:, 1]


def test_a_profile_is_the_height_of_the_ground_along_the_line_without_the_ceiling(seed):
    random = np.random.default_rng(seed)
    axes, shift = np.linalg.qr(random.normal(size=(3, 3)))[0], random.uniform(-1e5, 1e5, 3)
    flat = random.uniform(-3, 3, (90_000, 2))
    flat = flat[(np.abs(flat[:, 0] - 1) > 0.2)]  # without points between 0.8 and 1.2
    xyz = np.column_stack([flat, ground(flat) + random.normal(size=len(flat)) * 0.002])
    xyz = np.concatenate([xyz, xyz[:20_000] + [0, 0, 2.5]]) @ axes
    turn = random.uniform(-0.5, 0.5)
    ends = np.array([[-2.5, -2.5 * np.tan(turn)], [2.5, 2.5 * np.tan(turn)]])
    ends = np.column_stack([ends, ground(ends)])
    place = ends[0] @ axes + shift
    found = measured_profile(in_cloud(xyz + shift, place, MOST), ends @ axes + shift - place, 0.02, axes[2])
    share = np.array(found.stations)[:, None] / np.linalg.norm(ends[1, :2] - ends[0, :2])
    truth = ground(ends[0, :2] + share * (ends[1, :2] - ends[0, :2])) - ends[0, 2]
    assert np.abs(np.array(found.heights) - truth).max() < 0.04 and np.median(np.abs(np.array(found.heights) - truth)) < 0.005
    at = ends[0, 0] + np.array(found.stations) * np.cos(turn)
    assert not (np.abs(at - 1) < 0.12).any() and len(at) > 0.85 * 5 / np.cos(turn) / found.step
    assert min(found.counts) >= 1 and found.width == pytest.approx(0.08)


def test_a_line_that_goes_upwards_or_through_nothing_has_no_profile():
    points = in_cloud(np.random.default_rng(1).uniform(-1, 1, (1000, 3)) * [1, 1, 0], np.zeros(3))
    up = np.array([0.0, 0.0, 1.0])
    for ends, problem in (([[0, 0, 0], [0, 0, 1]], "above each other"), ([[5, 5, 0], [6, 5, 0]], "no measured points")):
        with pytest.raises(InputError, match=problem):
            measured_profile(points, np.array(ends, float), 0.05, up)
