"""A photograph against the points: its shadow map, its exposure, whether its pose fits, and a search for a better one.

The shadow map holds the distance of the nearest surface over the whole photograph: the nearest points, those behind a sparse
surface removed by the depth filter, and holes closed.  Everything is float32 relative to the sample's origin, file units.
"""

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ....model.reference.filter_constants import LEVELS
from ....model.reference.photo_colours import HIDDEN
from ...preprocess.closed_depth import filled_depth
from ...readers.e57.e57_photographs import KINDS
from ..passes.filter_cpu import filter_picture, filter_pyramid
from .photo_pool import mip_levels
from .shadow_kernels import nearest_points, photograph_colours, seen_points

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...readers.photographs.posed_photograph import PosedPhotograph

SAMPLE = 4_000_000
"""Points at most from which shadow maps are made: whole density layers, an even sample."""
MAP_PIXELS = 3
"""Pixels of a photograph along a pixel of its shadow map, at the most points; and MAP_LONGEST at most along a side."""
MAP_LONGEST = 1024
NEIGHBOURS = 0.5
"""A choice: the depth filter recognises a surface of which half of the pixels are hit."""
COMPARED = 60_000
"""Points at most whose colours are compared with a photograph's."""
CLIPPED = 8
"""Levels from black and white within which colours are not compared: they may be clipped."""
DIFFERENT = 40.0
"""Difference, sRGB levels, from which on a point counts as another colour, however large it is."""
EXPLAINED, ALIKE = 0.3, 12.0
"""A photograph fits that explains this share of the differences between points, or differs from them by so few levels: a white
wall explains nothing."""
SEARCH_STEP, SEARCH_STEPS = 0.006, 2
"""Radians between the rotations about each axis from which a better pose is searched, and how many to either side: 5 pixels of
a lens of 415."""
STARTS = 3
"""Rotations of these, the best ones, from which it is searched.  Of ten poses 5 pixels off in kitchen and living-room-2, at one
point in ten, a single start left errors of 1.6 and 2.9 pixels in two, three starts 0.4; three of plain walls are not found."""
WORTH_TURNING = 0.98
"""Share of the mean difference at the stated pose from which on a pose stays as stated.  Judged on every second photograph
of atrium, kitchen and living-room-2, one point in ten and all, exact and 0.5 to 5 pixels off, by the unexplained share: limits
from 0.97 to 1 leave the same errors to 0.05 pixels on average; with 0.9 three more of 54 poses two pixels off stay so.  Exact
poses are turned by 0.64 pixels at most, on average by 0.03."""
LEAST_TURN = 0.5
"""Pixels below which a pose stays as stated: exact ones are turned by 0.3 where points are few."""


@dataclass(frozen=True, eq=False)
class PointSample:
    """points: (n, 3) float32, relative to origin (3,).  rgb: (n, 3) uint8 as drawn."""

    points: np.ndarray
    rgb: np.ndarray
    origin: np.ndarray


def point_sample(scene: "Scene") -> PointSample:
    """The coarse density layers of a scene, SAMPLE points at most where its first layer has no more."""
    from ...grid.scene import unpack

    stop = scene.coarse_points_within(SAMPLE)
    origin = scene.bounds.mean(axis=0)
    points, colours = np.empty((stop, 3), np.float32), np.empty((stop, 3), np.uint8)
    for begin in range(0, stop, 1 << 20):
        part = slice(begin, min(begin + (1 << 20), stop))
        xyz, rgb, _, _ = unpack(scene, part)
        points[part], colours[part] = xyz - origin, rgb
    return PointSample(points, colours, origin)


@dataclass(frozen=True, eq=False)
class PhotoFit:
    """camera_to_world: (4, 4), the pose that is used.  nearest: the shadow map.  gains: (3,).  explained: share of the points'
    differences.  difference: median, sRGB levels.  refined: degrees by which the pose was turned."""

    camera_to_world: np.ndarray
    nearest: np.ndarray
    gains: np.ndarray
    explained: float
    difference: float
    refined: float = 0.0

    @property
    def fits(self) -> bool:
        """Whether the colours of the photograph are those of the points."""
        return self.explained >= EXPLAINED or self.difference <= ALIKE


