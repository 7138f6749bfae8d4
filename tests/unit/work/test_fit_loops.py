"""The compiled loops of fits (viewer.work.fits.fit_loops) against NumPy."""

import numpy as np
import pytest
from test_fit_parts import half_pipe, random_surface

from pointglass.viewer.work.fits.fit_loops import explained, first_of_each, median_of
from pointglass.viewer.work.fits.least_squares import STEPS_AT_FIRST, TUKEY, nearest
from pointglass.viewer.work.fits.measured import distinct, in_cloud
from pointglass.viewer.work.fits.surfaces import Circle, Cylinder, Plane


def scatter_of(distances, floor):
    return max(1.4826 * np.median(np.abs(distances)), floor)


def plain_nearest(surface, points, floor, sigma):
    """As ``nearest``, with the derivatives of all points as arrays."""
    distances, slopes = surface.linearised(points)
    best = sigma if sigma is not None else scatter_of(distances, floor)
    for _ in range(STEPS_AT_FIRST):
        weights = np.maximum(1.0 - (distances / best / TUKEY) ** 2, 0.0) ** 2
        change = -np.linalg.lstsq(np.sqrt(weights)[:, None] * slopes, np.sqrt(weights) * distances, rcond=None)[0]
        surface, moved = surface.changed(change), np.abs(slopes @ change).max()
        distances, slopes = surface.linearised(points)
        before, best = best, scatter_of(distances[weights > 0], floor)
        if moved < 1e-3 * best and abs(best - before) < 1e-3 * best:
            break
    return surface, best


@pytest.mark.parametrize("kind", [Plane, Cylinder, Circle])
def test_least_squares_are_those_of_arrays_of_all_derivatives(kind, seed):
    random = np.random.default_rng(seed)
    for sigma in (None, 0.004):
        truth = random_surface(random, kind)
        if isinstance(truth, Plane):
            points = truth.place + random.uniform(-1, 1, (500, 3))
            points -= truth.distances(points)[:, None] * truth.direction
            normals = truth.normals(points)
        else:
            points, normals = half_pipe(random, truth, 500, 1.0)
        points = points + random.normal(0, 0.003, (500, 1)) * normals
        points[:40] += random.uniform(0.02, 0.2, (40, 1)) * normals[:40]  # something that lies before it
        start = truth.changed(random.normal(size=len(kind.parameters)) * 1e-3)
        (ours, scatter), (theirs, expected) = nearest(start, points, 1e-6, sigma), plain_nearest(start, points, 1e-6, sigma)
        assert scatter == pytest.approx(expected, rel=1e-6)
        assert np.abs(ours.distances(points) - theirs.distances(points)).max() < 1e-9


def test_what_cylinders_explain_is_counted_as_a_plain_mask_does(seed):
    random = np.random.default_rng(seed)
    truth = random_surface(random, Cylinder)
    points, normals = half_pipe(random, truth, 200, 2.0)
    points, normals = points + random.normal(0, 0.01, points.shape), normals + random.normal(0, 0.4, normals.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    some = [truth.changed(random.normal(size=5) * 0.02) for _ in range(30)]
    expected = [((np.abs(one.distances(points)) < 0.02) & (np.abs((one.normals(points) * normals).sum(axis=1)) > 0.8)).sum()
                for one in some]  # fmt: skip
    found = explained(points, normals, np.array([one.place for one in some]), np.array([one.direction for one in some]),
                      np.array([one.radius for one in some]), 0.02, 0.8)  # fmt: skip
    assert sum(expected) > 100 and found.tolist() == expected


def test_points_at_one_place_count_once_and_no_other_is_left_out(seed):
    """Coordinates of a grid, whose bits are alike: a sum of them took one in a hundred places for another."""
    random = np.random.default_rng(seed)
    xyz = random.integers(-400, 400, (6000, 3)) / 4096.0
    xyz[3000:] = xyz[random.integers(0, 3000, 3000)]
    first = np.sort(np.unique(xyz, axis=0, return_index=True)[1])
    assert np.array_equal(first_of_each(xyz.view(np.int64)), first)
    once = distinct(in_cloud(xyz, np.zeros(3), most=10**6))(np.zeros(3), np.eye(3), np.ones(3))
    assert once.index is not None and np.array_equal(once.index, first)


def test_the_median_is_numpy_s(seed):
    random = np.random.default_rng(seed)
    for count in range(1, 60):
        values = random.choice([random.normal(size=count), random.integers(0, 5, count).astype(float)])
        assert median_of(values.copy()) == np.median(values)
