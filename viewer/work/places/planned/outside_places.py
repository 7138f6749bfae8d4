"""Places of a publication for scans in which nobody can stand: over a landscape, and around a thing.

Frame: the upright world (viewer.work.places.up_axis), file units.  Landscapes are looked at as from a drone, at a height that
their point spacing decides; statues, machines and fragments of rooms from a ring around them and from above.
"""

from dataclasses import dataclass

import numpy as np

from ..outside_view import FLAT, framed_position, inner_points, outside_view
from ..standing_place import FIELD_OF_VIEW, Sampled, view_axes
from .covering_places import evenly_thinned, ground_around, sight

_HEIGHT = 80.0
"""Height of a place above the ground in spacings of the scan's points: straight down, points are then 6 pixels of a face of
1024 apart.  Chosen by eye on autzen_trim.laz, where it is 54 m."""
_LOWEST = 8.0
"""Metres of that height, at least."""
_OVER = 0.4
"""Share of that height that is free above all that stands within it around a place."""
_REACH = 3.0
"""Distance up to which ground is seen well, in heights: points are then two pixels apart."""
_STEP = 0.5
"""Distance between the places that are compared, in heights."""
_MOST = 600
"""Places that are compared, at most; larger scans have them farther apart."""
_POINTS = 30_000
"""Points whose visibility is decided, at most."""
_LEAST_GAIN = 0.06
"""What another place must add, as a share of what the first one sees."""
_DOWN = np.radians(-35.0)
"""Pitch of the first view over a landscape: the ground two heights away lies above the middle of the picture."""
_WIDE = 4.0
"""Heights: a scan that is wider, and flat or with points too far apart to stand among, is a landscape.  A smaller one would lie
under a single place, below the picture: it is a thing to look at."""
_AROUND = 6
"""Places around a thing: neighbours are as far from each other as from the thing."""
_STEEP = np.radians(-58.0)
"""Pitch of the place from above."""
_WORTH = 0.4
"""Share of what is seen from the best side from which on a side is worth a place."""
_DECIDE = 8_000
"""Points by which the sides of a thing are compared."""
_RING = 0.2
"""Of the distance to the thing: how far below the eye of a place around it its mark is drawn."""


@dataclass(frozen=True, eq=False)
class OutsidePlace:
    """position, direction: (3,), direction of the first view, unit vector.  below: file units from the eye down to what is
    beneath.  around: whether it looks at a thing, to which one is turned on arrival."""

    position: np.ndarray
    direction: np.ndarray
    below: float
    around: bool


def outside_places(level: Sampled, most: int, *, coarse: bool) -> list[OutsidePlace]:
    """At most ``most`` places, at least one.  level: sample of the scan, upright.  coarse: whether its points are too far apart
    to stand among."""
    extent, height = level.high - level.low, max(_HEIGHT * level.spacing, _LOWEST * level.metre)
    width = float(extent[:2].max())
    wide = width > _WIDE * height and (coarse or extent[2] < FLAT * width)
    return (_over(level, most, height) if wide else []) or _around(level, most)


def _over(level: Sampled, most: int, height: float) -> list[OutsidePlace]:
    """Places so high over a landscape, in the order of what they add; none where it has no extent."""
    points = evenly_thinned(inner_points(level, _POINTS), _POINTS)
    eyes, below = _above_ground(points, level, height)
    if len(eyes) == 0:
        return []
    views = [sight(points, eye) for eye in eyes]
    seen = np.stack([visible & (away <= _REACH * height) for away, visible, _ in views])
    worth = np.array([ground_around(nearest) for _, _, nearest in views])  # at the edge of a scan one looks at nothing
    covered, first, chosen = np.zeros(len(points), bool), 0.0, []
    while len(chosen) < most:
        gain = (seen & ~covered).sum(axis=1) * worth
        best = int(gain.argmax())
        if gain[best] <= _LEAST_GAIN * first:
            break
        first = first or float(gain[best])
        chosen.append(best)
        covered |= seen[best]
    return [OutsidePlace(eyes[one], _toward(points[seen[one]], eyes[one]), float(below[one]), around=False) for one in chosen]


