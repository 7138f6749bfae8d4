"""Point spacing against scans of known density, a search tree and plain counting."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from pointglass.viewer.grid.building import spacing
from pointglass.viewer.grid.building.spacing_kernels import neighbour_distances
from pointglass.viewer.grid.open_scene import scene_from_arrays


@pytest.mark.parametrize("density", [1.0, 100.0, 1e4])
def test_spacing_is_one_over_the_root_of_density(density):
    random = np.random.default_rng(5)
    side = np.sqrt(60_000 / density)
    xyz = np.column_stack([random.random((60_000, 2)) * side, np.zeros(60_000)])
    scene = scene_from_arrays(xyz, np.zeros((60_000, 3), np.uint8))
    assert abs(scene.spacing * np.sqrt(density) - 1) < 0.1


@pytest.mark.parametrize(("points", "times"), [(5_000, 2), (5_000, 7), (150_000, 2), (150_000, 7)])
def test_duplicate_points_do_not_increase_density(points, times):
    """Whole, and of cells whose points are too many to look at all."""
    xyz = np.column_stack([np.random.default_rng(6).random((points, 2)), np.zeros(points)])
    repeated = np.tile(xyz, (times, 1))
    once, often = (scene_from_arrays(p, np.zeros(p.shape, np.uint8)) for p in (xyz, repeated))
    assert abs(once.spacing * np.sqrt(points) - 1) < 0.1
    assert abs(often.spacing / once.spacing - 1) < 0.05


@pytest.mark.parametrize("times", [1, 2, 5, 40])
@pytest.mark.parametrize("taken", [0.02, 0.3, 0.9, 1.0])
def test_the_estimated_share_of_remaining_positions_is_right(times, taken):
    left = np.random.default_rng(7).random((20_000, times)) < taken
    there = left.any(axis=1)
    assert abs(spacing._places_kept(taken, left.sum() / there.sum()) / there.mean() - 1) < 0.1


@pytest.mark.parametrize("seed", range(8))
def test_distances_to_the_eighth_nearest_position_equal_a_search_trees(seed):
    random = np.random.default_rng(seed)
    places = np.unique(random.integers(0, 2 ** random.integers(2, 16), (random.integers(1, 400), 3)), axis=0)
    xyz = random.permutation(np.repeat(places, random.integers(1, 20, len(places)), axis=0)).astype(float)
    found, tallies, k = np.empty(len(xyz)), np.empty((len(xyz), 3), np.int64), min(8, len(xyz) - 1)
    neighbour_distances(xyz.T.copy(), np.arange(len(xyz)), k, np.empty(len(xyz)), found, tallies)
    near = min(k, len(places) - 1)
    distance = KDTree(places).query(xyz, k=[near + 1])[0][:, 0] if near else np.zeros(len(xyz))
    np.testing.assert_allclose(np.sqrt(found), distance, rtol=1e-12)
    squared = ((xyz[:, None] - xyz[None]) ** 2).sum(axis=-1)
    same = (squared == 0).sum(axis=1)
    np.testing.assert_array_equal(tallies[:, 0], same - 1)
    assert (tallies[:, 1] == near).all()
    within, held = (squared <= found[:, None]).sum(axis=1) - same, tallies[:, 2]
    # where nothing but the last place repeats, its points may be taken for one
    assert ((held == within) | (held == near)).all() and (held >= near).all()
