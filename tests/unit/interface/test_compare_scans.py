"""``pointglass.compare``: arrays and open scans, in their order, and what it refuses."""

import numpy as np
import pytest

import pointglass


def floor(random, count: int = 20_000) -> np.ndarray:
    return np.c_[random.uniform(0, 1, (count, 2)), random.normal(0, 0.002, count)] + (500.0, 200.0, 30.0)


@pytest.mark.parametrize("method", ["m3c2", "c2c"])
def test_arrays_and_scans_have_the_same_distances_in_their_order(seed, method):
    random = np.random.default_rng(seed)
    before, after = floor(random), floor(random)
    after[after[:, 0] > 500.5, 2] += 0.01
    found = pointglass.compare(before, after, method=method)
    moved = after[:, 0] > 500.53
    assert np.nanmedian(found.distance[moved]) == pytest.approx(0.01, abs=3e-4)
    assert abs(np.nanmedian(found.distance[after[:, 0] < 500.47])) < 3e-4
    black = np.zeros((len(after), 3), np.uint8)
    with pointglass.from_points(after, black) as scan:
        again = pointglass.compare(before, scan, method=method)
        order = np.lexsort(after.T), np.lexsort(scan.points.xyz.T)
        np.testing.assert_array_equal(again.distance[order[1]], found.distance[order[0]])
    below = pointglass.from_points(after, black, stations=[[500.5, 200.5, 20.0]])
    with below:
        turned = pointglass.compare(before, below, method=method)
        np.testing.assert_array_equal(turned.distance[order[1]], -found.distance[order[0]])


def test_points_that_are_not_finite_have_no_distance_and_registration_is_added(seed):
    random = np.random.default_rng(seed)
    before, after = floor(random), floor(random)
    gaps = random.random(len(after)) < 0.1
    after[gaps, 1] = np.nan
    found = pointglass.compare(before, after)
    assert np.isnan(found.distance[gaps]).all() and np.isfinite(found.distance[~gaps]).mean() > 0.99
    more = pointglass.compare(before, after, registration=0.003)
    np.testing.assert_allclose(more.uncertainty, found.uncertainty + 0.003)


def test_a_mesh_gives_signed_distances_where_it_was_laid(seed, tmp_path):
    import trimesh

    random, lift = np.random.default_rng(seed), 0.004
    xyz = random.uniform(-1, 1, (20_000, 3))
    xyz[:, 2] = 1 + lift + random.normal(0, 0.001, len(xyz))  # above the upper side of a box
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "box.obj")
    found = pointglass.compare(tmp_path / "box.obj", xyz)
    away = pointglass.compare(tmp_path / "box.obj", xyz + (0, 0, 50), depth=np.inf)
    assert away.distance == pytest.approx(xyz[:, 2] + 49, abs=1e-5)
    assert np.median(found.distance) == pytest.approx(lift, abs=1e-4) and 0.001 < np.median(found.uncertainty) < 0.003
    with pointglass.from_points(xyz, np.zeros((len(xyz), 3), np.uint8)) as scan:
        moved = np.eye(4)
        moved[2, 3] = 0.01
        scan.add_mesh(tmp_path / "box.obj", transform=moved)
        again = pointglass.compare(str(tmp_path / "box.obj"), scan)
        assert np.median(again.distance) == pytest.approx(lift - 0.01, abs=1e-4)
    with pytest.raises(pointglass.InputError, match="method"):
        pointglass.compare(tmp_path / "box.obj", xyz, method="c2c")
    with pytest.raises(pointglass.InputError, match=r"none\.obj"):
        pointglass.compare(tmp_path / "none.obj", xyz)


@pytest.mark.parametrize(("given", "said"), [
    (lambda xyz: ((xyz[:, :2], xyz), {}), r"before: expected an open scan or \(N, 3\) coordinates"),
    (lambda xyz: (("house.e57", xyz), {}), "before: expected an open scan"),
    (lambda xyz: ((xyz, xyz), {"method": "icp"}), "method 'icp': expected one of m3c2, c2c"),
    (lambda xyz: ((xyz, xyz), {"registration": -1}), "registration -1: expected a length"),
    (lambda xyz: ((xyz, xyz + 9), {}), "do not overlap"),
    (lambda xyz: ((xyz[:0], xyz), {}), "before"),
])
def test_what_does_not_fit_is_refused_by_name(given, said, seed):
    arguments, named = given(floor(np.random.default_rng(seed), 500))
    with pytest.raises(pointglass.InputError, match=said):
        pointglass.compare(*arguments, **named)


def test_scans_of_other_units_are_refused(seed):
    xyz = floor(np.random.default_rng(seed), 500)
    rgb = np.zeros((500, 3), np.uint8)
    with pointglass.from_points(xyz, rgb, metres_per_unit=1.0) as one, \
            pointglass.from_points(xyz, rgb, metres_per_unit=0.3048) as other, \
            pytest.raises(pointglass.InputError, match="before is in"):  # fmt: skip
        pointglass.compare(one, other)


def test_a_volume_between_arrays_and_scans_is_the_true_one_and_bad_corners_are_refused(seed):
    random = np.random.default_rng(seed)
    before, after = floor(random, 60_000), floor(random, 60_000)
    after[(np.abs(after[:, :2] - (500.5, 200.5)) < 0.2).all(axis=1), 2] -= 0.1
    corners = np.array([(500.1, 200.1, 30.0), (500.9, 200.1, 30.0), (500.9, 200.9, 30.0), (500.1, 200.9, 30.0)])
    found = pointglass.volume_between(before, after, corners)
    assert abs(found.cut - 0.4 * 0.4 * 0.1) <= found.cut_uncertainty < 0.004 and found.fill <= found.fill_uncertainty
    with pointglass.from_points(after, np.zeros((len(after), 3), np.uint8)) as scan:
        again = pointglass.volume_between(before, scan, corners)
    assert again.cut == pytest.approx(found.cut, abs=1e-4)
    for bad in ([(0, 0)], corners[[0, 2, 1, 3]], corners + 50):
        with pytest.raises(pointglass.InputError):
            pointglass.volume_between(before, after, bad)
    for given, said in (({"corners": [(0, 0)]}, r"^corners \[\(0, 0\)\]: expected"), ({"up": (0, 0, 0)}, r"^up \(0, 0, 0\): ")):
        with pytest.raises(pointglass.InputError, match=said):
            pointglass.volume_between(before, after, **{"corners": corners, **given})


def test_the_volume_in_a_box_is_the_true_one_and_no_box_is_refused(seed):
    rng = np.random.default_rng(seed)
    for lift in (0.0, 0.05):  # of the box above the ground
        flat = rng.uniform(0, 4, (40_000, 2))
        heap = (np.abs(flat - 2) < 0.5).all(axis=1)
        cloud = np.column_stack([flat, 0.3 * heap + rng.normal(0, 0.002, len(flat))]) + [1e5, 2e5, 100]
        found = pointglass.volume_in_box(cloud, np.array([[1, 1, lift], [3, 3, 1.0]]) + [1e5, 2e5, 100])
        assert abs(found.cut - (0.3 - lift)) <= found.uncertainty < 0.06 and found.fill == 0
        assert found.place == pytest.approx((1e5 + 2, 2e5 + 2, 100 + lift)) and found.area == pytest.approx(4.0)
    with pytest.raises(pointglass.InputError, match=r"box .*each maximum above its minimum"):
        pointglass.volume_in_box(cloud, [[1, 1, 0], [0, 3, 1]])
    with pytest.raises(pointglass.InputError, match="too few"):
        pointglass.volume_in_box(cloud, [[0, 0, 0], [1, 1, 1]])
