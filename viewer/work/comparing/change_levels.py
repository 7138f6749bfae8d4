"""Distances as levels of colour for the points of a scene: what the window shows of a comparison.

The colours are those of viewer.work.comparing.distance_statistics, in steps of a fiftieth of the range.
"""

import numpy as np

from ...picture.point_sets import MOST_LEVELS
from .distance_statistics import FADED, NO_COUNTERPART, RAMP

STEPS = 50
"""Levels from 0 to either end of the range."""
UNCHANGED, UNKNOWN = 2 * STEPS + 1, 2 * STEPS + 2
"""Levels of points that did not change for certain, and of those without a counterpart."""
_PALE = (214, 214, 212)
"""sRGB of points that did not change for certain."""


def levels_of(distance: np.ndarray, uncertainty: np.ndarray, limit: float, *, certain: bool) -> np.ndarray:
    """(n,) uint8 levels of distances, (n,), NaN without a counterpart.

    limit: where the colours end, to both sides, file units.  certain: only distances above their uncertainty have a colour."""
    known = np.isfinite(distance)
    share = np.clip(np.where(known, distance, 0.0) / limit, -1.0, 1.0)
    share *= np.minimum(FADED * limit / np.maximum(np.where(known, uncertainty, 0.0), 1e-300), 1.0)
    levels = (np.rint(share * STEPS) + STEPS).astype(np.uint8)
    if certain:
        with np.errstate(invalid="ignore"):
            levels[known & ~(np.abs(distance) > uncertainty)] = UNCHANGED
    levels[~known] = UNKNOWN
    return levels


def level_colours() -> np.ndarray:
    """(MOST_LEVELS, 3) uint8 sRGB of each level."""
    colours = np.zeros((MOST_LEVELS, 3), np.uint8)
    at = np.linspace(0, len(RAMP) - 1, 2 * STEPS + 1)
    for channel in range(3):
        colours[: 2 * STEPS + 1, channel] = np.rint(np.interp(at, np.arange(len(RAMP)), RAMP[:, channel]))
    colours[UNCHANGED], colours[UNKNOWN] = _PALE, NO_COUNTERPART
    return colours


def ramp_of_legend() -> np.ndarray:
    """(256, 3) uint8: the colours from the lowest to the highest distance."""
    at = np.linspace(0, len(RAMP) - 1, 256)
    return np.stack([np.rint(np.interp(at, np.arange(len(RAMP)), RAMP[:, c])) for c in range(3)], 1).astype(np.uint8)
