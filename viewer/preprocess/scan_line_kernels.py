"""Compiled loops of viewer.preprocess.scan_lines: which planes pass through which positions.  Frame: the file's."""

import numpy as np

from ...model.common.jit import compiled


def through(places: np.ndarray, middle: np.ndarray, normal: np.ndarray, tolerance: float) -> np.ndarray:
    """(K, P) bool: which planes, of ``middle`` and ``normal`` (P, 3), pass through which of ``places`` (K, 3): the direction
    from the plane's middle to the position deviates from the plane by less than ``tolerance``, an angle in radians."""
    found = np.empty((len(places), len(middle)), np.bool_)
    _through(np.asarray(places, np.float64), np.ascontiguousarray(middle.T), np.ascontiguousarray(normal.T), tolerance, found)
    return found


@compiled(nogil=True)
def _through(places, middle, normal, tolerance, found):
    for k in range(places.shape[0]):
        px, py, pz = places[k, 0], places[k, 1], places[k, 2]
        for p in range(middle.shape[1]):
            x, y, z = px - middle[0, p], py - middle[1, p], pz - middle[2, p]
            off = abs((x * normal[0, p] + y * normal[1, p]) + z * normal[2, p])
            found[k, p] = off < tolerance * np.sqrt((x * x + y * y) + z * z)
