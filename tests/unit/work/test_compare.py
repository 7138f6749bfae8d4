"""Distances between two scans: loops equal to their references, and changes of known size found within what is stated."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from plain_distances import m3c2_distances, surface_distances
from synthetic_pipes import frame

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.dates.date_comparison import COMPARE_METHODS
from pointglass.viewer.work.comparing import point_cells
from pointglass.viewer.work.comparing.cloud_scale import CloudScale, scale_of, sizes_for
from pointglass.viewer.work.comparing.compare import METHODS, Distances, compare, core_points
from pointglass.viewer.work.comparing.distance_statistics import statistics_of
from pointglass.viewer.work.comparing.facing import facing_of
from pointglass.viewer.work.comparing.m3c2_kernels import m3c2_at, quantile95
from pointglass.viewer.work.comparing.model_distances import METHOD
from pointglass.viewer.work.comparing.point_cells import cells_of
from pointglass.viewer.work.comparing.surface_kernels import distances_from_surface

NOBODY = np.zeros((0, 3))


def box_and_floor(random, count: int, *, noise: float, lift: float = 0.0, hole: float = 0.0) -> np.ndarray:
    """Points of a floor of 2 x 2 with a box, whose edges, corners and steps are 0.3 long.  lift: of the box's top.  hole:
    the part x > 2 - hole is missing."""
    floor = np.c_[random.uniform(0, 2, (count, 2)), np.zeros(count)]
    on_top = (np.abs(floor[:, :2] - 0.8) < 0.15).all(axis=1)
    floor[on_top, 2] = 0.3 + lift
    some = count // 8
    sides = np.c_[random.choice([0.65, 0.95], some), random.uniform(0.65, 0.95, some), random.uniform(0, 0.3, some)]
    swapped = random.random(len(sides)) < 0.5
    sides[swapped, :2] = sides[swapped, 1::-1]
    points = np.concatenate([floor, sides])
    return points[points[:, 0] <= 2 - hole] + random.normal(0, noise, (int((points[:, 0] <= 2 - hole).sum()), 3))


def waves(random, side: float, spacing: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) of a square of waves, noise along the beam, and normals (n, 3) of the surface, upwards."""
    xy = random.uniform(0, side, (int((side / spacing) ** 2), 2))
    x, y = xy.T
    normal = np.c_[-0.15 * np.cos(3 * x) * np.cos(2 * y), 0.1 * np.sin(3 * x) * np.sin(2 * y), np.ones(len(x))]
    points = np.c_[xy, 0.05 * np.sin(3 * x) * np.cos(2 * y) + random.normal(0, noise, len(x))]
    return points, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def compared(before, after, method, **more) -> Distances:
    return compare(before, after, facing_of(before, NOBODY, NOBODY), method=method, **more)


@pytest.mark.parametrize("shape", ["box", "random"])
def test_c2c_equals_its_reference(seed, shape):
    random = np.random.default_rng(seed)
    if shape == "box":
        before, after = box_and_floor(random, 20_000, noise=0.003), box_and_floor(random, 1500, noise=0.02, lift=0.02)
    else:
        before, after = random.uniform(0, 0.4, (5000, 3)), random.uniform(-0.1, 0.5, (1500, 3))
    low = np.minimum(before.min(axis=0), after.min(axis=0))
    cells = cells_of(before - low, random.uniform(0.01, 0.1))
    limit, radius = random.uniform(0.05, 0.3), random.uniform(0.03, 0.06)
    found, variance, normals = np.empty(len(after)), np.empty(len(after)), np.empty((len(after), 3))
    distances_from_surface(after - low, 0.004, limit, radius, 0.003, *cells.search, found, variance, normals, 0, len(after))
    expected, spread, expected_normals = surface_distances(after - low, before - low, limit=limit, radius=radius, own=0.004,
                                                           scatter=0.003)  # fmt: skip
    clear = np.isfinite(expected) & np.isfinite(found)
    assert (np.isfinite(expected) == np.isfinite(found)).mean() > 0.998  # rounding decides at the limits
    same = np.einsum("ij,ij->i", normals, expected_normals)[clear]
    unclear = np.abs(np.abs(same) - 1) > 1e-6  # planes through balls of points without a direction
    assert unclear.mean() < 0.002
    np.testing.assert_allclose((found[clear] * np.sign(same))[~unclear], expected[clear][~unclear], atol=1e-7)
    np.testing.assert_allclose(variance[clear][~unclear], spread[clear][~unclear], rtol=1e-5, atol=1e-12)
    assert clear.sum() > 200


