"""Moments of points, from which their mean and their covariance follow: kept as sums, so that parts can be added.

Sums: (10,) float64: the number of points, sums of x, y, z and of xx, xy, xz, yy, yz, zz, relative to a place near them (at map
coordinates the squares would leave nothing of a millimetre).
"""

import numpy as np

from ...model.common.jit import compiled

_SQUARE = [[4, 5, 6], [5, 7, 8], [6, 8, 9]]


@compiled(inline="always")
def add_point(sums, x, y, z):
    """Adds a point to ``sums`` (10,)."""
    sums[0] += 1
    sums[1] += x
    sums[2] += y
    sums[3] += z
    sums[4] += x * x
    sums[5] += x * y
    sums[6] += x * z
    sums[7] += y * y
    sums[8] += y * z
    sums[9] += z * z


def mean_and_covariance(sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) and (..., 3, 3) of sums (..., 10): about the mean, divided by the number.  Zero where there is no point."""
    count = np.maximum(sums[..., :1], 1.0)
    mean = sums[..., 1:4] / count
    return mean, sums[..., _SQUARE] / count[..., None] - mean[..., :, None] * mean[..., None, :]
