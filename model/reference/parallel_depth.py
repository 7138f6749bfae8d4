"""The depth that an orthographic picture gives to passes made for pinholes; the reference of ``parallel_depth.comp``.

The depth filter, the fill, eye-dome lighting and the network compare depths by their ratio, because a pinhole's pixel covers
a length that grows with depth.  An orthographic pixel covers the same length everywhere, so that depths must be compared by
their difference.  ``exp`` turns one into the other: a difference of x times the depth at which a pinhole has the picture's
scale becomes the ratio exp(x), which is that pinhole's ratio to first order.  Within the neighbourhoods that these passes look
at, some tens of pixels, the difference is a small share of that depth, and a plane stays affine in the inverse (0.7 % at 96
pixels of a picture of 800 and a slope of 45 degrees).
"""

import numpy as np

MOST_DOUBLINGS = 60.0
"""Bound of the exponent, so that float32 does not overflow: 42 times the depth of the scale on either side of the middle."""


def doublings_a_unit(distance: float) -> float:
    """Exponent of two for a file unit of depth.  distance: viewer.picture.camera.Camera.orthographic."""
    return 1.0 / (distance * float(np.log(2.0)))


def pinhole_depth(depth: np.ndarray, distance: float, middle: float) -> np.ndarray:
    """(H, W) float64 depth that a pinhole's passes take; +inf where ``depth`` is.

    depth: (H, W) view-space z, file units.  distance: as above.  middle: the depth, file units, that becomes ``distance``.
    """
    exponent = (np.where(np.isfinite(depth), depth, middle) - middle) * doublings_a_unit(distance)
    return np.where(np.isfinite(depth), distance * np.exp2(exponent.clip(-MOST_DOUBLINGS, MOST_DOUBLINGS)), np.inf)
