"""Noise estimation: known noise is found, and texture or disagreement of stations is not mistaken for it."""

import itertools

import numpy as np
import pytest

from pointglass.model.appearance import noise as module
from pointglass.model.appearance import noise_model
from pointglass.model.appearance.noise import KNOTS, LUMA, MAX_VOXELS, NoiseModel, estimate_noise
from pointglass.model.appearance.noise_kernels import FAR, NEAR, STRIDE, residuals
from pointglass.viewer.bench.cases.grid import random_surface
from pointglass.viewer.commands.info import facts, format_text
from pointglass.viewer.grid.building.noise_sample import runs
from pointglass.viewer.grid.open_scene import scene_from_arrays

SIDE = 4.0  # metres


def walls(count: int, seed: int = 0) -> np.ndarray:
    """(count, 3): a floor and two walls of SIDE metres, in random order."""
    random = np.random.default_rng(seed)
    xyz = random.uniform(0, SIDE, (count, 3))
    xyz[np.arange(count), random.integers(0, 3, count)] = 0.0
    return xyz + random.normal(0, 0.001, xyz.shape)


def textured(xyz: np.ndarray) -> np.ndarray:
    """(N,) luma of checks 0.5 m wide with stripes 0.8 m apart: edges and slopes."""
    checks = np.floor(2 * xyz + 0.25).sum(axis=1) % 2
    return 0.35 + 0.2 * checks + 0.1 * np.sin(xyz.sum(axis=1) * 2 * np.pi / 0.8)


def grey(luma: np.ndarray) -> np.ndarray:
    return np.repeat(np.clip(np.rint(luma * 255), 1, 255).astype(np.uint8)[:, None], 3, axis=1)


def spoiled(luma: np.ndarray, sigma, seed: int = 1) -> np.ndarray:
    return grey(luma + np.random.default_rng(seed).normal(0, 1, len(luma)) * sigma)


def plain_residual(xyz, value, i, count) -> float:
    """Residuals by ridge regression on the nearest points with NumPy's solver."""
    near = np.argsort(((xyz - xyz[i]) ** 2).sum(axis=1), kind="stable")[1 : count + 1]
    mean = xyz[near].mean(axis=0)
    ridge = 0.02 * ((xyz[near] - xyz[i]) ** 2).sum()
    around = xyz[near] - mean
    weights = around @ np.linalg.solve(around.T @ around + ridge * np.eye(3), xyz[i] - mean) + 1 / len(near)
    return (value[i] - weights @ value[near]) / np.sqrt(1 + (weights**2).sum())


def test_residuals_are_those_of_a_plane_through_the_neighbours(seed):
    random = np.random.default_rng(seed)
    sizes = np.array([40, 3, 12, 70])
    starts = np.append(0, np.cumsum(sizes))
    xyz = random.normal(size=(starts[-1], 3)) * (1.0, 1.0, 0.1)
    for a, b in itertools.pairwise(starts):
        xyz[a:b] = xyz[a:b][np.argsort(xyz[a:b, 0])]
    value = random.random(len(xyz)).astype(np.float32)
    near, far, reach = np.full((3, len(xyz)), 9.0, np.float32)
    residuals(xyz.astype(np.float32), value, starts, near, far, reach, 0, len(starts) - 1)
    for a, b in itertools.pairwise(starts):
        for i in range(a, b):
            if (i - a) % STRIDE:
                assert near[i] == far[i] == 9.0
                continue
            assert near[i] == pytest.approx(plain_residual(xyz[a:b], value[a:b], i - a, NEAR), abs=1e-3)
            assert far[i] == pytest.approx(plain_residual(xyz[a:b], value[a:b], i - a, FAR), abs=1e-3)


@pytest.mark.parametrize("count", [200_000, 40_000])
@pytest.mark.parametrize("sigma", [0.01, 0.03, 0.08])
def test_known_noise_is_found_on_textured_walls(count, sigma):
    xyz = walls(count)
    found = estimate_noise(xyz, spoiled(textured(xyz), sigma))
    least = 0.75 if count > 100_000 else 0.4  # with sparse points the estimate is lower
    assert least * sigma < found.overall < 1.1 * sigma + 0.002
    assert found.neighbourhoods > 100


def test_known_noise_is_found_where_walls_lie_on_faces_of_the_grids_cells():
    """The grid's cells are coarse here: none has its middle near a wall, and the estimate once was 0."""
    xyz, _ = random_surface(1_000_000)
    noise = scene_from_arrays(xyz, spoiled(textured(xyz), 0.05)).noise
    assert noise is not None and noise.neighbourhoods > 300
    assert noise.overall == pytest.approx(0.05, rel=0.3)


