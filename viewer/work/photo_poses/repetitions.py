"""Where else in a scan a surface is repeated: moves that carry many features of one place onto features of the same kind.

Equal tiles, windows or steps, or two halves of a hall, let a photograph agree with a place beside the true one or opposite it,
and a search that follows the most matches may see only the wrong one.
"""

from dataclasses import dataclass

import numpy as np

from .picture_features import Features
from .reference_views import ReferenceView

NEAREST = 4
"""Features of one view that are compared with one feature: a view shows several tiles."""
SIMILAR = 0.875
"""Product of two features' values from which on they are of the same kind (a distance of 0.5)."""
TURNS = 4
"""Turns around the vertical that are tried, equal parts of a full one: buildings repeat themselves along and across."""
CELL, LEAST_SHIFT = 0.01, 0.08
"""Shares of the distance of what is seen: within which shifts agree, and the least shift: the true place of a smaller one is in
reach of the matches around a pose (pose_search.REACH)."""
APART = 3.0
"""Cells between two shifts at least."""
LEAST_VOTES = 8
"""Features that a move must carry."""


@dataclass(frozen=True, eq=False)
class Move:
    """Of a point p to rotation @ p + shift.  rotation: (3, 3).  shift: (3,), file units.  votes: features that it carries."""

    rotation: np.ndarray
    shift: np.ndarray
    votes: int


def repeating_moves(features: Features, points: np.ndarray, distance: float, views: list[ReferenceView], most: int
                    ) -> list[Move]:
    """At most ``most``, those that carry the most features first.

    features, points (n, 3): of what is repeated, file units.  distance: from which it is seen.
    """
    from scipy.spatial.transform import Rotation

    owner, there = _pairs(features, views)
    if not len(owner):
        return []
    rights = np.array([view.camera.camera_to_world[:3, 0] for view in views])  # level
    up = np.linalg.svd(rights)[2][2]
    found: list[Move] = []
    for turn in range(TURNS):
        rotation = Rotation.from_rotvec(up * 2 * np.pi * turn / TURNS).as_matrix()
        shifts = there - points[owner] @ rotation.T
        far = np.linalg.norm(shifts, axis=1) > LEAST_SHIFT * distance if turn == 0 else np.ones(len(shifts), bool)
        found += [Move(rotation, shift, votes) for shift, votes in _peaks(owner[far], shifts[far], CELL * distance, most)]
    return sorted(found, key=lambda move: -move.votes)[:most]


def _peaks(owner: np.ndarray, shifts: np.ndarray, cell: float, most: int) -> list[tuple[np.ndarray, int]]:
    """Shifts on which the most owners agree, and how many do."""
    if not len(owner):
        return []
    boxes, box = np.unique(np.floor(shifts / cell).astype(np.int64) @ (1, 1 << 20, 1 << 40), return_inverse=True)
    first = np.unique(box, return_index=True)[1]
    count = int(owner.max()) + 1
    votes = np.bincount(np.unique(box.reshape(-1) * count + owner) // count, minlength=len(boxes))  # an owner has one vote
    peaks: list[tuple[np.ndarray, int]] = []
    for number in np.argsort(-votes, kind="stable")[:10 * most]:
        middle = shifts[first[number]]
        shift = np.median(shifts[np.abs(shifts - middle).max(axis=1) < 1.5 * cell], axis=0)
        agree = len(np.unique(owner[np.linalg.norm(shifts - shift, axis=1) < cell]))
        if agree >= LEAST_VOTES and all(np.linalg.norm(shift - other) > APART * cell for other, _ in peaks):
            peaks.append((shift, agree))
        if len(peaks) == most:
            break
    return peaks


def _pairs(features: Features, views: list[ReferenceView]) -> tuple[np.ndarray, np.ndarray]:
    """Of each pair of similar features: the number of the first (n,) and the point (n, 3) of the second, in a view."""
    owners, there = [np.empty(0, np.intp)], [np.empty((0, 3))]
    for view in views:
        alike = features.values @ view.features.values.T
        count = min(NEAREST, alike.shape[1])
        nearest = np.argpartition(-alike, count - 1, axis=1)[:, :count]
        own, rank = np.nonzero(np.take_along_axis(alike, nearest, axis=1) > SIMILAR)
        owners.append(own)
        there.append(view.points[nearest[own, rank]])
    return np.concatenate(owners), np.concatenate(there)
