"""Where a visit begins: standing inside the scan where that makes sense, else looking at it from outside.

Frame: file coordinates, world up = +z, file units; ``metre`` is file units in a metre (taken as 1 where the file does
not say).  Works on a few hundred thousand points of the coarse layers, which are a uniform subsample.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.window.navigation import FlyState, looking
from viewer.window.notices import ScanNotice

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

FIELD_OF_VIEW = 60.0
"""Degrees, from the top edge to the bottom edge."""
EYE_HEIGHT = 1.6  # metres
_SAMPLE = 400_000
_TOO_COARSE = 0.12  # metres between points: from there on, what stands at eye height cannot be made out
_BLACK = 8  # of 255
_DARK = 0.22  # median level below which a scan counts as dark
_CANDIDATES = 40  # places to stand that are looked around from
_AZIMUTHS = 72
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
    """At a scanner, else at eye height where most was measured, else outside with everything in view."""
    position = _scanner(scene, seen)
    if position is None:
        position = _standing_place(seen)
    if position is None:
        return overview(seen, aspect, np.array([0.35, 0.8, -0.5]), seen.speed)
    walking = float(np.clip(seen.speed, 0.8 * seen.metre, 4.0 * seen.metre))
    return looking(position, _best_direction(seen, position), walking)


def start_camera(scene: "Scene", width: int, height: int) -> Camera:
    """The camera a visit to ``scene`` begins with, width and height in pixels."""
    state = start_state(scene, survey(scene), width / height)
    return from_fov(width, height, FIELD_OF_VIEW, state.camera_to_world)


def overview(seen: Survey, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) from as far as it takes to see everything.  aspect: width over height."""
    facing = looking(np.zeros(3), direction, speed)
    centre, half = (seen.low + seen.high) / 2, (seen.high - seen.low) / 2
    corners = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    axes = facing.camera_to_world[:3, :3]
    right, up, back = (corners @ axes).T
    tall = np.tan(np.radians(FIELD_OF_VIEW) / 2)
    distance = max((np.abs(right) / (tall * aspect) + back).max(), (np.abs(up) / tall + back).max())
    distance = max(1.04 * distance, 20 * seen.spacing)
    return looking(centre - distance * facing.forward, direction, speed)


def _scanner(scene: "Scene", seen: Survey) -> np.ndarray | None:
    """The position of the scan with most points, where the file gives one that lies in the scene."""
    scans = [s for s in scene.meta.get("scans", []) if s.get("position") is not None]
    slack = 0.25 * (seen.high - seen.low) + seen.metre
    for scan in sorted(scans, key=lambda s: -int(s.get("count") or 0)):
        position = np.asarray(scan["position"], np.float64)
        inside = (position > seen.low - slack) & (position < seen.high + slack)
        if position.shape == (3,) and inside.all():
            return position
    return None