@pytest.mark.parametrize("shape", ["box", "random"])
def test_m3c2_equals_its_reference(seed, shape):
    random = np.random.default_rng(seed)
    if shape == "box":
        before = box_and_floor(random, 20_000, noise=0.003, hole=0.4)
        after = box_and_floor(random, 20_000, noise=0.003, lift=0.02)
    else:
        before, after = random.uniform(0, 0.4, (4000, 3)), random.uniform(-0.1, 0.5, (4000, 3))
    low = np.minimum(before.min(axis=0), after.min(axis=0))
    side = random.uniform(0.02, 0.08)
    one, other = cells_of(after - low, side), cells_of(before - low, side)
    cores = random.permutation(after - low)[:600]
    scale, diameter, depth = random.uniform(0.05, 0.15), random.uniform(0.05, 0.1), random.uniform(0.1, 0.5)
    found, level, normals = np.empty(600), np.empty(600), np.empty((600, 3))
    counts = np.empty((600, 2), np.int32)
    m3c2_at(cores, scale, diameter, depth, 0.003, one.search, other.search, found, level, normals, counts, 0, 600)
    expected, expected_level, expected_normals, expected_counts = m3c2_distances(
        cores, after - low, before - low, scale=scale, diameter=diameter, depth=depth, noise=0.003)  # fmt: skip
    same = np.einsum("ij,ij->i", normals, expected_normals)
    clear = np.abs(np.abs(same) - 1) < 1e-9
    assert clear.mean() > 0.99
    agree = (counts == expected_counts).all(axis=1) & clear
    assert agree.mean() > 0.98  # rounding decides at the limits
    np.testing.assert_allclose((found * np.sign(same))[agree], expected[agree], atol=1e-9)
    np.testing.assert_allclose(level[agree], expected_level[agree], rtol=1e-6, atol=1e-12)
    assert np.isfinite(found).sum() > 100


def test_quantile_is_students():
    from scipy.stats import t

    freedom = np.arange(3, 200)
    np.testing.assert_allclose([quantile95.py_func(n) for n in freedom], t.ppf(0.975, freedom), rtol=0.01)


def test_spacing_and_noise_are_measured(seed):
    random = np.random.default_rng(seed)
    spacing, noise = random.uniform(0.004, 0.02), random.uniform(0.001, 0.003)
    points, _ = waves(random, 250 * spacing, spacing, noise)
    scale = scale_of(points - points.min(axis=0))
    assert scale.spacing == pytest.approx(spacing, rel=0.1)
    assert scale.noise == pytest.approx(noise, rel=0.2)
    sizes = sizes_for(scale, CloudScale(2 * spacing, 0.0))
    assert np.pi * (sizes.diameter / 2) ** 2 / (2 * spacing) ** 2 == pytest.approx(31, rel=0.072)  # to the next size
    rounded = np.round(points / 1e-5) * 1e-5
    again = scale_of(rounded - rounded.min(axis=0))
    # as a grid rounds them: the same places are measured
    assert again.spacing == pytest.approx(scale.spacing, rel=0.005) and again.noise == pytest.approx(scale.noise, rel=0.03)


