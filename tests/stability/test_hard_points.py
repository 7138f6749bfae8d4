"""A million points in one pixel, one point in a million pixels, doubles, no numbers, and colours at both ends."""

import numpy as np
import point_claims
import pytest
from scenes import axis_camera

from pointglass.viewer.bench.cases.stability import walls
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.picture.settings import Settings

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("colour", [None, 0, 255])
def test_a_million_points_in_one_pixel_keep_their_mean(renderers, seed, claims, colour):
    claims(point_claims.crowded_pixel(renderers, seed, 1_000_000, colour))


@pytest.mark.parametrize("count, colour", [(2_000_000, 255), (4_000_000, None)])
def test_sums_beyond_32_bits_are_carried(renderers, seed, claims, count, colour):
    claims(point_claims.crowded_pixel(renderers, seed, count, colour))


def test_one_point_in_a_million_pixels(renderers, seed, claims):
    claims(point_claims.isolated_points(renderers, seed))


def test_points_that_are_there_a_thousand_times(renderers, seed, claims):
    claims(point_claims.doubles(renderers, seed))


def test_coordinates_that_are_no_numbers_change_no_byte(renderers, seed, claims):
    claims(point_claims.no_numbers(renderers, seed, (160, 120)))


def test_each_of_the_256_levels_comes_out_as_it_went_in(renderers, seed, claims):
    claims(point_claims.levels(renderers, seed))


def test_a_file_with_no_numbers_in_it_shows_the_rest(renderers, seed, tmp_path):
    """A binary PLY with NaN and infinity among its floats, against the same points from memory."""
    rng = np.random.default_rng(seed)
    xyz, rgb = walls(seed, 6_000)
    record = np.zeros(len(xyz), [("xyz", "<f4", 3), ("rgb", "u1", 3)])
    record["xyz"], record["rgb"] = xyz, rgb
    bad = rng.choice(len(xyz), 700, replace=False)
    record["xyz"][bad, rng.integers(0, 3, 700)] = rng.choice([np.nan, np.inf, -np.inf], 700)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(xyz)}", *(f"property float {a}" for a in "xyz"),
             *(f"property uchar {c}" for c in ("red", "green", "blue")), "end_header", ""]
    path = tmp_path / "holes.ply"
    path.write_bytes("\n".join(lines).encode() + record.tobytes())
    scene = open_scene(path, cache=False)
    assert scene.count == len(xyz) - 700 and scene.meta.dropped.nan == 700
    assert any("700 points" in line for line in scene.meta.warning_texts)
    good = np.setdiff1d(np.arange(len(xyz)), bad)
    memory = scene_from_arrays(record["xyz"][good].astype(np.float64), rgb[good])
    camera = axis_camera((90, 60), (4.0, 0.5, 2.0))
    assert np.array_equal(renderers.depth(scene, camera), renderers.depth(memory, camera))


def test_an_empty_picture_is_empty_in_every_view(renderers, seed):
    scene = scene_from_arrays(*walls(seed, 5_000))
    made = renderers.pictures(scene, axis_camera((33, 21), (4.0, 1e6, 2.0)), Settings())  # the room is behind the camera
    assert not np.isfinite(made["depth"]).any() and not made["mask"].any()
    assert not made["raw"].any() and not made["filtered"].any() and not made["filled"].any()