def _standing_place(seen: Survey) -> np.ndarray | None:
    """A free place to stand, at eye height, with the most points at that height around it; None if there is none."""
    extent, metre = seen.high - seen.low, seen.metre
    if seen.spacing > _TOO_COARSE * metre or extent[2] < EYE_HEIGHT * metre or min(extent[:2]) < 2.0 * metre:
        return None
    points = seen.points[((seen.points >= seen.low - metre) & (seen.points <= seen.high + metre)).all(axis=1)]
    counts, edges = np.histogram(points[:, 2], bins=max(8, min(512, int(extent[2] / (0.1 * metre)))))
    level = counts >= 3 * np.median(counts[counts > 0])  # walls spread over all heights, a floor is at one
    level[len(level) // 2 :] = False
    floor = edges[int(np.argmax(level if level.any() else counts >= 0.3 * counts.max()))]
    eye = floor + EYE_HEIGHT * metre
    if eye > seen.high[2]:
        return None
    side = max(0.25 * metre, float(extent[:2].max()) / 160)
    shape = tuple((np.ceil(extent[:2] / side).astype(int) + 1).tolist())

    def plan(low: float, high: float) -> np.ndarray:
        rows = points[(points[:, 2] >= low) & (points[:, 2] < high), :2]
        at = np.clip(((rows - seen.low[:2]) / side).astype(int), 0, np.array(shape) - 1)
        return np.bincount(at[:, 0] * shape[1] + at[:, 1], minlength=shape[0] * shape[1]).reshape(shape)

    blocked = plan(floor + 0.5 * metre, eye + 0.3 * metre) > 0
    ground = _box_sum(plan(floor - 0.3 * metre, floor + 0.4 * metre), round(metre / side)) > 0
    around = _box_sum(plan(eye - 0.5 * metre, eye + 0.5 * metre), max(1, round(3 * metre / side))).astype(np.float64)
    for clearance in (round(0.75 * metre / side), 1, 0):
        free = (_box_sum(blocked, clearance) == 0) & ground & (around > 0)
        if free.any():
            places = np.argwhere(free & (around >= 0.5 * around[free].max()))
            places = places[:: max(1, len(places) // _CANDIDATES)]
            xy = seen.low[:2] + (places + 0.5) * side
            standing = [np.array([*place, eye]) for place in xy]
            worth = [view_worth(seen, place).max() for place in standing]
            return standing[int(np.argmax(worth))]
    return None


def view_worth(seen: Survey, position: np.ndarray) -> np.ndarray:
    """(72,) how much there is to see from ``position`` (3,) along azimuths -pi to pi: how much of the picture is
    covered, and with far things rather than near ones.  Black points hide what is behind them and are worth nothing."""
    some = slice(None, None, max(1, len(seen.points) // 50_000))
    away = seen.points[some] - position
    flat = np.hypot(away[:, 0], away[:, 1])
    slope = away[:, 2] / np.maximum(flat, 1e-9)
    use = (flat > 0.3 * seen.metre) & (np.abs(slope) < 0.6)
    rows = 24
    at = ((np.arctan2(away[use, 1], away[use, 0]) / (2 * np.pi) + 0.5) * _AZIMUTHS).astype(int) % _AZIMUTHS
    height = np.clip(((slope[use] + 0.6) / 1.2 * rows).astype(int), 0, rows - 1)
    bins = at * rows + height
    held = np.bincount(bins, minlength=_AZIMUTHS * rows)
    lit = np.bincount(bins, seen.lit[some][use], _AZIMUTHS * rows) / np.maximum(held, 1)
    nearest = np.full(_AZIMUTHS * rows, np.inf)
    np.minimum.at(nearest, bins, flat[use])
    worth = np.where(held > 0, lit * np.log1p(np.where(held > 0, nearest, 0.0) / seen.metre), 0.0)
    worth = worth.reshape(_AZIMUTHS, rows).sum(axis=1)
    spread = np.cos(np.linspace(-np.pi / 2, np.pi / 2, 17)[1:-1])  # +-35 degrees, the middle counting most
    return sum((w * np.roll(worth, k - 7) for k, w in enumerate(spread)), np.zeros(_AZIMUTHS))


def _best_direction(seen: Survey, position: np.ndarray) -> np.ndarray:
    """(3,) direction, all but level, in which there is most to see."""
    best = (int(np.argmax(view_worth(seen, position))) + 0.5) / _AZIMUTHS * 2 * np.pi - np.pi
    return np.array([np.cos(best), np.sin(best), -0.04])


def _box_sum(values: np.ndarray, radius: int) -> np.ndarray:
    """Sum over the square of ``2 * radius + 1`` cells around each cell of a 2-D array."""
    if radius <= 0:
        return values.astype(np.int64)
    total = np.pad(values.astype(np.int64), radius + 1).cumsum(axis=0).cumsum(axis=1)
    width = 2 * radius + 1
    rows, columns = values.shape
    a, b = slice(0, rows), slice(width, width + rows)
    c, d = slice(0, columns), slice(width, width + columns)
    return total[b, d] - total[a, d] - total[b, c] + total[a, c]
