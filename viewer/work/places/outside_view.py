"""Views from outside: the whole scan in the picture, upright, from the side that shows most.

Statues and machines, in which nobody can stand, and terrain are framed entire; of a scan that is thin and far all around its
core, the core.  Frame: the upright world, +z up, file units.  Works on a uniform subsample of the points.
"""

from dataclasses import replace

import numpy as np

from .small_picture import PictureSample, picture_sample, score
from .standing_place import FIELD_OF_VIEW, Sampled, overview_position, view_axes

_OUTSIDE = 16  # azimuths from which a scan is looked at from outside
_PITCHES = {"object": (-0.2, -0.5), "tile": (-0.55, -0.85)}  # radians: objects from just above, terrain from above
FLAT = 0.3  # height over width below which a scan without a place to stand is terrain
_MARGIN = 0.86  # share of the picture that a framed scan may take
_FEW = 8_000  # points that decide on a view from outside
_STRAY = 0.1
"""Of the extent of 98 % of the points: what lies farther outside it is taken for stray.  The corners of aerial tiles and the
sides of statues reach up to 0.08 beyond it, what is seen through windows up to 0.8 (eight scans)."""
_CORE = 5.0
"""Percentile at each end of the points, along each axis, between which lies their core."""
_SPREAD_OUT = 0.65
"""Diagonal of the core, relative to that of 98 % of the points, below which the core alone is framed: the rest is thin and far,
and would make the picture small.  A house seen through whose windows a street was scanned has 0.51, at all, one in ten and one
in fifty points; statues, machines, aerial tiles and rooms 0.79 to 0.98 (ten scans)."""

View = tuple[np.ndarray, np.ndarray]
"""(3,) position and (3,) direction of a view."""


def framed_range(seen: Sampled) -> Sampled:
    """``seen`` with the range that a view of the whole scan frames: of nearly all of its points, or of their core."""
    low, high = np.percentile(seen.points, [_CORE, 100 - _CORE], axis=0) if len(seen.points) else (seen.low, seen.high)
    if np.linalg.norm(high - low) >= _SPREAD_OUT * np.linalg.norm(seen.high - seen.low):
        return seen
    return replace(seen, low=low, high=high)


def inner_points(seen: Sampled, most: int = _FEW) -> np.ndarray:
    """(n, 3): a few thousand, about ``most``, of the points that lie in the scan's range or little outside it."""
    slack = _STRAY * (seen.high - seen.low)
    inside = np.flatnonzero(((seen.points >= seen.low - slack) & (seen.points <= seen.high + slack)).all(axis=1))
    return seen.points[inside[:: max(1, len(inside) // most)]]


def framed_position(seen: Sampled, aspect: float, direction: np.ndarray, points: np.ndarray | None = None) -> np.ndarray:
    """(3,) position from which, along ``direction`` (3,), the points themselves, and not their box, fill the picture.

    points: :func:`inner_points`, where they are known.
    """
    points = inner_points(seen) if points is None else points
    if len(points) < 8:
        return overview_position(seen, aspect, direction)
    axes = view_axes(direction)
    right, up, back = ((points - (seen.low + seen.high) / 2) @ axes).T
    tall = _MARGIN * np.tan(np.radians(FIELD_OF_VIEW) / 2)
    x = y = 0.0
    distance = 0.0
    for _ in range(8):  # the middle of what is seen depends on the distance, which depends on the middle
        distance = max((np.abs(right - x) / (tall * aspect) + back).max(), (np.abs(up - y) / tall + back).max())
        distance = max(float(distance), float(back.max()) + 20 * seen.spacing)
        depth = distance - back
        across, high = (right - x) / depth, (up - y) / depth
        middle = float(np.median(depth))
        x += 0.5 * middle * float(across.max() + across.min()) / 2
        y += 0.5 * middle * float(high.max() + high.min()) / 2
    distance = max((np.abs(right - x) / (tall * aspect) + back).max(), (np.abs(up - y) / tall + back).max())
    distance = max(float(distance), float(back.max()) + 20 * seen.spacing)
    return (seen.low + seen.high) / 2 + axes @ np.array([x, y, distance])


def outside_sample(seen: Sampled) -> PictureSample:
    """A few thousand points of ``seen`` for small pictures.  The spacing of the sample follows from the distance between
    nearest neighbours, half a spacing where points are random."""
    from scipy.spatial import KDTree

    some = slice(None, None, max(1, len(seen.points) // _FEW))
    points = seen.points[some]
    near = np.median(KDTree(points).query(points, 2)[0][:, 1]) if len(points) > 1 else 0.0
    apart = max(2.0 * float(near), seen.spacing)
    return picture_sample(points, seen.level[some], (seen.spacing / apart) ** 2, seen.spacing, seen.metre)


def outside_view(seen: Sampled, aspect: float) -> View:
    """Position and direction: the whole scan, or its core where the rest is thin and far, from the side that gives the best
    picture (viewer.work.places.small_picture) and fills it.

    The share of the points that are in front and lit chose the open end of a thinned house, from where walls are seen edge on
    (street_corner.laz, one in ten points), and chooses nearly the same sides of a statue, of pumps and of an aerial tile.
    """
    seen = framed_range(seen)
    extent = seen.high - seen.low
    flat = extent[2] < FLAT * max(float(extent[:2].max()), 1e-300)
    best: tuple[float, View | None] = (-1.0, None)
    points, sample = inner_points(seen), outside_sample(seen)
    for pitch in _PITCHES["tile" if flat else "object"]:
        for number in range(_OUTSIDE):
            yaw = 2 * np.pi * number / _OUTSIDE + 0.41  # along no axis: a corner shows more of a box than a side
            direction = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
            view = framed_position(seen, aspect, direction, points), direction
            picture = score(sample, *view, aspect)
            value = picture.worth * picture.covered**0.5
            if value > best[0] + 1e-9:
                best = value, view
    assert best[1] is not None
    return best[1]
