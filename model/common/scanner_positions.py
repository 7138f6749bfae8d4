"""Where the scanners of a scan stood: what can be said of it without torch.  (S, 3) float64, NaN where a file does not say."""

from collections.abc import Iterable, Sequence

import numpy as np


def places_of(positions: Iterable[Sequence[float] | None]) -> np.ndarray:
    """(S, 3) float64 of positions (x, y, z), or None where a file does not say; 255 at most: later scans share a number."""
    return np.array([position or (np.nan,) * 3 for position in positions][:255], np.float64).reshape(-1, 3)


def told_apart(places: np.ndarray | None) -> bool:
    """Whether weights by station say anything (:mod:`model.station_weights`): two are known to have stood apart."""
    if places is None:
        return False
    known = places[~np.isnan(places).any(axis=1)]
    return len(known) > 1 and bool((np.ptp(known, axis=0) > 0).any())
