"""Places from which together every surface of a scan is seen: a greedy cover of its points by what each place sees.

Frame: the upright world (viewer.work.places.up_axis), file units; ``metre`` is file units in a metre.
A point is seen from a place where no point in its direction is clearly nearer, and seen well up to REACH.  The places in turn
are those that add most; a place in sight of an earlier one, or in the area where a person would begin, is preferred: one can
then walk from each to the next, and nobody stands on a roof to see what is seen from the rooms.
"""

import numpy as np

REACH = 5.0
"""Metres up to which a surface is seen well: a face of 1024 pixels has 8 mm there."""
_POINTS = 40_000
"""Points of the sample whose visibility is decided, at most; they are spread evenly over the surfaces."""
_COLUMNS, _ROWS = 96, 48
"""Directions that are distinguished around a place."""
_BEHIND = 1.12
"""Distance of a point, in distances of the nearest in its direction, from which on it is hidden.  A direction is 3.75 degrees
high: a floor below an eye gets 12 % farther in it at 30 degrees down; one at a more grazing angle counts as hidden."""
_LEAST_GAIN = 0.03
"""What another place must add, as a share of what the first one sees.  Chosen by the plans of demo.laz (4 places), studio.laz
(6), plant_room.laz (2) and street_corner.laz (12, the most)."""
_ELSEWHERE = 0.35
"""Worth of what is seen from a place to which one cannot walk from where a person would begin."""
_OUT_OF_SIGHT = 0.5
"""Further factor where no earlier place sees it: one could not point at it to go there."""
_GROUNDED = 0.75
"""Share of the directions below the horizon in which something must have been measured around a place, where any place has that
much: in street_corner.laz one would stand under the street without.  The plans of studio.laz and plant_room.laz stay."""
_FIRM = 0.7
"""Footing below which nobody is put, where any place has more: a table in the middle of a room, a pipe."""
_ARMS = 1.5
"""Metres that a person keeps from what is beside him where there is room: a column a metre away fills a quarter of the view."""
_TIGHT = 0.3
"""Worth of a place with something an arm's length or less away, where others have room."""
_EYE_LEVEL = 22.5
"""Degrees above and below the horizon in which things count as beside a person."""
_BESIDE = 0.05
"""Share of these directions that must be nearer than a distance for that to be how near things are."""
_NEAREST = 1.2
"""Metres between two places, at least."""


def covering_places(points: np.ndarray, candidates: np.ndarray, home: np.ndarray, metre: float, most: int,
                    footing: np.ndarray | None = None) -> np.ndarray:
    """(n, 3) of the candidates (c, 3), at most ``most``, in the order of what they add.

    points: (N, 3) float64.  home: (c,) bool, of the area where a person would begin.  footing: (c,) how well one stands
    there, 0 to 1; None: not known.
    """
    if len(candidates) == 0 or len(points) == 0:
        return np.zeros((0, 3))
    some = evenly_thinned(points, _POINTS)
    views = [sight(some, place) for place in candidates]
    seen = np.stack([visible & (away <= REACH * metre) for away, visible, _ in views])
    if not seen.any():
        seen = np.stack([visible for _, visible, _ in views])  # an outlook over a landscape
    chosen: list[int] = []
    covered = np.zeros(len(some), bool)
    linked, apart, first = np.ones(len(candidates), bool), np.ones(len(candidates), bool), 0.0
    worth = np.where(home, 1.0, _ELSEWHERE) * np.array([_room(nearest, metre) for _, _, nearest in views])
    if footing is not None:
        worth = worth * footing * ((footing >= _FIRM) | (footing < _FIRM).all())
    grounded = np.array([ground_around(nearest) for _, _, nearest in views]) >= _GROUNDED
    worth = worth * grounded if grounded.any() else worth
    while len(chosen) < most:
        gain = (seen & ~covered).sum(axis=1) * worth * np.where(linked, 1.0, _OUT_OF_SIGHT) * apart
        best = int(gain.argmax())
        if gain[best] <= _LEAST_GAIN * first:
            break
        first = first or gain[best]
        chosen.append(best)
        covered |= seen[best]
        sees = _in_sight(candidates, candidates[best], views[best][2])
        linked = sees if len(chosen) == 1 else linked | sees
        apart &= np.linalg.norm(candidates - candidates[best], axis=1) >= _NEAREST * metre
    return candidates[chosen]


def evenly_thinned(points: np.ndarray, most: int) -> np.ndarray:
    """At most about ``most`` points, one in each occupied block: surfaces near a scanner count no more than others."""
    extent = np.maximum(np.ptp(points, axis=0), 1e-9)
    side = float(np.sqrt(2 * (extent[0] * extent[1] + extent[1] * extent[2] + extent[0] * extent[2]) / most))
    while True:
        blocks = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
        _, first = np.unique(blocks @ np.array([1, 1 << 20, 1 << 40]), return_index=True)
        if len(first) <= most:
            return points[np.sort(first)]
        side *= 1.25


def _directions(away: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of the direction (n,) and distance (n,) of offsets (n, 3)."""
    far = np.maximum(np.linalg.norm(away, axis=1), 1e-12)
    column = ((np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) + 0.5) * _COLUMNS).astype(int) % _COLUMNS
    row = np.minimum((np.arccos(np.clip(away[:, 2] / far, -1, 1)) / np.pi * _ROWS).astype(int), _ROWS - 1)
    return row * _COLUMNS + column, far


def sight(points: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances (n,) of the points, which of them are visible (n,), and the nearest distance in each direction."""
    direction, far = _directions(points - place)
    nearest = np.full(_COLUMNS * _ROWS, np.inf)
    np.minimum.at(nearest, direction, far)
    return far, far <= _BEHIND * nearest[direction], nearest


def _room(nearest: np.ndarray, metre: float) -> float:
    """Worth of the room around a place, _TIGHT to 1.  nearest: as of :func:`sight`."""
    rows = round(_EYE_LEVEL / 180 * _ROWS)
    beside = nearest.reshape(_ROWS, _COLUMNS)[_ROWS // 2 - rows : _ROWS // 2 + rows]
    beside = beside.reshape(rows // 2, 4, _COLUMNS // 2, 2).min(axis=(1, 3))  # between the points of a surface are gaps
    near = float(np.quantile(beside, _BESIDE, method="lower")) / metre  # of infinite ones no mean
    return float(np.clip((near - 0.5) / (_ARMS - 0.5), _TIGHT, 1.0))


def ground_around(nearest: np.ndarray) -> float:
    """Share of the directions below the horizon in which something was measured, in blocks of 4 x 4 of them."""
    below = np.isfinite(nearest.reshape(_ROWS, _COLUMNS)[_ROWS // 2 :])
    return float(below.reshape(_ROWS // 8, 4, _COLUMNS // 4, 4).any(axis=(1, 3)).mean())


def _in_sight(places: np.ndarray, eye: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """(n,) bool: whether nothing lies between ``eye``, with the distances of :func:`sight`, and each place."""
    direction, far = _directions(places - eye)
    return far <= 0.95 * nearest[direction]