@pytest.mark.parametrize("method", METHODS)
def test_2_mm_at_5_mm_spacing_with_2_mm_noise_are_found_and_the_uncertainty_holds(seed, method):
    random = np.random.default_rng(seed)
    before, _ = waves(random, 2.0, 0.005, 0.002)
    after, normal = waves(random, 2.0, 0.005, 0.002)
    turn, place = frame(random)
    moved = random.choice([-0.002, 0.002])
    after[:, 2] += moved
    truth = moved * normal[:, 2]
    before, after = before @ turn.T + place, after @ turn.T + place
    up = turn[:, 2]
    facing = facing_of(before, (before.mean(axis=0) + 50 * up)[None], NOBODY)  # a scanner far above
    found = compare(before, after, facing, method=method)
    known = np.isfinite(found.distance)
    assert known.mean() > 0.99
    assert np.nanmedian(found.distance) == pytest.approx(moved, abs=2e-4)
    inside = np.abs(found.distance - truth)[known] <= found.uncertainty[known]
    assert inside.mean() == pytest.approx(0.95, abs=0.025)
    if method == "m3c2":
        assert np.nanmedian(found.uncertainty) < 0.0013
        assert (np.abs(found.distance) > found.uncertainty).mean() > 0.9  # found
        still = compare(before, before + random.normal(0, 1e-5, before.shape), facing)
        assert (np.abs(still.distance) > still.uncertainty).mean() < 0.01


@pytest.mark.parametrize("method", METHODS)
def test_a_moved_box_is_told_from_what_stayed_and_edges_are_within_what_is_stated(seed, method):
    random = np.random.default_rng(seed)
    before = box_and_floor(random, 120_000, noise=0.001)
    after = box_and_floor(random, 120_000, noise=0.001, lift=0.02)
    found = compared(before, after, method)
    middle = np.abs(after[:, :2] - 0.8).max(axis=1)
    top = (middle < 0.11) & (after[:, 2] > 0.3)
    floor = (middle > 0.25) & (after[:, 2] < 0.1)
    for part, truth in ((top, 0.02), (floor, 0.0)):
        known = part & np.isfinite(found.distance)
        assert known.sum() > 0.97 * part.sum()
        assert np.median(found.distance[known]) == pytest.approx(truth, abs=2e-4)
        # of 95 %; neighbours share their cylinders, so that the top counts as some fifty independent points
        assert (np.abs(found.distance - truth) <= found.uncertainty)[known].mean() > 0.84
    edges = (middle > 0.13) & (middle < 0.17) & np.isfinite(found.distance)
    assert edges.sum() > 100  # what happened there is between nothing and the whole lift, whatever the normal
    outside = (found.distance + found.uncertainty < -0.02) | (found.distance - found.uncertainty > 0.02)
    assert outside[edges].mean() < 0.05


@pytest.mark.parametrize("method", METHODS)
def test_what_the_other_scan_does_not_have_gets_no_distance(seed, method):
    random = np.random.default_rng(seed)
    before, _ = waves(random, 2.0, 0.01, 0.001)
    before = before[before[:, 0] < 1.2]
    after, _ = waves(random, 2.0, 0.01, 0.001)
    found = compared(before, after, method)
    known = np.isfinite(found.distance)
    border = 1.2 + found.sizes.diameter
    assert known[after[:, 0] < 1.15].mean() > 0.99
    assert known[after[:, 0] > border].mean() < 0.01
    assert (np.isnan(found.uncertainty) == ~known).all()
    assert (np.abs(found.distance) <= found.uncertainty)[known].mean() > 0.92


@pytest.mark.parametrize("method", METHODS)
def test_both_sides_of_a_wall_have_their_own_distances(seed, method):
    random = np.random.default_rng(seed)

    def wall(thickness: float) -> np.ndarray:
        flat = random.uniform(0, 1.5, (60_000, 2))
        face = np.where(random.random(60_000) < 0.5, 0.0, thickness)
        return np.c_[flat[:, 0], face + random.normal(0, 0.001, 60_000), flat[:, 1]]

    before, after = wall(0.1), wall(0.104)
    found = compared(before, after, method)
    back = after[:, 1] > 0.05
    assert abs(np.nanmedian(found.distance[~back])) < 3e-4
    assert np.nanmedian(found.distance[back]) == pytest.approx(0.004, abs=3e-4)  # away from the middle


