"""Whether a piece of a surface is one plane: both halves of one have its tilt.

The jackknife of viewer.work.fits.least_squares leaves out one block of many, and so misses what goes through a whole piece: two
walls with a step between them, joined by a pilaster, give a slanted plane whose blocks agree.  Beside the piece, where a corner
of a room is, the slant is an error of decimetres.
Frame: that of the points, which the caller chooses near them; angles in radians.
"""

from dataclasses import replace

import numpy as np

from .least_squares import Fitted, fitted
from .surfaces import Plane

FEWEST = 30
"""Points of a half at least."""


def with_halves(made: Fitted, points: np.ndarray, floor: float) -> Fitted:
    """The fit of a plane to (n, 3) points.  Where the tilt of a half differs from that of the whole by more than the
    uncertainties of both explain, the largest such difference is added to the uncertainty.  floor: as of ``fitted``."""
    plane = made.surface
    assert isinstance(plane, Plane)
    along, bound = plane.unrolled(points), 0.0
    for axis in range(2):
        above = along[:, axis] > np.median(along[:, axis])
        for half in (points[above], points[~above]):
            if len(half) < FEWEST:
                continue
            try:
                part = fitted(plane.at(half.mean(axis=0)), half, floor, made.sigma)
            except ValueError:
                continue  # a half that determines no plane says nothing about the whole
            turn = np.linalg.norm(np.cross(plane.direction, part.surface.direction))
            turned = float(np.arcsin(min(turn, 1.0)))
            if turned > part.expanded("tilt") + made.expanded("tilt"):
                bound = max(bound, turned)
    return replace(made, bounds=made.bounds + np.array([bound if name == "tilt" else 0.0 for name in plane.parameters]))
