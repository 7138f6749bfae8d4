"""Withheld points of a scan, used to evaluate and train on pictures of the remaining points.

This needs no photographs and no registration: the scan is its own ground truth, with real texture.  The noise of a withheld
point is independent of the noise of the others, so pictures can be compared at withheld points, and a network trained towards
them learns the mean and not the noise (Noise2Noise, Lehtinen et al. 2018).

A withheld point is used where it is visible: it lies within the soft tolerance of the front surface of *all* points, at a pixel
that the depth filter keeps, and not in a hole of a nearer surface (GAP).  Otherwise, where hidden points leak through the
filter, the withheld points leak as well, and the error would go unnoticed.
Frame: the scan's own, lengths in its units.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import grey_closing
from torch import Tensor

from ..reference.depth_filter import keep_mask
from ..reference.projection import SoftZ
from .surfaces.projected import Projected

HELD_OUT = 0.1
"""Share of the points that is withheld.  Pictures of the other nine tenths are nearly those of all points, and a view of
960x720 has thousands of withheld points."""

GAP, NEARER = 1.0 / 40.0, 0.03
"""Holes narrower than the share GAP of the picture's width are closed, and points behind such a closed surface by more than the
share NEARER of inverse depth are not used.  In four views of a scanned arcade (atrium), 2.4 % of the points that the filter
keeps were leaks, 0.7 % with this test, which removes 3 % of the visible points; at one point in ten 6.6 and 2.0 %."""


@dataclass(frozen=True)
class Targets:
    """Visible withheld points of a view.  index: (K,) int64 pixels.  rgb: (K, 3) uint8.  point: (K,) int64 rows of the scan."""

    index: Tensor
    rgb: Tensor
    point: Tensor

    def some(self, most: int, seed: int) -> "Targets":
        """A random sample of at most ``most`` of them."""
        if len(self.index) <= most:
            return self
        pick = torch.randperm(len(self.index), generator=torch.Generator().manual_seed(seed))[:most].sort().values
        return Targets(self.index[pick], self.rgb[pick], self.point[pick])


def visible(seen: Projected, soft: SoftZ) -> Tensor:
    """(M,) bool: points on the front surface of all points ``seen``, without black ones where black is no colour
    (soft.unlit)."""
    width, height = seen.camera.width, seen.camera.height
    depth = torch.full((height * width,), torch.inf, dtype=seen.z.dtype).scatter_reduce_(0, seen.index, seen.z, "amin")
    kept = (keep_mask(depth.reshape(height, width)) & ~_behind_gaps(depth.reshape(height, width))).flatten()
    limit = torch.maximum(depth * (1.0 + soft.relative), depth + soft.absolute)
    front = kept[seen.index] & (seen.z <= limit[seen.index])
    return front & (seen.rgb > 0).any(1) if soft.unlit else front


def _behind_gaps(depth: Tensor) -> Tensor:
    """(H, W) bool: pixels clearly behind the surface around them after that surface's holes are closed.

    A morphological closing of inverse depth preserves planes and the far side of a silhouette.
    """
    side = 2 * round(GAP * depth.shape[1] / 2) + 1
    inverse = np.pad(1.0 / depth.numpy(), side)
    closed = grey_closing(inverse, (side, side))[side:-side, side:-side]
    return torch.from_numpy(inverse[side:-side, side:-side] < (1.0 - NEARER) * closed)


def targets(seen: Projected, held: Tensor, soft: SoftZ) -> Targets:
    """The visible withheld points.  seen: all points of the scan.  held: (M,) bool, True for withheld points."""
    shown = visible(seen, soft) & held
    return Targets(seen.index[shown], seen.rgb[shown], seen.point[shown])
