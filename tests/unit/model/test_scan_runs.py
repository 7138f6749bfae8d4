"""Runs with different exposures: their gains are compensated at any scale and in any format, other colours are unchanged."""

import numpy as np
import pytest
from cloud_files import write_las, write_ply

from pointglass.model.appearance.scan_run_kernels import (
    HUBER_LIMIT,
    PRIOR_POINTS,
    SETTLE_ITERATIONS,
    alternate,
    numbered,
    voxel_keys,
)
from pointglass.model.appearance.scan_runs import BLOCKS, ITERATIONS, LOG_OFFSET, _apply, solve_run_gains
from pointglass.viewer.commands.info import facts, format_text
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack


def _swept(rng, *, runs=40, length=3_000, apart=1.2, spread=0.25, noise=1.5):
    """A floor with texture, measured in runs, each with its own patch and gains: xyz, true colours, colours, run."""
    xyz, run = [], np.repeat(np.arange(runs), length)
    for _ in range(runs):
        low = rng.uniform(0, apart, 2)
        flat = low + rng.uniform(0, 0.8, (length, 2))
        xyz.append(np.column_stack([flat[np.argsort(flat[:, 0])], 0.0005 * rng.normal(size=length)]))
    xyz = np.concatenate(xyz)
    checks = np.where((np.floor(xyz[:, :2] / 0.1).sum(1) % 2 == 0)[:, None], 35, -35)
    true = 120 + 40 * np.sin(5 * xyz[:, :1]) * (1, 0.5, -0.5) + checks
    gains = np.exp(rng.uniform(-spread, spread, (runs, 3)))
    rgb = np.clip(np.rint(true * gains[run] + noise * rng.normal(size=true.shape)), 1, 255).astype(np.uint8)
    return xyz, true, rgb, run


def _between(rgb, true):
    """Root mean square of the log ratios between colours and the best multiple of the true ones."""
    ratio = np.log(rgb.astype(float) + LOG_OFFSET) - np.log(true + LOG_OFFSET)
    return float(np.sqrt(((ratio - ratio.mean(0)) ** 2).mean()))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_gains_of_runs_are_compensated_and_texture_stays_sharp(seed, scale):
    rng = np.random.default_rng(seed)
    xyz, true, rgb, run = _swept(rng)
    found = solve_run_gains(xyz * scale + 100 * scale, rgb, np.arange(len(xyz)))
    assert found.worthwhile
    matched = found.apply(rgb, 0)
    assert _between(matched, true) < 0.4 * _between(rgb, true)
    steps = np.abs(np.log(true[:, 0]) - np.log(true[:, 0]).mean())
    assert np.corrcoef(np.log(matched[:, 0].astype(float)), np.log(true[:, 0]))[0, 1] > 0.95 and steps.max() > 0.2
    inner = np.flatnonzero(np.diff(run) == 0)
    contrast = [np.std(np.log(c[inner, 1].astype(float))) for c in (matched, true)]
    assert contrast[0] == pytest.approx(contrast[1], rel=0.08), "the checks are as strong as they were"


def test_blocks_are_as_long_as_the_runs_allow(seed):
    """Short blocks would fit the texture; differences of complete stations need long ones."""
    rng = np.random.default_rng(seed)
    lengths = []
    for runs, length in ((3, 60_000), (60, 3_000), (1500, 120)):
        xyz, true, rgb, _ = _swept(rng, runs=runs, length=length, apart=0.2)  # all runs overlap
        found = solve_run_gains(xyz, rgb, np.arange(len(xyz)))
        assert found.worthwhile
        lengths.append(len(xyz) / len(found.at))
        assert _between(found.apply(rgb, 0), true) < 0.6 * _between(rgb, true)
    assert lengths[0] > 1000 and lengths[0] >= lengths[1] > lengths[2]


def test_one_run_equal_runs_and_random_order_keep_every_colour(seed):
    rng = np.random.default_rng(seed)
    xyz, _, alike, run = _swept(rng, spread=0.0)
    _, _, rgb, _ = _swept(np.random.default_rng(seed))
    order = rng.permutation(len(xyz))
    for points, colours in ((xyz, alike), (xyz[run == 0], alike[run == 0]), (xyz[order], rgb[order])):
        found = solve_run_gains(points, colours, np.arange(len(points)))
        assert not found.worthwhile and np.all(found.factors == 1)
    flat = np.full((5_000, 3), 90, np.uint8)
    assert not solve_run_gains(xyz[:5_000], flat, np.arange(5_000)).worthwhile
    stripes = np.where(np.floor(xyz[:, :1] / 0.02) % 2 == 0, 200, 40).astype(np.uint8).repeat(3, 1)
    assert not solve_run_gains(xyz, stripes, np.arange(len(xyz))).worthwhile, "print along the lines of a scan is print"


@pytest.mark.parametrize("count", [0, 1, BLOCKS[-1], BLOCKS[-1] + 1, 500])
def test_few_points_in_one_place(count):
    found = solve_run_gains(np.zeros((count, 3)), np.full((count, 3), 7, np.uint8), np.arange(count))
    assert not found.worthwhile