def test_the_sign_follows_stations_where_they_are_known_and_else_up():
    points = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    down = np.array([[0.0, 0.0, -1.0]] * 2)
    assert facing_of(points, NOBODY, NOBODY).signs(down, points).tolist() == [-1, -1]
    below = np.array([[0.0, 0.0, -5.0], [10.0, 0.0, 5.0], [np.nan] * 3])
    own = facing_of(points, NOBODY, below)
    assert own.rule == "station"
    assert own.signs(down, points, np.array([0, 0])).tolist() == [1, 1]
    assert own.signs(down, points, np.array([1, 2])).tolist() == [-1, -1]  # of the third nothing is known: up
    assert facing_of(points, below, NOBODY).signs(down, points).tolist() == [1, -1]
    outwards = np.array([[1.0, 0.0, 0.1]] * 2)
    assert facing_of(points, NOBODY, NOBODY).signs(outwards, points).tolist() == [-1, 1]


def test_scans_of_other_places_or_of_few_points_are_refused(seed):
    points = np.random.default_rng(seed).uniform(0, 1, (500, 3))
    with pytest.raises(InputError, match="do not overlap"):
        compared(points, points + 500, "m3c2")  # farther than a counterpart is looked for
    with pytest.raises(InputError, match="50 points"):
        compared(points, points[:50], "c2c")


def test_m3c2_equals_py4dgeo(seed):
    """An independent implementation, where somebody has installed it; it neither widens cylinders nor tells surfaces apart."""
    py4dgeo = pytest.importorskip("py4dgeo")
    random = np.random.default_rng(seed)
    before, after = (waves(random, 2.0, 0.006, 0.002)[0] + (0, 0, 0.3) for _ in range(2))
    cores = after[random.choice(len(after), 2000, replace=False)]
    one, other = cells_of(after, 0.02), cells_of(before, 0.02)
    found, level, normals, counts = np.empty(2000), np.empty(2000), np.empty((2000, 3)), np.empty((2000, 2), np.int32)
    m3c2_at(cores, 0.1, 0.05, 0.31, 0.002, one.search, other.search, found, level, normals, counts, 0, 2000)
    # (a depth that is a whole number of radii would make it lose the core point itself)
    theirs, about = py4dgeo.M3C2(epochs=(py4dgeo.Epoch(after), py4dgeo.Epoch(before)), corepoints=cores, cyl_radius=0.025,
                             normal_radii=(0.05,), max_distance=0.31).run()
    # normals are those of the first epoch; the distance is that of the second one from it
    # their cylinders are not widened: those with fewer than 20 points differ, whatever ours hold after widening
    full = np.minimum(about["num_samples1"], about["num_samples2"]) >= 20
    assert full.mean() > 0.9 and (counts[full] >= 20).all()
    np.testing.assert_allclose((found * np.sign(normals[:, 2]))[full], -np.ravel(theirs)[full], atol=1e-9)


def test_projects_know_the_methods_that_there_are():
    assert (*METHODS, METHOD) == COMPARE_METHODS


def test_the_colours_end_beyond_a_change_of_a_few_points(seed):
    """One point in a hundred moved by 40 times its uncertainty; of the others one in twenty changed by chance."""
    random = np.random.default_rng(seed)
    distance = random.normal(0, 0.0005, 100_000)
    distance[:1000] += 0.04
    assert 0.04 < statistics_of(distance, np.full(len(distance), 0.001)).limit < 0.1


def test_core_points_are_the_nearest_to_the_mean_of_their_cell_whatever_the_blocks(seed, monkeypatch):
    random = np.random.default_rng(seed)
    xyz = random.uniform(0, 1, (3000, 3))
    xyz[:900] *= 0.1  # cells with more points than a block
    cells = point_cells.cells_of(xyz, 0.1)
    expected = []
    for begin, end in itertools.pairwise(cells.first):
        inside = cells.points[begin:end]
        expected.append(begin + ((inside - inside.mean(axis=0)) ** 2).sum(axis=1).argmin())
    for block in (1, 64, 1000, 1 << 17):
        monkeypatch.setattr(point_cells, "_BLOCK", block)
        assert core_points(cells).tolist() == expected


def test_a_median_of_no_change_has_no_sign():
    found = statistics_of(np.zeros(5), np.full(5, 0.001))
    assert str(replace(found, quantiles=(-0.0,) * len(found.quantiles)).median) == "0.0"
