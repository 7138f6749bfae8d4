"""Compiled loop: the nearest place of a triangle to a point (Ericson, Real-Time Collision Detection, 5.1.5)."""

import numpy as np

from ....model.common.jit import compiled


@compiled(nogil=True)
def nearest_weights(xyz, corners, weights, start, stop):
    """Weights of the corners at the nearest place of a triangle to each point; of those beside an edge one or two are 0.

    xyz: (n, 3) float64.  corners: (n, 3, 3) float64, the triangle of each point.  weights: (n, 3) float64, written.
    """
    ab, ac, ap = np.empty(3), np.empty(3), np.empty(3)
    for i in range(start, stop):
        for k in range(3):
            ab[k], ac[k] = corners[i, 1, k] - corners[i, 0, k], corners[i, 2, k] - corners[i, 0, k]
            ap[k] = xyz[i, k] - corners[i, 0, k]
        d1, d2 = (ab * ap).sum(), (ac * ap).sum()
        abab, abac, acac = (ab * ab).sum(), (ab * ac).sum(), (ac * ac).sum()
        d3, d4, d5, d6 = d1 - abab, d2 - abac, d1 - abac, d2 - acac
        va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
        if d1 <= 0.0 and d2 <= 0.0:
            v, w = 0.0, 0.0
        elif d3 >= 0.0 and d4 <= d3:
            v, w = 1.0, 0.0
        elif d6 >= 0.0 and d5 <= d6:
            v, w = 0.0, 1.0
        elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
            v, w = d1 / (d1 - d3), 0.0
        elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            v, w = 0.0, d2 / (d2 - d6)
        elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
            w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
            v = 1.0 - w
        else:
            v, w = vb / (va + vb + vc), vc / (va + vb + vc)
        weights[i, 0], weights[i, 1], weights[i, 2] = max(1.0 - v - w, 0.0), v, w
