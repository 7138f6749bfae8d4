"""Exposure compensation: known gains are recovered, and colours without an estimate are unchanged."""

import numpy as np
import pytest

from pointglass.model.appearance.exposure import exposures_of, match_exposures, solve_exposures


def _room(rng, count, gains, noise=2.0, apart=0.0):
    """Points of a textured box wall seen by len(gains) scans, each with its own gain (3,)."""
    xyz, rgb, scan = [], [], []
    for number, gain in enumerate(gains):
        p = rng.uniform(0, 4, (count, 3))
        p[:, 2] = 0.002 * rng.normal(size=count)
        p[:, 0] += apart * number
        true = 110 + 60 * np.sin(3 * p[:, :1]) + 25 * np.cos(5 * p[:, 1:2]) * np.array([1, 0.5, -0.5])
        xyz.append(p)
        rgb.append(np.clip(np.rint(true * gain + noise * rng.normal(size=(count, 3))), 0, 255).astype(np.uint8))
        scan.append(np.full(count, number, np.uint8))
    return np.concatenate(xyz), np.concatenate(rgb), np.concatenate(scan)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_known_gains_are_compensated_at_any_scale(seed, scale):
    rng = np.random.default_rng(seed)
    gains = 1 + rng.uniform(-0.12, 0.12, (4, 3))
    gains /= gains.mean(0)
    xyz, rgb, scan = _room(rng, 40_000, gains)
    found = exposures_of(xyz * scale + 1e6 * scale, rgb, scan)
    assert found.matched.all() and (found.shared + np.eye(4, dtype=int) > 0).all()
    assert np.abs(found.gains * gains - 1).max() < 0.02
    matched = match_exposures(xyz, rgb, scan)
    means = [matched[scan == s].mean(0) for s in range(4)]
    assert np.ptp(means, axis=0).max() < 3 < np.ptp([rgb[scan == s].mean(0) for s in range(4)], axis=0).max()


def test_scans_that_share_nothing_keep_their_colours():
    rng = np.random.default_rng(1)
    xyz, rgb, scan = _room(rng, 20_000, np.array([[0.9] * 3, [1.1] * 3]), apart=10.0)
    assert not exposures_of(xyz, rgb, scan).matched.any()
    assert np.array_equal(match_exposures(xyz, rgb, scan), rgb)


def test_scans_that_differ_in_more_than_exposure_keep_their_colours():
    rng = np.random.default_rng(2)
    xyz, rgb, scan = _room(rng, 20_000, np.array([[1.0] * 3, [1.0] * 3]))
    rgb[scan == 1] = rng.integers(30, 230, ((scan == 1).sum(), 3))
    assert np.array_equal(match_exposures(xyz, rgb, scan), rgb)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_few_points_and_a_single_scan_are_unchanged(count):
    xyz, rgb = np.zeros((count, 3)), np.full((count, 3), 9, np.uint8)
    assert np.array_equal(match_exposures(xyz, rgb, np.zeros(count, np.uint8)), rgb)


def test_two_linked_groups_each_keep_their_own_mean():
    rng = np.random.default_rng(3)
    a = _room(rng, 30_000, np.array([[0.9] * 3, [1.1] * 3]))
    b = _room(rng, 30_000, np.array([[0.95] * 3, [1.05] * 3]))
    xyz = np.concatenate([a[0], b[0] + (100, 0, 0)])
    found = exposures_of(xyz, np.concatenate([a[1], b[1]]), np.concatenate([a[2], b[2] + 2]))
    assert found.gains[:2].mean(1) == pytest.approx([1 / 0.9, 1 / 1.1], abs=0.02)
    assert found.gains[2:].mean(1) == pytest.approx([1 / 0.95, 1 / 1.05], abs=0.02)


@pytest.mark.parametrize("far", [1e12, 1e20, 1e300])
def test_outlier_points_change_nothing(far):
    """With them voxel numbers would exceed 64 bits, and all other points would share one voxel."""
    xyz, rgb, scan = _room(np.random.default_rng(3), 20_000, np.array([[0.9] * 3, [1.1] * 3]))
    outlier = np.array([[far, 0, 0], [0, -far, 0], [far, far, far]])
    with np.errstate(all="raise"):
        known = solve_exposures(xyz, rgb, scan, 0.03)
        more = np.concatenate([xyz, outlier]), np.append(rgb, [[99] * 3] * 3, axis=0), np.append(scan, [0, 1, 1])
        found = solve_exposures(*more, 0.03)
    assert known.matched.all()
    np.testing.assert_array_equal(found.gains, known.gains)


def test_many_scans_are_solved_as_few_are(seed, monkeypatch):
    """The sparse solver against the dense one, and a chain of scans too long for it; each scan overlaps the next by half."""
    from pointglass.model.appearance import exposure

    random = np.random.default_rng(seed)
    count = 40
    xyz = np.stack([random.random(count * 8000) * (count + 1), random.random(count * 8000), np.zeros(count * 8000)], axis=1)
    left = np.floor(xyz[:, 0]).astype(int)
    scan = np.clip(left - random.integers(0, 2, len(xyz)), 0, count - 1)
    factor = random.uniform(0.9, 1.1, (count, 3))
    true = 120 + 40 * np.sin(9 * xyz[:, :1]) * np.cos(7 * xyz[:, 1:2])
    rgb = np.clip(np.rint(true * factor[scan]), 0, 255).astype(np.uint8)
    spacing = 0.007
    dense = exposure.solve_exposures(xyz, rgb, scan, spacing)
    monkeypatch.setattr(exposure, "_DENSE", 0)
    sparse = exposure.solve_exposures(xyz, rgb, scan, spacing)
    assert dense.matched.all() and sparse.matched.all()
    np.testing.assert_allclose(sparse.gains, dense.gains, rtol=1e-6)
    evened = sparse.gains * factor
    assert np.ptp(evened, axis=0).max() < 0.03 < np.ptp(factor, axis=0).min()
