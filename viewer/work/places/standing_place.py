"""Where a person would stand in a scan, and how far back one must step to see all of it.  Window-free: the window begins here,
and benches and `evaluate` place their cameras by the same rules.

Frame: file coordinates, world up = +z, file units; ``metre`` is file units in a metre (taken as 1 where the file does not
say).  Works on a few hundred thousand points of the coarse density layers, which are a uniform subsample.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from ....model.common.process.processors import each
from .surroundings_kernel import add_surroundings

if TYPE_CHECKING:
    from ...grid.scene import Scene

EYE_HEIGHT = 1.6
"""Metres."""
FIELD_OF_VIEW = 60.0
"""Degrees, from the top edge to the bottom edge."""
STEEPEST = np.radians(89.0)
"""Pitch of a view straight up or down."""
OUTSIDE_DIRECTION = (0.35, 0.8, -0.5)
"""Direction of view for a scan that nobody can stand in."""
_SAMPLE = 400_000  # points, at most
_NEAR_SAMPLE = 50_000  # points, at most twice as many, by which places are compared
_TOO_COARSE = 0.12  # metres between points, from which on obstacles at eye height cannot be recognised
_BLACK = 8  # of 255: darker points are taken for points without colour
_CANDIDATES = 40  # places compared by what is visible from them
ENCLOSED = 0.5
"""Share of the directions near the horizon in which there must be points around a place to stand.  Measured: two rooms 0.92 and
0.99, the demo's court 0.74; a statue 0.21, a pair of pumps 0.14."""
ENCLOSURE_POWER = 2.0
"""Exponent of the enclosure in what a place to stand is worth: the far view down a street is worth less than the room.  Chosen
on the demo, whose street would win without, and checked on studio.laz, plant_room.laz and seven rendered rooms."""
AZIMUTHS, ROWS = 72, 24
"""Directions around a place that are distinguished."""
FAR_ENOUGH = 2.0
"""Distance, in medians of the distances around a place, beyond which a surface counts no more: without it the view out of a
window wins over the room.  Measured by what the small picture of the chosen view is worth (viewer.work.places.small_picture),
on demo.laz, studio.laz and plant_room.laz: half gives 0.83, 0.88 and 0.99 of it, twice 0.70, 1.00 and 1.00."""
DETAIL_WORTH = 1.0
"""Worth of a direction full of detail on top of 1 for a bare surface: without it a view of an empty wall may win.  Measured in
the same way, half gives 0.95, 1.02 and 1.00, twice 1.00 in each."""
LEVEL_EDGE = 0.15
"""Difference in brightness (0 to 1) of neighbouring directions that counts as full detail.  Half gives 0.95, 1.00 and 1.00,
twice 0.88, 1.02 and 1.01."""
DEPTH_EDGE = 0.3
"""Difference of the logarithm of distance that counts as full detail.  Half gives 1.01, 1.02 and 0.99, twice 1.00, 0.89 and
1.00."""
BODY = (-1.2, 0.1)
"""Metres from the eye: heights between which points are in a person's way."""
WAY = 2
"""Azimuths to either side of a direction in which nothing may be in the way: with AZIMUTHS, 12 degrees each."""
TOO_NEAR = 0.3
"""Metres: points nearer to the place, horizontally, are left out: those of a tripod at the scanner.  Half and twice choose the
same views of the same three scans and of street_corner.laz."""
STEEPEST_SLOPE = 0.6
"""Slope, 31 degrees, of the directions around a place that are looked at; those of a picture."""