def fitted(photo: "PosedPhotograph", picture: np.ndarray, valid: np.ndarray | None, sample: PointSample) -> PhotoFit | None:
    """How a photograph fits the points, at its pose or the better one nearby; None where it sees no points."""
    levels = mip_levels(picture, valid)
    first = _at(photo, photo.camera_to_world, levels, sample)
    if first is None:
        return None
    best, rotation = _search(photo, levels, sample, first)
    if best is None:
        return first
    pose = photo.camera_to_world.copy()
    pose[:3, :3] = pose[:3, :3] @ rotation
    turned = _at(photo, pose, levels, sample)
    if turned is None or turned.explained <= first.explained:
        return first
    return replace(turned, refined=best)


def as_stated(photo: "PosedPhotograph", picture: np.ndarray, sample: PointSample) -> PhotoFit | None:
    """How a photograph fits the points at its stated pose; None where it sees none.  picture: decoded."""
    return _at(photo, photo.camera_to_world, mip_levels(picture, None), sample)


def unfitted(photo: "PosedPhotograph", size: tuple[int, int], sample: PointSample) -> PhotoFit:
    """The stated pose with its shadow map, in its own colours, of a photograph that fits no points.

    size: (height, width) of the decoded picture."""
    nearest = shadow_map(_placed(photo, photo.camera_to_world, sample), size, sample.points)
    if nearest is None:
        nearest = np.full((1, 1), np.inf, np.float32)
    return PhotoFit(photo.camera_to_world, nearest, np.ones(3), 0.0, 0.0)


def _placed(photo: "PosedPhotograph", pose: np.ndarray, sample: PointSample) -> tuple:
    """The arguments of the loops behind the points."""
    turn = np.ascontiguousarray(pose[:3, :3].T)
    shift = turn @ (sample.origin - pose[:3, 3])
    return (turn.astype(np.float32), shift.astype(np.float32), KINDS.index(photo.kind), np.array(photo.lens), photo.around,
            float(photo.width), float(photo.height))  # fmt: skip