def _above_ground(points: np.ndarray, level: Sampled, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Eyes (n, 3) in a lattice over the ground, and how far it is down (n,)."""
    from scipy.spatial import KDTree

    extent = (level.high - level.low)[:2]
    step = max(_STEP * height, float(np.sqrt(extent.prod() / _MOST)))
    across = [np.arange(low + min(step, size) / 2, low + size, step) for low, size in zip(level.low[:2], extent, strict=True)]
    lattice = np.stack(np.meshgrid(*across, indexing="ij"), -1).reshape(-1, 2)
    tree = KDTree(points[:, :2])
    eyes, below = [], []
    for at in lattice:
        near = points[tree.query_ball_point(at, height / 2), 2]
        beneath = points[tree.query_ball_point(at, height / 6), 2]
        if len(beneath) == 0:
            continue  # a hole, or outside the scan
        ground = float(np.quantile(beneath, 0.2))
        eye = max(ground + height, float(near.max()) + _OVER * height)
        eyes.append([*at, eye])
        below.append(eye - ground)
    return np.array(eyes).reshape(-1, 3), np.array(below)


def _toward(points: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(3,) the direction, at the pitch _DOWN, in which most of these points lie."""
    away = (points - eye)[:, :2]
    far = np.linalg.norm(away, axis=1)
    x, y = (away / np.maximum(far, 1e-12)[:, None]).mean(axis=0) if len(away) else (1.0, 0.0)
    yaw = np.arctan2(y, x)
    return np.array([np.cos(yaw) * np.cos(_DOWN), np.sin(yaw) * np.cos(_DOWN), np.sin(_DOWN)])


def _around(level: Sampled, most: int) -> list[OutsidePlace]:
    """Places around a thing, the best side first, then on around it, and one from above."""
    aspect = 1.0  # all of it is in the picture on a phone, too
    points = inner_points(level)
    x, y, z = outside_view(level, aspect)[1]
    yaw, pitch, count = float(np.arctan2(y, x)), float(np.arcsin(z)), min(most, _AROUND)
    turns = [(yaw + 2 * np.pi * number / count, pitch) for number in range(count)]
    turns += [(yaw, _STEEP)] * (most > _AROUND)
    views = []
    for turn, slope in turns:
        direction = np.array([np.cos(turn) * np.cos(slope), np.sin(turn) * np.cos(slope), np.sin(slope)])
        views.append((framed_position(level, aspect, direction, points), direction))
    worth = [_lit_in_front(level, view, aspect) for view in views]
    middle = (level.low + level.high) / 2
    return [OutsidePlace(position, direction, _RING * float(np.linalg.norm(middle - position)), around=True)
            for (position, direction), value in zip(views, worth, strict=True) if value >= _WORTH * worth[0]]


def _lit_in_front(seen: Sampled, view: tuple[np.ndarray, np.ndarray], aspect: float) -> float:
    """How good a view from outside is: the share of the points that are lit and in front, times the root of the share of the
    picture that they cover."""
    some = slice(None, None, max(1, len(seen.points) // _DECIDE))
    points, lit = seen.points[some], (seen.level > 0)[some]
    looked = (points - view[0]) @ view_axes(view[1])
    depth, tall = -looked[:, 2], np.tan(np.radians(FIELD_OF_VIEW) / 2)
    rows, columns = 45, round(45 * aspect)
    near = np.maximum(depth, 1e-9)
    column = np.clip((looked[:, 0] / (near * tall * aspect) + 1) / 2 * columns, -1, columns).astype(int)
    row = np.clip((1 - looked[:, 1] / (near * tall)) / 2 * rows, -1, rows).astype(int)
    ahead = (depth > 0) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = row[ahead] * columns + column[ahead]
    nearest = np.full(rows * columns, np.inf)
    np.minimum.at(nearest, at, depth[ahead])
    reach = 0.02 * float(np.linalg.norm(seen.high - seen.low))
    front = (depth[ahead] <= nearest[at] + reach) & lit[ahead]
    return float(front.sum()) / len(points) * float(np.isfinite(nearest).mean()) ** 0.5