class Sampled(Protocol):
    """A dataclass.  points: (n, 3) float64.  level: (n,) float32 brightness, 0 to 1, 0 for black points, which have no colour.
    low, high: (3,) float64, the range of 98 % of the points along each axis.  spacing: of the scan's points.  metre: file units
    in a metre."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def points(self) -> np.ndarray: ...
    @property
    def level(self) -> np.ndarray: ...
    @property
    def low(self) -> np.ndarray: ...
    @property
    def high(self) -> np.ndarray: ...
    @property
    def spacing(self) -> float: ...
    @property
    def metre(self) -> float: ...


@dataclass(frozen=True, eq=False)
class SceneSample:
    """A :class:`Sampled` that :func:`sample_scene` makes.  diagonal: of the range, file units, above 0.  brightness: median
    level of the points that are not black, 0 to 1."""

    points: np.ndarray
    level: np.ndarray
    low: np.ndarray
    high: np.ndarray
    spacing: float
    metre: float
    diagonal: float
    brightness: float


def sample_scene(scene: "Scene") -> SceneSample:
    """The coarse layers of a scene and what follows from them."""
    from ...grid.scene import unpack

    points, rgb, _, _ = unpack(scene, slice(0, scene.coarse_points_within(_SAMPLE)))
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    metres = scene.meta.metres_per_unit
    diagonal = max(float(np.linalg.norm(high - low)), 10 * scene.step)
    spacing = min(max(float(scene.spacing), scene.step), diagonal)
    brightest = rgb.max(axis=1)
    level = np.where(brightest > _BLACK, brightest, 0).astype(np.float32) / 255
    brightness = float(np.median(level[level > 0])) if level.any() else 0.0
    return SceneSample(points, level, low, high, spacing, 1.0 / metres if metres else 1.0, diagonal, brightness)


def view_axes(direction: np.ndarray) -> np.ndarray:
    """(3, 3) float64, columns right, up and back (OpenGL camera axes) of a view along ``direction`` (3,), not zero.

    The horizon is level; a direction steeper than STEEPEST is lowered to that.
    """
    x, y, z = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    pitch = float(np.clip(np.arcsin(z), -STEEPEST, STEEPEST))
    yaw = float(np.arctan2(y, x))
    back = -np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    return np.stack([right, np.cross(back, right), back], axis=1)


def overview_position(seen: Sampled, aspect: float, direction: np.ndarray) -> np.ndarray:
    """(3,) position from which everything is in view along ``direction`` (3,).  aspect: width over height of the picture."""
    axes = view_axes(direction)
    centre, half = (seen.low + seen.high) / 2, (seen.high - seen.low) / 2
    corners = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    right, up, back = (corners @ axes).T
    tall = np.tan(np.radians(FIELD_OF_VIEW) / 2)
    distance = max((np.abs(right) / (tall * aspect) + back).max(), (np.abs(up) / tall + back).max())
    distance = max(1.04 * distance, 20 * seen.spacing)
    return centre + distance * axes[:, 2]


def scanner_positions(scene: "Scene", seen: Sampled) -> np.ndarray:
    """(s, 3) positions of scanners that lie in the scene, where the file gives them, that with most points first."""
    scans = [scan for scan in scene.meta.scans if scan.position is not None]
    slack = 0.25 * (seen.high - seen.low) + seen.metre
    found = []
    for scan in sorted(scans, key=lambda scan: -scan.count):
        position = np.asarray(scan.position, np.float64)
        inside = (position > seen.low - slack) & (position < seen.high + slack)
        if inside.all():
            found.append(position)
    return np.array(found).reshape(-1, 3)


def standing_place(seen: Sampled) -> np.ndarray | None:
    """(3,) a free place at eye height with the most points at that height around it; None if there is none."""
    extent, metre = seen.high - seen.low, seen.metre
    if seen.spacing > _TOO_COARSE * metre or extent[2] < EYE_HEIGHT * metre or min(extent[:2]) < 2.0 * metre:
        return None
    points = seen.points[((seen.points >= seen.low - metre) & (seen.points <= seen.high + metre)).all(axis=1)]
    counts, edges = np.histogram(points[:, 2], bins=max(8, min(512, int(extent[2] / (0.1 * metre)))))
    level = counts >= 3 * np.median(counts[counts > 0])  # a floor has one height, walls have all
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
            worth = each(lambda place: place_worth(seen, place).max(), standing)
            return standing[int(np.argmax(worth))]
    return None


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What is around a place, by direction (AZIMUTHS from -pi to pi, ROWS of height), each (AZIMUTHS, ROWS) float64.

    nearest: horizontal distance of the nearest point, 0 where there is none.  lit: share of points that are not black.
    level: mean brightness, 0 to 1.  free: (AZIMUTHS,) distance that one can walk in a direction, inf where nothing is in the
    way.
    """

    nearest: np.ndarray
    lit: np.ndarray
    level: np.ndarray
    free: np.ndarray

    @property
    def enclosure(self) -> float:
        """Share of the directions in which there are points."""
        return float((self.nearest > 0).mean())