def _at(photo: "PosedPhotograph", pose: np.ndarray, levels: list[np.ndarray], sample: PointSample) -> PhotoFit | None:
    placed = _placed(photo, pose, sample)
    nearest = shadow_map(placed, levels[0].shape[:2], sample.points)
    if nearest is None:
        return None
    seen = np.empty(len(sample.points), bool)
    seen_points(sample.points, nearest, 1.0 + HIDDEN, seen, *placed)
    chosen = np.flatnonzero(seen)
    chosen = chosen[:: max(1, len(chosen) // COMPARED)]
    points, own = sample.points[chosen], sample.rgb[chosen].astype(np.float32)
    colours = np.empty((len(points), 3), np.float32)
    photograph_colours(points, levels[0], colours, *placed)
    use = (np.minimum(own, colours) > CLIPPED).all(1) & (np.maximum(own, colours) < 255 - CLIPPED).all(1)
    if use.sum() < 100:
        return PhotoFit(pose, nearest, np.ones(3), 0.0, 0.0)  # nothing to compare: all black or white
    own, colours = own[use], colours[use]
    gains = np.median(own / colours, axis=0)
    apart = np.abs(own - colours * gains).mean(1)
    shuffled = np.abs(own[np.random.default_rng(0).permutation(len(own))] - colours * gains).mean(1)
    between = np.minimum(shuffled, DIFFERENT).mean()
    explained = 1.0 - np.minimum(apart, DIFFERENT).mean() / max(between, 1e-6)
    return PhotoFit(pose, nearest, gains, float(explained), float(np.median(apart)))


def shadow_map(placed: tuple, size: tuple[int, int], points: np.ndarray) -> np.ndarray | None:
    """(m, n) float32 over the whole photograph: the least distance of the closed map around each of its pixels; None without
    points.

    size: (height, width) of the decoded picture.  It is as fine as the points allow: beside a pixel that holds a point there is
    another one with a probability of NEIGHBOURS."""
    share = max(MAP_PIXELS, max(size) / MAP_LONGEST)
    while True:
        rows, columns = (max(2, int(side / share)) for side in size)
        raw = np.full((rows, columns), np.inf, np.float32)
        nearest_points(points, raw, *placed)
        hit = np.isfinite(raw)
        if not hit.any():
            return None
        beside = (hit[:, 1:] & hit[:, :-1]).sum() / max(hit[:, 1:].sum(), 1)
        if beside >= NEIGHBOURS or min(rows, columns) < 64:
            break
        share *= 2**0.5
    closed = filled_depth(np.where(_front(raw), raw, np.float32(np.inf)))
    padded = np.pad(closed, 1, mode="edge")
    across = np.minimum(np.minimum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    return np.minimum(np.minimum(across[:-2], across[1:-1]), across[2:])


def _front(depth: np.ndarray) -> np.ndarray:
    """(m, n) bool: kept by the depth filter; on this thread alone."""
    height, width = depth.shape
    kept, shown = np.empty(height * width, np.uint8), np.empty(height * width, np.uint32)
    opaque = np.full(height * width, 0xFF000000, np.uint32)
    filter_picture(filter_pyramid((width, height), LEVELS["auto"]), depth.ravel(), opaque, kept, shown, least=height)
    return kept.reshape(height, width) > 0


def _search(photo: "PosedPhotograph", levels: list[np.ndarray], sample: PointSample, first: PhotoFit
            ) -> tuple[float | None, np.ndarray]:
    """Degrees and rotation (3, 3) by which the photograph fits the points better: coordinate descent from coarse to fine on the
    mean difference, each above DIFFERENT counted as that, from the best of a grid of rotations.  None where the stated pose is
    the best."""
    from scipy.spatial.transform import Rotation

    placed = _placed(photo, first.camera_to_world, sample)
    seen = np.empty(len(sample.points), bool)
    seen_points(sample.points, first.nearest, 1.0 + HIDDEN, seen, *placed)
    chosen = np.flatnonzero(seen)
    chosen = chosen[:: max(1, len(chosen) // (COMPARED // 3))]
    points, own = sample.points[chosen], sample.rgb[chosen].astype(np.float32)
    colours = np.empty((len(points), 3), np.float32)
    gains = first.gains.astype(np.float32)

    def cost(vector: np.ndarray, level: np.ndarray) -> float:
        turn = Rotation.from_rotvec(vector).as_matrix().T
        turned = (turn @ placed[0]).astype(np.float32), (turn @ placed[1]).astype(np.float32)
        photograph_colours(points, level, colours, *turned, *placed[2:])
        apart = np.minimum(np.abs(own - colours * gains).mean(1), np.float32(DIFFERENT))
        return float(np.where(colours[:, 0] < 0, np.float32(DIFFERENT), apart).mean())

    pixel = 1.0 / max(photo.lens[0], 1e-6)

    def level_of(step: float) -> np.ndarray:
        return levels[min(max(int(np.log2(max(step / pixel, 1.0))), 0), len(levels) - 1)]

    def descended(best: np.ndarray, step: float) -> np.ndarray:
        while step >= 0.25 * pixel:
            level = level_of(step)
            now = cost(best, level)
            for _ in range(8):
                tries = [best + sign * step * axis for axis in np.eye(3) for sign in (-1, 1)]
                costs = [cost(one, level) for one in tries]
                if min(costs) >= now:
                    break
                now, best = min(costs), tries[int(np.argmin(costs))]
            step /= 2
        return best

    reach = SEARCH_STEP * np.arange(-SEARCH_STEPS, SEARCH_STEPS + 1)
    coarse = level_of(SEARCH_STEP)
    grid = sorted((np.array(one) for one in itertools.product(reach, repeat=3)), key=lambda one: cost(one, coarse))
    found = [descended(start, SEARCH_STEP / 2) for start in grid[:STARTS]]
    best = min(found, key=lambda one: cost(one, levels[0]))
    if np.linalg.norm(best) < LEAST_TURN * pixel or cost(best, levels[0]) > WORTH_TURNING * cost(np.zeros(3), levels[0]):
        return None, np.eye(3)
    return float(np.degrees(np.linalg.norm(best))), Rotation.from_rotvec(best).as_matrix()
