"""Where else in a scan a surface is repeated: shifts that carry many features of one place onto features of the same kind.

Equal tiles, windows or steps let a photograph agree with a place one of them beside the true one, and a search that follows the
most matches may see only the wrong one.
"""

import numpy as np

from .picture_features import Features
from .reference_views import ReferenceView

NEAREST = 4
"""Features of one view that are compared with one feature: a view shows several tiles."""
SIMILAR = 0.875
"""Product of two features' values from which on they are of the same kind (a distance of 0.5)."""
CELL, LEAST_SHIFT = 0.01, 0.08
"""Shares of the distance of what is seen: within which shifts agree, and the least shift: the true place of a smaller one is in
reach of the matches around a pose (pose_search.REACH)."""
APART = 3.0
"""Cells between two shifts at least."""
LEAST_VOTES = 8
"""Features that a shift must carry."""


def repeated_shifts(features: Features, points: np.ndarray, distance: float, views: list[ReferenceView], most: int
                    ) -> list[np.ndarray]:
    """At most ``most`` shifts (3,), those that carry the most features first.

    features, points (n, 3): of what is repeated, file units.  distance: from which it is seen.
    """
    owner, shifts = _pairs(features, points, views)
    cell = CELL * distance
    far = np.linalg.norm(shifts, axis=1) > LEAST_SHIFT * distance
    owner, shifts = owner[far], shifts[far]
    found: list[np.ndarray] = []
    while len(found) < most and len(shifts):
        boxes, box = np.unique(np.floor(shifts / cell).astype(np.int64), axis=0, return_inverse=True)
        box = box.reshape(-1)
        one = np.unique(np.stack([box, owner], axis=1), axis=0)[:, 0]  # a feature has one vote
        fullest = boxes[np.bincount(one).argmax()]
        shift = np.median(shifts[np.abs(shifts / cell - fullest - 0.5).max(axis=1) < 1.5], axis=0)
        near = np.linalg.norm(shifts - shift, axis=1)
        if len(np.unique(owner[near < cell])) < LEAST_VOTES:
            break
        found.append(shift)
        left = near > APART * cell
        owner, shifts = owner[left], shifts[left]
    return found


def _pairs(features: Features, points: np.ndarray, views: list[ReferenceView]) -> tuple[np.ndarray, np.ndarray]:
    """Of each pair of similar features: the number of the first (n,) and the shift (n, 3) to the second."""
    owners, shifts = [np.empty(0, np.intp)], [np.empty((0, 3))]
    for view in views:
        alike = features.values @ view.features.values.T
        count = min(NEAREST, alike.shape[1])
        nearest = np.argpartition(-alike, count - 1, axis=1)[:, :count]
        own, rank = np.nonzero(np.take_along_axis(alike, nearest, axis=1) > SIMILAR)
        owners.append(own)
        shifts.append(view.points[nearest[own, rank]] - points[own])
    return np.concatenate(owners), np.concatenate(shifts)
