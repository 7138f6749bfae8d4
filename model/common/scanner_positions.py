"""Scanner positions of a scan as arrays, without torch: (S, 3) float64, NaN where the file stores none."""

from collections.abc import Iterable, Sequence

import numpy as np

MAX_STATIONS = 255
"""Stations that are distinguished: a point's station number has 8 bits, and later stations share one number."""


def station_positions_of(positions: Iterable[Sequence[float] | None], most: int | None = MAX_STATIONS) -> np.ndarray:
    """(S, 3) float64 of positions (x, y, z) or None, S at most ``most``; None: of any number."""
    return np.array([position or (np.nan,) * 3 for position in positions][:most], np.float64).reshape(-1, 3)


def stations_differ(places: np.ndarray | None) -> bool:
    """Whether view-dependent blending (:mod:`model.reference.station_weights`) has an effect: two known positions differ."""
    if places is None:
        return False
    known = places[~np.isnan(places).any(axis=1)]
    return len(known) > 1 and bool((np.ptp(known, axis=0) > 0).any())
