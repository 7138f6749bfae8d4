"""Where the scanners of a scan stood: what can be said of it without torch.  (S, 3) float64, NaN where a file does not say."""

import numpy as np


def told_apart(places: np.ndarray | None) -> bool:
    """Whether weights by station say anything (:mod:`model.station_weights`): two are known to have stood apart."""
    if places is None:
        return False
    known = places[~np.isnan(places).any(axis=1)]
    return len(known) > 1 and bool((np.ptp(known, axis=0) > 0).any())
