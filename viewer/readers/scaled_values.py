"""Values that a file stores as raw numbers with a scale and an offset: scaled integers of E57, coordinates of LAS and EPT."""

import numpy as np


def scaled(raw: np.ndarray, scale: float | np.ndarray, offset: float | np.ndarray) -> np.ndarray:
    """raw * scale + offset, float64, in the shape of ``raw``.

    Damaged files state scales with which the values overflow, and floats that are a signalling NaN.  They
    become inf or NaN without a warning; the grid drops such points and counts them.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(raw, np.float64) * scale + offset
