"""Where in the world a scan has surfaces: a coarse lattice of blocks, against which the rays of empty pixels are tested.

The picture alone cannot distinguish a hole in a wall from the sky between two trees: both are empty pixels with measured ones
around them.  A ray that leaves the scan without passing a block with points sees background; one that passes a block in the
middle of a surface sees a hole in that surface; for one that only touches outer blocks (an outline, a wire, a twig) the picture
decides as well.  Blocks are fixed in the world, so that the answer does not depend on the picture's edges and changes little
from frame to frame.  World axes, file units, no OpenGL; the march is ``shaders/hole_march.comp``.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ....model.reference.ray_march import INNER, LOOSE
from ...grid.scene import packed, positions

if TYPE_CHECKING:
    from ...grid.scene import Scene

BLOCKS = 128
"""Blocks along the longest side at most: 2 MB of texture.  A street of 44 m has blocks of 0.35 m."""
SPACINGS = 3.5
"""Least side of a block in point spacings, so that surfaces have no gaps between blocks.  On three streets and two objects at
one point in ten, 3 left 3 % more of the true surface empty, 4 filled 2 % more of the background."""
SAMPLE = 400_000
"""Points of the sample at least, where the scan has as many; at most eight times as many."""
TRIMMED, MARGIN = 0.1, 0.25
"""Percentile at each end of the points, and share of the extent between them, beyond which points are outliers."""
THIN = 15
"""Most blocks with points among the 27 around and including one of a surface: 15 where a wall meets the ground; the crown of a
tree has more."""


@dataclass(frozen=True, eq=False)
class Occupancy:
    """codes: (X, Y, Z) uint8 (model.reference.ray_march.LOOSE, INNER).  origin: (3,) float64 file coordinates of its lowest
    corner.  side: of a block, file units.  spacing: of the scan's points, file units."""

    codes: np.ndarray
    origin: np.ndarray
    side: float
    spacing: float


def occupancy_of(scene: "Scene") -> Occupancy:
    """The lattice of a scene."""
    points = _sample(scene)
    spacing = scene.spacing * np.sqrt(scene.count / max(len(points), 1))  # of the sample
    low, high = _extent(points)
    longest = float((high - low).max())
    side = max(longest / BLOCKS, SPACINGS * float(spacing), 4 * scene.step)
    origin = low - 2 * side  # an empty layer all around: whatever is at the border has a neighbour
    shape = np.floor((high - origin) / side).astype(np.int64) + 3
    kept = points[((points >= low) & (points <= high)).all(axis=1)]
    held = np.zeros(shape, bool)
    held[tuple(((kept - origin) / side).astype(np.int64).T)] = True
    return Occupancy(codes_of(held), origin, side, scene.spacing)


def codes_of(held: np.ndarray) -> np.ndarray:
    """(X, Y, Z) uint8 of (X, Y, Z) bool, blocks that hold points.

    A block is in the middle of a surface where, in one of the three planes through it, all eight neighbours hold points or are
    one block above or below such a one; or where two such surfaces meet; and where few blocks around hold any at all.
    """
    from scipy import ndimage  # only here: a picture inside a room needs no lattice

    inner = [held & ndimage.binary_erosion(_dilated(held, axis), _plane(axis)) for axis in range(3)]
    near = [ndimage.binary_dilation(one, np.ones((3, 3, 3))) for one in inner]
    edges = held & (near[0].astype(np.int8) + near[1] + near[2] >= 2)
    codes = _distances(held)
    thin = ndimage.convolve(held.astype(np.uint8), np.ones((3, 3, 3), np.uint8), mode="constant") <= THIN
    codes[(inner[0] | inner[1] | inner[2] | edges) & thin] = INNER
    return codes


def without_gaps(occupancy: Occupancy) -> Occupancy:
    """The lattice with narrow gaps of surfaces, up to two blocks wide, counted as blocks that hold points.

    A ray that leaves through such a gap (in the shadow of a pipe, for example) then sees background only if the picture around
    it says so, too.  For a camera in a room of which a part was not scanned: from outside, openings between the parts of a
    machine would count as gaps.  In the first picture of two pieces of a plant room at one in 25 points 1.5 % of pixels were
    not opaque, and 0.5 % are; in six views of the same part of it, at 10, 4 and 2 %, no more of the true background is filled.
    """
    from scipy import ndimage

    held = (occupancy.codes == LOOSE) | (occupancy.codes == INNER)
    surface = held & ndimage.binary_dilation(occupancy.codes == INNER, np.ones((3, 3, 3)))
    closed = held.copy()
    for axis in range(3):
        thick = _dilated(surface, axis)
        closed |= ndimage.binary_closing(thick, _plane(axis)) & ~thick
    codes = _distances(closed)
    codes[occupancy.codes == INNER] = INNER
    return replace(occupancy, codes=codes)


def _distances(held: np.ndarray) -> np.ndarray:
    """(X, Y, Z) uint8: LOOSE where a block counts, else the distance to the nearest one, below INNER."""
    from scipy import ndimage

    away = np.asarray(ndimage.distance_transform_cdt(~held, "chessboard") if held.any() else np.full(held.shape, held.size))
    return np.clip(away, LOOSE, INNER - 1).astype(np.uint8)


def _plane(axis: int) -> np.ndarray:
    """3 x 3 blocks across an axis."""
    return np.ones([1 if other == axis else 3 for other in range(3)])


def _dilated(held: np.ndarray, axis: int) -> np.ndarray:
    """Blocks that hold points, and those beside them along an axis: surfaces up to 45 degrees aslant have no steps."""
    from scipy import ndimage

    return ndimage.binary_dilation(held, np.ones([3 if other == axis else 1 for other in range(3)]))


def _sample(scene: "Scene") -> np.ndarray:
    """(n, 3) float64: the coarse layers, a uniform random subsample, SAMPLE points or as many whole layers as it takes."""
    head = scene.coarse_points(SAMPLE)
    some = slice(0, head, max(1, head // SAMPLE))
    return positions(scene, packed(scene, some), some)


def _extent(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3,) each: lowest and highest corner, without outlier points."""
    if len(points) == 0:
        return np.zeros(3), np.zeros(3)
    low, high = np.percentile(points, [TRIMMED, 100 - TRIMMED], axis=0)
    slack = MARGIN * (high - low).max()
    return np.maximum(points.min(axis=0), low - slack), np.minimum(points.max(axis=0), high + slack)
