"""The lattice of occupied blocks on shapes of which everybody knows the answer, and what rays meet in it."""

import numpy as np

from pointglass.model.reference.ray_march import IN_SURFACE, INNER, LOOSE, NOTHING, START_IN_SURFACE, TOUCHED, march
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.render.culling.occupancy import Occupancy, codes_of, occupancy_of, without_gaps


def slab(extent: int = 24) -> np.ndarray:
    """Blocks of a floor one block thick, with a margin of three."""
    held = np.zeros((extent, extent, 12), bool)
    held[3:-3, 3:-3, 3] = True
    return held


def test_the_middle_of_a_floor_is_told_from_its_border_and_a_wire_from_both():
    held = slab()
    held[3:-3, 12, 8] = True
    codes = codes_of(held)
    assert (codes[4:-4, 4:-4, 3] == INNER).all() and (codes[3, 3:-3, 3] == LOOSE).all()
    assert (codes[3:-3, 12, 8] == LOOSE).all() and not (codes[~held] == LOOSE).any()


def test_a_clump_is_no_surface_and_a_corner_of_two_walls_is_one():
    held = np.zeros((16, 16, 16), bool)
    held[4:12, 4:12, 4:12] = True
    assert not (codes_of(held)[5:11, 5:11, 5:11] == INNER).any()
    walls = np.zeros((16, 16, 16), bool)
    walls[3, 3:-3, 3:-3] = walls[3:-3, 3, 3:-3] = True
    assert (codes_of(walls)[3, 3, 5:-5] == INNER).all()


def test_empty_blocks_say_how_far_the_next_is(seed):
    held = np.random.default_rng(seed).random((9, 11, 13)) < 0.01
    held[4, 5, 6] = True
    codes, places = codes_of(held), np.argwhere(held)
    for at in np.ndindex(held.shape):
        if not held[at]:
            assert codes[at] == np.abs(places - at).max(axis=1).min()


def test_narrow_gaps_of_a_wall_count_as_the_wall_and_doors_and_the_space_around_it_do_not():
    held = slab(40)
    held[10:30, 15:17, 3] = held[20:26, 25:32, 3] = False  # two blocks wide, and six
    lattice = without_gaps(Occupancy(codes_of(held), np.zeros(3), 1.0, 0.3))
    codes = lattice.codes
    assert (codes[10:30, 15:17, 3] == LOOSE).all() and (codes[20:26, 25:32, 3] > LOOSE).all()
    assert (codes[~held & (np.arange(12) > 4)] > LOOSE).all() and (codes[:3] > LOOSE).all()
    down = np.array([[[0.0, 0.0, -1.0]]], np.float32)
    for codes, found in ((codes_of(held), NOTHING), (lattice.codes, TOUCHED)):
        assert march(codes, np.array([20.0, 15.9, 11.5]), down, np.ones((1, 1), np.float32), 1e6)[0, 0] == found


def test_rays_meet_what_stands_in_their_way():
    """Down onto a floor, over its border, past it; near the eye, and where points are dense, its middle does not decide."""
    codes, eye = codes_of(slab(40)), np.array([20.0, 20.0, 4.0 + START_IN_SURFACE])
    rays = np.array([[[0.0, 0.0, -1.0], [1.0, 0.0, -0.485], [1.0, 0.0, 1.0], [0.3, 1.0, 0.0]]], np.float32)
    sizes = np.ones(rays.shape[:2], np.float32)
    assert march(codes, eye, rays, sizes, 1e6).tolist() == [[IN_SURFACE, TOUCHED, NOTHING, NOTHING]]
    assert march(codes, eye, rays, sizes, 1.0).tolist() == [[TOUCHED, TOUCHED, NOTHING, NOTHING]]
    assert march(codes, eye - (0, 0, 7.0), rays, sizes, 1e6)[0, 0] == NOTHING


def test_a_march_ends_wherever_the_eye_is():
    codes = codes_of(slab())
    rays = np.array([[[0.0, 0.0, -1.0]]], np.float32)
    for height in (1e4, 1e8, 1e30):
        march(codes, np.array([10.0, 10.0, height]), rays, np.ones((1, 1), np.float32), 1.0)


def test_blocks_of_a_scan_hold_its_points_and_strays_do_not_make_them_large(seed):
    rng = np.random.default_rng(seed)
    points = np.concatenate([rng.uniform(0, 1, (50_000, 3)) * (20, 10, 0.01), [(5000.0, 0.0, 0.0)]])
    made = occupancy_of(scene_from_arrays(points, np.zeros(points.shape, np.uint8)))
    assert made.side < 0.3
    at = ((points[:-1] - made.origin) / made.side).astype(int)
    assert np.isin(made.codes[tuple(at.T)], (LOOSE, INNER)).mean() > 0.99
    one = occupancy_of(scene_from_arrays(points[:1], np.zeros((1, 3), np.uint8)))
    assert np.isfinite(one.side) and one.side > 0
