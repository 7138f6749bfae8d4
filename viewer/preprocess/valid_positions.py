"""The test for valid positions that preprocessing and the grid share.  Frame and units: the file's."""

import numpy as np

FARTHEST = 1e20
"""File units from zero beyond which a number is not a position: far more than a light year, 1e16 m, and far less than the
end of 32-bit floats, 3e38."""


def is_position(xyz: np.ndarray) -> np.ndarray:
    """(n,) bool: True where all three coordinates of (n, 3) are finite and at most FARTHEST from zero."""
    if len(xyz) and xyz.min() >= -FARTHEST and xyz.max() <= FARTHEST:  # False where one is NaN; an eighth of the time
        return np.ones(len(xyz), bool)
    x, y, z = np.abs(xyz).T  # a comparison with NaN is False
    return (x <= FARTHEST) & (y <= FARTHEST) & (z <= FARTHEST)
