"""A picture of a few thousand pixels of a sample of the points, and how good the full picture of that camera would be.

Sparse places are where a choice by distances fails: a wall at arm's length surrounds the eye, but its points lie tens of pixels
apart, and between them the rooms behind it are seen.  Here each point of the sample is a square as wide as the sample is sparse
around it, so that a wall stays a wall, and the spacing of the scan itself, relative to the picture's height, is known at each
pixel.

Frame: the upright world, +z up, file units; ``metre`` is file units in a metre.  No OpenGL.
"""

from dataclasses import dataclass, replace

import numpy as np

from .small_picture_kernel import add_up, draw_squares
from .standing_place import FIELD_OF_VIEW, view_axes

HEIGHT = 36
"""Rows of a small picture: its pixels are 1.7 degrees high, narrower than a door 30 m away is wide."""
_LEVELS = 6
"""Widths of squares: 1 to 32 pixels, which is nearly the picture."""
_WITHIN = 1.08
"""Depth, relative to the nearest square of a pixel, up to which points are of the surface seen there.  1.04 and 1.16 choose the
same start views of demo.laz, studio.laz, plant_room.laz and street_corner.laz, and of a fiftieth of studio and plant room."""
_VOXEL = 4.0
"""Side, in spacings of the sample, of the cubes in which points are counted for their local spacing."""
COARSE_GAP = 0.015
"""Share of the picture's height between neighbouring points at which a surface counts half: 7 pixels of 480.  In pictures of
five scans at 100, 10 and 2 %, surfaces below a third of it are sharp, and those above three times as much are seen as single
dots.  Half and twice choose the same start views of the scans named at _WITHIN; twice lets one into a fiftieth of
street_corner.laz."""
FAR = 12.0
"""Metres beyond which a surface counts no more."""
FAR_ENOUGH = 2.0
"""The same in medians of the depths of the picture: without it the view out of a window wins over the room."""
_LEVEL_EDGE, _DEPTH_EDGE = 0.15, 0.3
"""Difference of brightness (0 to 1), and of the logarithm of depth, of neighbouring pixels that counts as full detail."""
TOO_NEAR = 0.6
"""Metres: a surface nearer than that is in the way: it fills the picture's height with 0.7 m of a wall (FIELD_OF_VIEW).  Half
and twice choose the same start views of the scans named at _WITHIN."""


@dataclass(frozen=True, eq=False)
class PictureSample:
    """Points of a scan for small pictures.

    points: (n, 3) float32, relative to ``origin`` (3,) float64.  spacing: (n,) float32, file units, of the sample around each
    point.  level: (n,) float32 brightness, 0 to 1, 0 for black.  thinned: spacing of the scan over that of the sample, at most
    1.  metre: file units in a metre.
    """

    points: np.ndarray
    spacing: np.ndarray
    level: np.ndarray
    origin: np.ndarray
    thinned: float
    metre: float

    def thin(self, most: int) -> "PictureSample":
        """A sample of at most ``most`` of its points."""
        step = max(1, -(-len(self.points) // most))
        if step == 1:
            return self
        wider = np.sqrt(np.float32(step))
        return replace(self, points=np.ascontiguousarray(self.points[::step]), spacing=self.spacing[::step] * wider,
                       level=np.ascontiguousarray(self.level[::step]), thinned=self.thinned / float(wider))


@dataclass(frozen=True)
class PictureScore:
    """worth: by which pictures are compared, 0 to 2.  sharp: share of the picture with surfaces, those with coarse points
    counting less.  covered: share of the picture with surfaces.  near: share of it with surfaces that are in the way."""

    worth: float
    sharp: float
    covered: float
    near: float


def picture_sample(points: np.ndarray, level: np.ndarray, share: float, spacing: float, metre: float) -> PictureSample:
    """points: (n, 3) float64, a uniform subsample with this ``share`` of the scan's points.  level: (n,).  spacing: of the
    scan's points, the median."""
    origin = points.mean(axis=0) if len(points) else np.zeros(3)
    near = (points - origin).astype(np.float32)
    thinned = float(np.sqrt(min(max(share, 1e-12), 1.0)))
    return PictureSample(near, local_spacing(near, spacing / thinned), np.asarray(level, np.float32), origin, thinned, metre)


def local_spacing(points: np.ndarray, spacing: float) -> np.ndarray:
    """(n,) float32: distance between the points (n, 3) around each, from their number in cubes.  spacing: the median."""
    if len(points) == 0:
        return np.zeros(0, np.float32)
    low = points.min(axis=0)
    side = max(_VOXEL * spacing, float(np.ptp(points, axis=0).max()) / (1 << 20), 1e-12)
    cells = ((points - low) / side).astype(np.int64)
    key = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
    _, of_point, count = np.unique(key, return_inverse=True, return_counts=True)
    return (side / np.sqrt(count)).astype(np.float32)[of_point]


def score(sample: PictureSample, eye: np.ndarray, direction: np.ndarray, aspect: float) -> PictureScore:
    """The score of the picture from ``eye`` (3,) along ``direction`` (3,).  aspect: width over height."""
    width, focal = max(round(HEIGHT * aspect), 1), HEIGHT / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)
    depth, gap, held, lit, light = np.zeros((5, HEIGHT, width), np.float32)
    draw_squares(
        sample.points, sample.spacing, sample.level, np.asarray(eye, np.float64) - sample.origin, view_axes(direction), width,
        HEIGHT, focal, _LEVELS, _WITHIN, depth, gap, held, lit, light,
    )  # fmt: skip
    covered = np.isfinite(depth)
    if not covered.any():
        return PictureScore(0.0, 0.0, 0.0, 0.0)
    far = min(FAR_ENOUGH * float(np.median(depth[covered])), FAR * sample.metre)
    coarse = COARSE_GAP * HEIGHT / (focal * sample.thinned)  # of the sample, relative to depth
    worth, *shares = add_up(depth, gap, held, lit, light, coarse, TOO_NEAR * sample.metre, far, sample.metre, _LEVEL_EDGE,
                            _DEPTH_EDGE)
    sharp, shown, near = (share / depth.size for share in shares)
    return PictureScore(worth / depth.size / float(np.log1p(FAR)), sharp, shown, near)