@pytest.mark.parametrize("edge", [0.3, 1e-6])
def test_voxels_are_those_of_numpy(seed, edge):
    xyz = np.random.default_rng(seed).uniform(-5, 5, (2_000, 3))
    steps = np.fmod(np.floor((xyz - xyz.min(axis=0)) / edge), 1 << 21).astype(np.int64)
    _, expected = np.unique(steps, axis=0, return_inverse=True)
    found = numbered(voxel_keys(xyz, edge))
    assert found.max() == expected.max()
    assert len(np.unique(np.stack([found, expected]), axis=1).T) == expected.max() + 1, "one number for each voxel"


def test_the_solver_equals_its_reference_implementation(seed):
    rng = np.random.default_rng(seed)
    count, voxels, blocks = 3_000, 150, 40
    log = rng.normal(4, 0.2, (count, 3)).astype(np.float32)
    voxel, block = rng.integers(voxels, size=count), np.sort(rng.integers(blocks, size=count))
    gains = np.zeros((blocks, 3))
    before, after = alternate(log, voxel, block, voxels, gains, ITERATIONS)
    reference, weight, variances = np.zeros((blocks, 3)), np.ones(count), []
    shared = np.array([len(np.unique(block[voxel == v])) > 1 for v in range(voxels)])[voxel]
    for iteration in range(-SETTLE_ITERATIONS, ITERATIONS + 1):
        rest = log - reference[block]
        mean = np.stack([np.bincount(voxel, weight * rest[:, c], voxels) for c in range(3)], 1)
        rest = (rest - (mean / np.bincount(voxel, weight, voxels)[:, None])[voxel])[shared]
        weight[shared] = np.minimum(HUBER_LIMIT / np.abs(rest).mean(1), 1)
        variances.append((weight[shared] * (rest**2).sum(1)).sum())
        if 0 <= iteration < ITERATIONS:
            change = np.stack([np.bincount(block[shared], weight[shared] * rest[:, c], blocks) for c in range(3)], 1)
            reference += change / (np.bincount(block[shared], weight[shared], blocks) + PRIOR_POINTS)[:, None]
    assert np.abs(gains - reference).max() < 1e-4
    assert (before, after) == pytest.approx((variances[SETTLE_ITERATIONS], variances[-1]), rel=1e-4)


def test_applied_gains_equal_interpolation(seed):
    rng = np.random.default_rng(seed)
    at, factors = np.sort(rng.uniform(0, 5_000, 60)), rng.uniform(0.5, 2, (60, 3))
    rgb = rng.integers(0, 256, (4_000, 3), dtype=np.uint8)
    rgb[::50] = 0
    for first in (0, 900, 4_990):
        made = np.empty_like(rgb)
        _apply(rgb, first, at, factors, made)
        factor = np.stack([np.interp(first + np.arange(len(rgb)), at, factors[:, c]) for c in range(3)], 1)
        plain = np.clip((rgb + LOG_OFFSET) * factor - LOG_OFFSET, 1, 255)
        plain[~rgb.any(1)] = 0
        assert np.abs(made - plain).max() <= 0.5 + 1e-6 and not made[~rgb.any(1)].any() and made[rgb.any(1)].min() >= 1


@pytest.mark.parametrize("kind", ["laz", "laz 16-bit", "ply", "two plys"])
def test_a_merged_scan_is_compensated_on_opening_unless_disabled(tmp_path, seed, kind):
    xyz, true, rgb, _ = _swept(np.random.default_rng(seed), length=2_000)
    xyz = np.round(xyz * 65536) / 65536
    if kind.startswith("laz"):
        files = [write_las(tmp_path / "a.laz", xyz, rgb.astype(np.uint16) * (257 if "16" in kind else 1), scale=1 / 65536)]
    elif kind == "ply":
        files = [write_ply(tmp_path / "a.ply", xyz, rgb)]
    else:
        half = len(xyz) // 2
        files = [write_ply(tmp_path / f"{n}.ply", xyz[s], rgb[s]) for n, s in (("a", slice(half)), ("b", slice(half, None)))]
    matched, plain = (open_scene(files, cache=False, match=match) for match in (True, False))
    assert facts(matched)["passes"]["applied"] and "exposures of runs" in format_text(matched)
    assert facts(plain).get("passes") is None and "exposures of runs" not in format_text(plain)
    # both scenes have the same points in the same order; true colours are those of the nearest input point
    from scipy.spatial import KDTree

    points, colours, _, _ = unpack(matched)
    near = KDTree(xyz).query(points)[1]
    assert _between(colours, true[near]) < 0.5 * _between(unpack(plain)[1], true[near])


def test_materials_written_in_sequence_keep_their_colours(seed):
    """Leaves and bark mixed in one surface, ordered by class: runs explain nearly all variance, but not as exposures do."""
    rng = np.random.default_rng(seed)
    xyz = rng.random((60_000, 3)) * (2.0, 2.0, 0.01)
    colour = np.repeat([[60, 150, 40], [150, 70, 60]], len(xyz) // 2, axis=0)
    rgb = np.clip(colour + rng.normal(0, 4, xyz.shape), 1, 255).astype(np.uint8)
    assert not solve_run_gains(xyz, rgb, np.arange(len(xyz))).worthwhile


def test_a_few_points_give_no_estimate(seed):
    rng = np.random.default_rng(seed)
    xyz = rng.random((150, 3)) * 0.1
    rgb = np.repeat([[90, 90, 90], [180, 180, 180]], 75, axis=0).astype(np.uint8)
    found = solve_run_gains(xyz, rgb, np.arange(len(xyz)))
    assert not found.worthwhile and np.array_equal(found.apply(rgb, 0), rgb)
