"""The start viewpoint: standing inside where the scan surrounds the eye, else looking at the whole of it from outside.

Frame: file coordinates, world up = +z, file units; ``metre`` is file units per metre (taken as 1 where the file does
not say).  Works on a few hundred thousand points of the coarse layers, which are a uniform subsample.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.tools.standing_place import FIELD_OF_VIEW, overview_position, standing_view
from viewer.window.navigation import FlyState, looking
from viewer.window.notices import ScanNotice

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

_SAMPLE = 400_000
_BLACK = 8  # of 255
_DARK = 0.22  # median level below which a scan counts as dark
_OUTSIDE = 16  # azimuths from which a scan is looked at from outside
_PITCHES = {"object": (-0.2, -0.5), "tile": (-0.55,)}  # radians: objects from just above, terrain from above at an angle
_FLAT = 0.3  # height over width below which a scan without a place to stand is terrain
_MARGIN = 0.86  # share of the picture that a framed scan may take
_FEW = 8_000  # points that decide on a view from outside
_CROSSING = 12.0  # seconds to fly across the scene


@dataclass(frozen=True, eq=False)
class Survey:
    """points: (n, 3) float64.  lit: (n,) bool, not black: nobody photographed the black ones.
    low, high: (3,) float64, where 98 % of them lie along each axis.
    spacing, metre, speed: file units (a second).  limits: slowest and fastest flying speed.
    brightness: median level of the lit points, 0 to 1."""

    points: np.ndarray
    lit: np.ndarray
    low: np.ndarray
    high: np.ndarray
    spacing: float
    metre: float
    speed: float
    limits: tuple[float, float]
    brightness: float = 0.5


def survey(scene: "Scene") -> Survey:
    """What the start needs to know of a scene."""
    from viewer.grid.scene import unpack

    ends = scene.offsets[len(scene.cell_coords) :: len(scene.cell_coords)]
    whole_layers = int(ends[max(0, int(np.searchsorted(ends, _SAMPLE, side="right")) - 1)])
    points, rgb, _, _ = unpack(scene, slice(0, whole_layers))
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    metres = scene.meta.get("metres_per_unit")
    metre = 1.0 / metres if metres else 1.0
    diagonal = max(float(np.linalg.norm(high - low)), 10 * scene.step)
    spacing = min(max(float(scene.spacing), scene.step), diagonal)
    speed = max(diagonal / _CROSSING, 5 * spacing)
    level = rgb.max(axis=1)
    lit = level > _BLACK
    brightness = float(np.median(level[lit])) / 255 if lit.any() else 0.0
    limits = (min(spacing, speed) / 4, 4 * diagonal)
    return Survey(points, lit, low, high, spacing, metre, speed, limits, brightness)


def darkness(seen: Survey) -> ScanNotice | None:
    """A notice about a scan whose points are dark, else None."""
    if seen.brightness >= _DARK:
        return None
    return ScanNotice(f"This scan is dark: half of its points are below {100 * seen.brightness:.0f} % of full brightness.")


def start_state(scene: "Scene", seen: Survey, aspect: float) -> FlyState:
    """At a scanner or at eye height where the scan surrounds that place, else outside with everything in view.

    aspect: width over height of the picture.
    """
    view = standing_view(scene, seen)
    if view is not None:
        walking = float(np.clip(seen.speed, 0.8 * seen.metre, 4.0 * seen.metre))
        return looking(*view, walking)
    return _from_outside(seen, aspect)


def start_camera(scene: "Scene", width: int, height: int) -> Camera:
    """The camera a visit to ``scene`` begins with, width and height in pixels."""
    state = start_state(scene, survey(scene), width / height)
    return from_fov(width, height, FIELD_OF_VIEW, state.camera_to_world)


def overview(seen: Survey, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) from as far as it takes to see everything.  aspect: width over height."""
    return looking(overview_position(seen, aspect, direction), direction, speed)


def framed(seen: Survey, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) so that the points themselves, and not their box, fill the picture."""
    facing = looking(np.zeros(3), direction, speed)
    inside = ((seen.points >= seen.low) & (seen.points <= seen.high)).all(axis=1)
    points = seen.points[inside][:: max(1, int(inside.sum()) // _FEW)]
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
    return looking(eye, direction, speed)


def _from_outside(seen: Survey, aspect: float) -> FlyState:
    """The whole scan, from the side from which most of it is seen and lit."""
    extent = seen.high - seen.low
    flat = extent[2] < _FLAT * max(float(extent[:2].max()), 1e-300)
    best: tuple[float, FlyState | None] = (-1.0, None)
    for pitch in _PITCHES["tile" if flat else "object"]:
        for number in range(_OUTSIDE):
            yaw = 2 * np.pi * number / _OUTSIDE + 0.41  # along no axis: a corner shows more of a box than a side
            direction = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
            state = framed(seen, aspect, direction, seen.speed)
            value = _visible(seen, state, aspect)
            if value > best[0] + 1e-9:
                best = value, state
    assert best[1] is not None
    return best[1]


def _visible(seen: Survey, state: FlyState, aspect: float) -> float:
    """How good a view from outside is: the share of the points that are lit and in front, times the root of the share of the
    picture that they cover."""
    some = slice(None, None, max(1, len(seen.points) // _FEW))
    points, lit = seen.points[some], seen.lit[some]
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