def test_clean_texture_is_not_noise():
    xyz = walls(200_000)
    found = estimate_noise(xyz, grey(textured(xyz)))
    assert found.overall < 0.002 and np.quantile(found.sigma, 0.95) < 0.006


def test_the_estimate_depends_on_the_seed_only():
    xyz = walls(500_000)
    rgb = spoiled(textured(xyz), 0.02)
    one, same, other = (estimate_noise(xyz, rgb, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.sigma, same.sigma) and np.array_equal(one.curve, same.curve)
    assert not np.array_equal(one.sigma, other.sigma)
    assert other.overall == pytest.approx(one.overall, rel=0.1)


def two_exposures(count: int, apart: float = 0.1):
    """xyz, luma and station: one station covers the place, another, brighter by ``apart``, the half x < SIDE / 2."""
    xyz = walls(count)
    station = (np.random.default_rng(5).random(count) < 0.5) & (xyz[:, 0] < SIDE / 2)
    return xyz, textured(xyz) + apart * station, station.astype(np.int64)


def halves(found: NoiseModel, xyz: np.ndarray) -> tuple[float, float]:
    """Median noise where two stations overlap and where there is one, half a metre from the border."""
    sigma = found.at(xyz, np.full(len(xyz), 0.5))
    both, one = xyz[:, 0] < SIDE / 2 - 0.5, xyz[:, 0] > SIDE / 2 + 0.5
    return float(np.median(sigma[both])), float(np.median(sigma[one]))


def test_disagreement_of_stations_counts_as_noise_only_without_groups():
    xyz, luma, station = two_exposures(200_000)
    rgb = spoiled(luma, 0.01)
    both, one = halves(estimate_noise(xyz, rgb, station), xyz)
    assert 0.007 < both < 0.012 and 0.007 < one < 0.012
    both, one = halves(estimate_noise(xyz, rgb), xyz)
    assert 0.035 < both < 0.07 and 0.007 < one < 0.013  # the mixture's standard deviation: 0.05


def test_runs_of_an_ordered_file_are_separated_and_a_shuffled_file_counts_as_noise():
    """The same points, ordered by station and strip, or in random order."""
    xyz, luma, station = two_exposures(200_000)
    rgb = spoiled(luma, 0.01)
    swept = np.lexsort((xyz[:, 1], np.floor(xyz[:, 0] * 20), station))
    ordered, shuffled = (scene_from_arrays(xyz[order], rgb[order]).noise for order in (swept, np.arange(len(xyz))))
    assert ordered is not None and shuffled is not None
    both, one = halves(ordered, xyz)
    assert 0.006 < both < 0.014 and 0.006 < one < 0.014
    both, one = halves(shuffled, xyz)
    assert 0.035 < both < 0.07 and 0.006 < one < 0.014


def test_consecutive_points_of_one_place_are_one_run_whatever_their_station():
    """As in octree order: neighbourhoods are consecutive, with mixed stations."""
    boxes = np.repeat(np.arange(50, dtype=np.uint64), 40)
    same = np.zeros(len(boxes), np.int64)
    number = runs(boxes, same, same, np.arange(len(boxes)), np.array([len(boxes)]))
    assert len(np.unique(number)) == 50 and all(len(set(number[boxes == box])) == 1 for box in range(50))


def test_runs_end_at_gaps_only_in_ordered_files():
    """Neighbourhoods of 20 + 20 points a half of a million points apart; where places are random, gaps mean nothing."""
    count, random = 1_000_000, np.random.default_rng(3)
    boxes = np.repeat(np.arange(60, dtype=np.uint64), 40)
    same = np.zeros(len(boxes), np.int64)
    at = (np.arange(60)[:, None] * 100 + np.append(np.arange(20), count // 2 + np.arange(20))).reshape(-1)
    number = runs(boxes, same, same, at, np.array([count]))
    assert len(np.unique(number)) == 120
    number = runs(boxes, same, same, random.permutation(count)[: len(boxes)], np.array([count]))
    assert len(np.unique(number)) == 60
    number = runs(boxes, np.arange(len(boxes)) % 2, same, at, np.array([count]))
    assert len(np.unique(number)) == 240


def test_noise_that_grows_with_brightness_has_a_rising_curve():
    xyz = walls(200_000)
    luma = 0.15 + 0.7 * (np.floor(3 * xyz + 0.1).sum(axis=1) % 4) / 3
    found = estimate_noise(xyz, spoiled(luma, 0.06 * luma))
    levels = np.array([0.15, 0.38, 0.62, 0.85])
    ratio = np.interp(levels, np.linspace(0, 1, KNOTS), found.curve) * np.median(found.sigma) / (0.06 * levels)
    assert (np.diff(found.curve[1:8]) > 0).all() and ratio.min() > 0.6 and ratio.max() < 1.9


def test_heavy_tails_and_edges_do_not_dominate_the_estimate():
    xyz = walls(200_000)
    random = np.random.default_rng(4)
    wild = np.where(random.random(len(xyz)) < 0.02, 0.4, 0.0) * random.choice((-1, 1), len(xyz))
    assert estimate_noise(xyz, spoiled(0.5 + wild, 0.01)).overall < 0.016


def test_at_looks_up_the_nearest_voxel_and_the_curve(seed):
    random = np.random.default_rng(seed)
    sigma, curve = random.random((3, 4, 5), np.float32), random.random(KNOTS).astype(np.float32)
    model = NoiseModel(np.array([10.0, 20.0, 30.0]), 0.5, sigma, curve, 0.1)
    xyz = random.uniform((9, 19, 29), (14, 23, 33), (200, 3))
    luma = random.random(200)
    found = model.at(xyz, luma)
    assert found.dtype == np.float32
    for k in range(200):
        x, y, z = (int(np.clip((xyz[k, c] - 10 * (c + 1)) // 0.5, 0, (4, 3, 2)[c])) for c in range(3))
        knot = min(int(luma[k] * 8), 7)
        share = luma[k] * 8 - knot
        assert found[k] == pytest.approx(sigma[z, y, x] * (curve[knot] * (1 - share) + curve[knot + 1] * share), rel=1e-5)


@pytest.mark.parametrize("kind", ["none", "one", "same place", "line", "few", "black", "not finite", "outlier"])
def test_scans_with_little_evidence_have_finite_noise(kind):
    xyz = walls({"none": 0, "one": 1, "few": 30}.get(kind, 20_000))
    rgb = spoiled(np.full(len(xyz), 0.5), 0.02)
    match kind:
        case "same place":
            xyz[:] = (1e6, 2e6, 3.0)
        case "line":
            xyz[:, 1:] = 0.0
        case "black":
            rgb[:] = 0
        case "not finite":
            xyz[::3] = np.nan
        case "outlier":
            xyz[7] = (1e15, -1e15, 0)
    found = estimate_noise(xyz, rgb)
    assert max(found.sigma.shape) <= MAX_VOXELS and found.curve.shape == (KNOTS,)
    assert np.isfinite(found.sigma).all() and np.isfinite(found.curve).all() and np.isfinite(found.overall)
    assert np.isfinite(found.at(np.array([[np.nan, np.inf, 0.0]]), np.array([0.5]))).all()
    if kind in ("not finite", "outlier"):
        assert found.overall == pytest.approx(0.02, rel=0.3)


def test_the_sample_is_bounded_for_any_number_of_points(monkeypatch):
    monkeypatch.setattr(module, "BUDGET", 5_000)
    xyz = walls(200_000)
    sampler = module.Sampler(xyz[:2000], np.full(2000, 100.0), budget=5_000)
    rows, boxes = sampler.pick(xyz)
    assert 2_000 < len(rows) < 12_000
    limit = np.uint64(sampler.fewer())
    fewer, kept = sampler.pick(xyz)
    assert np.array_equal(fewer, rows[boxes < limit]) and np.array_equal(kept, boxes[boxes < limit])
    for box in np.unique(kept)[:20]:  # whole: no other point lies between its points' corners
        inside = xyz[fewer[kept == box]]
        between = ((xyz > inside.min(axis=0)) & (xyz < inside.max(axis=0))).all(axis=1)
        assert between.sum() <= len(inside)


def test_info_shows_the_noise_and_colours_are_unchanged():
    xyz = walls(100_000)
    rgb = spoiled(textured(xyz), 0.03)
    scene = scene_from_arrays(xyz, rgb)
    info = facts(scene)
    assert 0.02 < info["noise"]["sigma"] < 0.04 and info["noise"]["neighbourhoods"] > 100
    line = next(line for line in format_text(scene).splitlines() if line.startswith("noise"))
    assert f"{info['noise']['sigma']:.3f} of full brightness a point ({info['noise']['sigma']:.1%})" in line


def test_luma_weights_equal_the_networks():
    unet = pytest.importorskip("pointglass.model.network.unet")
    assert np.array_equal(LUMA, unet.LUMA)


def test_smoothing_is_the_convolution_of_scipy_to_the_bit(seed):
    from scipy.ndimage import convolve1d

    rng = np.random.default_rng(seed)
    for shape in ((1, 1, 1), (1, 2, 3), (17, 40, 5)):
        values = rng.normal(size=shape)
        for axis in range(3):
            expected = convolve1d(values, [0.25, 0.5, 0.25], axis=axis, mode="nearest")
            np.testing.assert_array_equal(noise_model._binomial(values, axis), expected)