def surroundings(seen: Sampled, position: np.ndarray) -> Surroundings:
    """What lies within 31 degrees of the horizon around ``position`` (3,)."""
    bins = AZIMUTHS * ROWS
    nearest, held, lit, light = np.full(bins, np.inf), np.zeros(bins), np.zeros(bins), np.zeros(bins)
    obstacles = np.full(AZIMUTHS, np.inf)
    add_surroundings(
        seen.points, seen.level, max(1, len(seen.points) // _NEAR_SAMPLE), np.asarray(position, np.float64), ROWS,
        STEEPEST_SLOPE, TOO_NEAR * seen.metre, BODY[0] * seen.metre, BODY[1] * seen.metre,
        nearest, held, lit, light, obstacles,
    )  # fmt: skip
    free = np.min([np.roll(obstacles, k) for k in range(-WAY, WAY + 1)], axis=0)
    nearest[np.isinf(nearest)] = 0.0
    points = np.maximum(held, 1)
    nearest, lit, mean = (plane.reshape(AZIMUTHS, ROWS) for plane in (nearest, lit / points, light / points))
    return Surroundings(nearest, lit, mean, free)


def enclosure(seen: Sampled, position: np.ndarray) -> float:
    """Share of the directions within 31 degrees of the horizon, around ``position`` (3,), in which there are points."""
    return surroundings(seen, position).enclosure


def detail(near: Surroundings) -> np.ndarray:
    """(AZIMUTHS, ROWS) 0 to 1: how much brightness or distance differ between neighbouring directions that both hold points."""
    held, depth = near.nearest > 0, np.log(np.where(near.nearest > 0, near.nearest, 1.0))
    edges = np.zeros((AZIMUTHS, ROWS))
    for axis in (0, 1):
        both = held & np.roll(held, -1, axis)
        change = np.maximum(np.abs(np.roll(near.level, -1, axis) - near.level) / LEVEL_EDGE,
                            np.abs(np.roll(depth, -1, axis) - depth) / DEPTH_EDGE)
        edges = np.maximum(edges, np.where(both, np.minimum(change, 1.0), 0.0))
    edges[:, -1] = 0.0  # its neighbour above is the lowest row
    return edges


def view_worth(near: Surroundings, metre: float) -> np.ndarray:
    """(AZIMUTHS,) how much is visible from a place along azimuths from -pi to pi: the covered share of the picture,
    where distant surfaces count more than near ones, up to FAR_ENOUGH, and detail more than bare walls.  Black points occlude
    and count nothing.  A direction in which the way is blocked earlier than in most counts less, so that the window at which
    one stands does not win over the room."""
    held = near.nearest > 0
    far = FAR_ENOUGH * float(np.median(near.nearest[held])) if held.any() else 1.0
    worth = near.lit * np.log1p(np.minimum(near.nearest, far) / metre) * (1.0 + DETAIL_WORTH * detail(near))
    worth = np.where(held, worth, 0.0).sum(axis=1)
    spread = np.cos(np.linspace(-np.pi / 2, np.pi / 2, 17)[1:-1])  # +-35 degrees, the middle counting most
    seen_there = sum((w * np.roll(worth, k - 7) for k, w in enumerate(spread)), np.zeros(AZIMUTHS))
    return seen_there * way_ahead(near, metre)


def way_ahead(near: Surroundings, metre: float) -> np.ndarray:
    """(AZIMUTHS,) 0 to 1: distance that one can walk along azimuths from -pi to pi, relative to the usual one there."""
    usual = float(np.median(near.free))  # inf in the open
    if not np.isfinite(usual):
        usual = 2.0 * float(np.max(near.free, where=np.isfinite(near.free), initial=metre))
    return np.minimum(near.free / usual, 1.0)


def place_worth(seen: Sampled, position: np.ndarray) -> np.ndarray:
    """(AZIMUTHS,) by which places to stand are compared: what is visible from ``position`` (3,), less where it is open."""
    near = surroundings(seen, position)
    return view_worth(near, seen.metre) * near.enclosure**ENCLOSURE_POWER


def viewpoint_worth(seen: Sampled, position: np.ndarray, direction: np.ndarray) -> float:
    """The :func:`place_worth` of a view along ``direction`` (3,) from ``position`` (3,); upright world."""
    return float(place_worth(seen, position)[azimuth_of(direction)])


def azimuth_of(direction: np.ndarray) -> int:
    """Number, below AZIMUTHS, of the azimuth of ``direction`` (3,)."""
    return int((np.arctan2(direction[1], direction[0]) / (2 * np.pi) + 0.5) * AZIMUTHS) % AZIMUTHS


def best_direction(seen: Sampled, position: np.ndarray) -> np.ndarray:
    """(3,) the nearly level direction in which most is visible from ``position`` (3,)."""
    best = (int(np.argmax(place_worth(seen, position))) + 0.5) / AZIMUTHS * 2 * np.pi - np.pi
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
