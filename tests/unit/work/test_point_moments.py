"""Sums of moments against NumPy's mean and covariance."""

import numpy as np

from pointglass.model.common.jit import compiled
from pointglass.viewer.work.point_moments import add_point, mean_and_covariance


@compiled()
def summed(points, sums):
    for i in range(len(points)):
        add_point(sums, points[i, 0], points[i, 1], points[i, 2])


def test_sums_have_the_mean_and_covariance_that_numpy_finds(seed):
    random = np.random.default_rng(seed)
    clouds = [random.normal(size=(int(random.integers(2, 500)), 3)) @ random.normal(size=(3, 3)) + random.normal(size=3)
              for _ in range(8)]
    sums = np.zeros((9, 10))
    for cloud, row in zip(clouds, sums, strict=False):
        summed(cloud, row)
    means, covariances = mean_and_covariance(sums)
    for cloud, mean, covariance in zip(clouds, means, covariances, strict=False):
        assert np.allclose(mean, cloud.mean(axis=0)) and np.allclose(covariance, np.cov(cloud.T, ddof=0), atol=1e-9)
    parts = [np.zeros(10), np.zeros(10)]
    summed(clouds[0][:1], parts[0])
    summed(clouds[0][1:], parts[1])
    assert np.allclose(parts[0] + parts[1], sums[0]), "parts can be added"
    assert not means[8].any() and not covariances[8].any(), "no point"
