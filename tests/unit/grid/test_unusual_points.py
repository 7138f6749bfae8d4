"""Grids of unusual points: one, equal ones, not finite, far from the rest or from zero, in clusters far apart."""

import numpy as np
import pytest
from cloud_files import surface

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.preprocess.scan_description import DroppedPoints
from pointglass.viewer.readers import arrays as arrays_module


def test_one_point_and_equal_points_make_a_scene():
    for xyz in ([[1.5, 2.5, -3.5]], [[0.0, 0.0, 0.0]], [[4.1e6, 5.2e6, 100.0]] * 1000):
        scene = scene_from_arrays(np.array(xyz), np.full((len(xyz), 3), 9, np.uint8))
        assert scene.count == len(xyz) and scene.spacing > 0 and scene.cell_size > 0
        np.testing.assert_allclose(unpack(scene)[0], xyz, rtol=0, atol=scene.step)


def test_points_that_are_not_finite_are_dropped_and_counted():
    xyz, rgb = surface(10_000)
    bad = xyz.copy()
    bad[::100, 1] = np.nan
    bad[50::100, 2] = np.inf
    scene = scene_from_arrays(bad, rgb)
    assert scene.count == 9800 and scene.meta.dropped == DroppedPoints(nan=200)
    assert np.isfinite(unpack(scene)[0]).all() and np.isfinite(scene.bounds).all()
    with pytest.raises(InputError, match="none of its 10,000 points is valid"):
        scene_from_arrays(np.full_like(xyz, np.nan), rgb)


def test_points_too_far_from_zero_are_counted_as_outlier_points():
    xyz, rgb = surface(1000)
    with pytest.raises(InputError, match=r"all of its 1,000 points are too far from zero \(beyond 1e\+20\)") as caught:
        scene_from_arrays(xyz + 1e30, rgb)
    assert "not finite" not in str(caught.value)
    with pytest.raises(InputError, match=r"none of its 1,000 points is valid .*too far from zero"):
        scene_from_arrays(np.where(np.arange(1000)[:, None] % 2, xyz + 1e30, np.nan), rgb)


def test_an_outlier_point_far_away_does_not_coarsen_the_grid():
    xyz, rgb = surface(50_000)
    one = scene_from_arrays(xyz, rgb)
    far = xyz.copy()
    far[40_000] = (1e5, -1e5, 3e4)
    scene = scene_from_arrays(far, rgb)
    assert scene.cell_size == one.cell_size and len(scene.cell_coords) <= len(one.cell_coords) + 1
    far[40_000] = 1e30
    scene = scene_from_arrays(far, rgb)
    assert scene.count == 49_999 and scene.meta.dropped.stray == 1 and scene.bounds.max() < 10
    assert "1 outlier point too far from the rest left out" in scene.meta.warning_texts


@pytest.mark.parametrize("far", [90, 300, 3000, 10_000])
def test_a_scan_that_continues_far_from_its_beginning_is_complete(monkeypatch, far):
    """Up to a hundredth of a chunk counts as outlier points."""
    monkeypatch.setattr(arrays_module, "CHUNK", 10_000)
    a, rgb = surface(10_000, size=1e-3)
    b, _ = surface(10_000, size=1e-3, seed=1)
    b[-far:] = surface(far, origin=(1e8, 0, 0))[0]
    scene = scene_from_arrays(np.concatenate([a, b]), np.concatenate([rgb, rgb]))
    strays = far if far <= 100 else 0
    assert scene.count == 20_000 - strays and scene.meta.dropped.stray == strays


def test_dense_clusters_far_apart_are_resolved():
    random = np.random.default_rng(3)
    middles = random.random((40, 3)) * 5000
    xyz = (middles[:, None] + random.random((40, 500, 3)) * [0.1, 0.1, 0.0]).reshape(-1, 3)
    scene = scene_from_arrays(xyz, np.zeros((len(xyz), 3), np.uint8))
    assert scene.step <= scene.spacing / 4
    assert 0.5 < scene.spacing / np.sqrt(0.01 / 500) < 2
