"""Views from outside: the whole scan in the picture, upright, from the side that shows most.

Statues and machines, in which nobody can stand, and terrain are framed entire.  Frame: file coordinates, world up = +z, file
units.  Works on a uniform subsample of the points.
"""

import numpy as np

from ...work.places.standing_place import FIELD_OF_VIEW, Sampled, overview_position
from .navigation import FlyState, view_along

_OUTSIDE = 16  # azimuths from which a scan is looked at from outside
_PITCHES = {"object": (-0.2, -0.5), "tile": (-0.55,)}  # radians: objects from just above, terrain from above at an angle
_FLAT = 0.3  # height over width below which a scan without a place to stand is terrain
_MARGIN = 0.86  # share of the picture that a framed scan may take
_FEW = 8_000  # points that decide on a view from outside


def overview(seen: Sampled, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) from as far as it takes to see everything.  aspect: width over height."""
    return view_along(overview_position(seen, aspect, direction), direction, speed)


def inner_points(seen: Sampled) -> np.ndarray:
    """(n, 3): a few thousand of the points that lie in the scan's range."""
    inside = np.flatnonzero(((seen.points >= seen.low) & (seen.points <= seen.high)).all(axis=1))
    return seen.points[inside[:: max(1, len(inside) // _FEW)]]


def framed(seen: Sampled, aspect: float, direction: np.ndarray, speed: float, points: np.ndarray | None = None) -> FlyState:
    """Looking along ``direction`` (3,) so that the points themselves, and not their box, fill the picture.

    points: :func:`inner_points`, where they are known.
    """
    facing = view_along(np.zeros(3), direction, speed)
    points = inner_points(seen) if points is None else points
    if len(points) < 8:
        return overview(seen, aspect, direction, speed)
    axes = facing.camera_to_world[:3, :3]
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
    eye = (seen.low + seen.high) / 2 + axes @ np.array([x, y, distance])
    return view_along(eye, direction, speed)


def from_outside(seen: Sampled, aspect: float, speed: float) -> FlyState:
    """The whole scan, from the side from which most of it is seen and lit."""
    extent = seen.high - seen.low
    flat = extent[2] < _FLAT * max(float(extent[:2].max()), 1e-300)
    best: tuple[float, FlyState | None] = (-1.0, None)
    points = inner_points(seen)
    for pitch in _PITCHES["tile" if flat else "object"]:
        for number in range(_OUTSIDE):
            yaw = 2 * np.pi * number / _OUTSIDE + 0.41  # along no axis: a corner shows more of a box than a side
            direction = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
            state = framed(seen, aspect, direction, speed, points)
            value = _visible(seen, state, aspect)
            if value > best[0] + 1e-9:
                best = value, state
    assert best[1] is not None
    return best[1]


def _visible(seen: Sampled, state: FlyState, aspect: float) -> float:
    """How good a view from outside is: the share of the points that are lit and in front, times the root of the share of the
    picture that they cover."""
    some = slice(None, None, max(1, len(seen.points) // _FEW))
    points, lit = seen.points[some], (seen.level > 0)[some]
    view = (points - state.position) @ state.camera_to_world[:3, :3]
    depth, tall = -view[:, 2], np.tan(np.radians(FIELD_OF_VIEW) / 2)
    rows, columns = 45, round(45 * aspect)
    near = np.maximum(depth, 1e-9)
    column = np.clip((view[:, 0] / (near * tall * aspect) + 1) / 2 * columns, -1, columns).astype(int)
    row = np.clip((1 - view[:, 1] / (near * tall)) / 2 * rows, -1, rows).astype(int)
    ahead = (depth > 0) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = row[ahead] * columns + column[ahead]
    nearest = np.full(rows * columns, np.inf)
    np.minimum.at(nearest, at, depth[ahead])
    reach = 0.02 * float(np.linalg.norm(seen.high - seen.low))
    front = (depth[ahead] <= nearest[at] + reach) & lit[ahead]
    return float(front.sum()) / len(points) * float(np.isfinite(nearest).mean()) ** 0.5
