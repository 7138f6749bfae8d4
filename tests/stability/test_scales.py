"""The same place at any scale and origin, from 1 cm to 100 km, at powers of two and shifts by whole cells."""

import frame_claims
import numpy as np
import pytest
from exact_claims import depth_faults

from pointglass.viewer.bench.cases import stability
from pointglass.viewer.bench.cases.stability import panels, walls, wide_range
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import scene_from_arrays

pytestmark = pytest.mark.gl
SIZE = (160, 120)


@pytest.mark.parametrize("origin, scales", [
    (0.0, (1e-3, 30.0, 1e6)), (1e3, (1e-2, 1e3)), (1e5, (1e-3, 1.0)), (1e7, (1e-3, 1e-2, 1.0, 1e6)),
])  # fmt: skip
def test_no_scale_and_no_origin_changes_the_picture(renderers, seed, claims, origin, scales):
    """The smallest and the largest scale near and far away, those between once or twice."""
    rows, points = frame_claims.curves(renderers, seed, SIZE, scales=scales, origins=(origin,))
    claims(rows)
    assert len(points) == len(scales) and not any("refused" in point for point in points)


def test_a_billion_away_is_right_or_refused_in_one_line(renderers, seed, claims):
    """Float64 holds 1e9 to 1e-7: at scale 1e-3 points 1e-4 apart are still right, at 1e-6 they cannot be."""
    rows, points = frame_claims.curves(renderers, seed, SIZE, scales=(1e-6, 1e-3, 1.0, 1e6), origins=(1e9,))
    claims(rows)
    refused = {point["scale"]: point["refused"] for point in points if "refused" in point}
    assert 1e-6 in refused and 1.0 not in refused
    for line in refused.values():
        assert "cannot hold a point spacing" in line and "subtract an offset" in line and "\n" not in line


@pytest.mark.parametrize("refusing", [True, False])
def test_refusing_every_scale_or_none_breaks_the_claim(renderers, seed, monkeypatch, refusing):
    if refusing:
        monkeypatch.setattr(frame_claims, "agree_at", lambda *_: "cannot hold a point spacing")
    else:
        monkeypatch.setattr(frame_claims, "_is_refused", lambda *_: False)
    rows, _ = frame_claims.curves(renderers, seed, SIZE, scales=(1.0,), origins=(1e9,))
    (claim,) = (row for row in rows if "refused" in row["name"])
    assert claim["value"] == 1 and not claim["ok"]


def test_coordinates_too_large_for_float64_are_refused_naming_value_and_remedy(seed):
    place, rgb = walls(seed, 5_000)
    with pytest.raises(InputError, match=r"coordinates up to .*e\+1[34] cannot hold .*; subtract an offset") as caught:
        scene_from_arrays(place * 1e-2 + 3e14, rgb)
    assert "\n" not in str(caught.value)


def test_powers_of_two_and_shifts_by_whole_cells_change_no_byte(renderers, seed, claims):
    rng = np.random.default_rng(seed)
    exponents, shifts = rng.integers(-30, 40, 3).tolist(), [4, int(rng.integers(8, 24)), 30]
    claims(stability.exactness(renderers, seed, SIZE, exponents, shifts))


def test_one_centimetre_to_a_hundred_kilometres_in_one_frame(renderers, seed, claims):
    claims(wide_range(renderers, seed))


def test_the_judge_of_depths_sees_a_point_moved_a_little_and_one_left_out(renderers, seed):
    """What the other tests rely on: `depth_faults` finds nothing in a right picture, and much in wrong ones."""
    xyz, rgb, camera = panels(seed, (320, 240))
    scene = scene_from_arrays(xyz, rgb)
    depth = renderers.depth(scene, camera)
    held = np.isfinite(depth).sum()
    assert depth_faults(depth, xyz, camera, scene) == 0
    assert depth_faults(np.where(depth < np.inf, depth * 1.001, depth), xyz, camera, scene) > 0.7 * held
    assert depth_faults(np.where(depth < np.inf, depth * 0.999, depth), xyz, camera, scene) > 0.7 * held
    assert depth_faults(np.roll(depth, 20, axis=1), xyz, camera, scene) > 0.4 * held
    assert depth_faults(np.full_like(depth, np.inf), xyz, camera, scene) > 0.7 * held
    assert depth_faults(np.where(depth < np.inf, np.nan, depth), xyz, camera, scene) > 0.9 * held


def test_points_close_by_are_resolved_though_most_of_the_scan_is_far(seed):
    """A third of the points lie a thousand times closer together than the others: their steps stay below a quarter
    of their own spacing, which the median says nothing about."""
    rng = np.random.default_rng(seed)
    far = rng.uniform(0, 1e5, (20_000, 3)) * [1, 1, 0]
    near = rng.uniform(0, 0.1, (10_000, 3)) * [1, 1, 0] + far[0]
    scene = scene_from_arrays(np.concatenate([far, near]), np.zeros((30_000, 3), np.uint8))
    assert scene.step <= np.sqrt(0.01 / len(near)) / 4


def test_points_that_are_there_ten_times_do_not_make_the_cells_smaller(seed):
    rng = np.random.default_rng(seed)
    xyz, rgb = walls(seed, 30_000)
    once = scene_from_arrays(xyz, rgb)
    order = rng.permutation(np.tile(np.arange(len(xyz)), 10))
    many = scene_from_arrays(xyz[order], rgb[order])
    assert once.cell_size / 8 <= many.cell_size <= once.cell_size and many.count == 10 * once.count


def test_one_stray_point_does_not_decide_on_the_cells(seed):
    xyz, rgb = walls(seed, 20_000)
    for far in (1e12, -1e100, 1e300):
        scene = scene_from_arrays(np.concatenate([xyz, [[far, 1.0, 2.0]]]), np.concatenate([rgb, rgb[:1]]))
        assert scene.cell_size == scene_from_arrays(xyz, rgb).cell_size
        assert scene.meta.dropped.stray == 1 and scene.count == len(xyz)
