"""Points withheld from a scan: what pictures of the rest are judged by, and learned from.

No photograph is needed and nothing has to be registered: the scan is its own truth, with real texture.  A withheld point
carries its own noise, which is independent of the noise of the others: pictures can be compared by it, and a network that is
trained towards it learns the mean and not the noise (Noise2Noise, Lehtinen et al. 2018).

A withheld point counts where it is visible: it lies within the soft tolerance of the front surface of *all* points, at a pixel
that the depth filter keeps, and in no hole of a nearer surface (GAP).  A leak that the filter misses would otherwise be judged
by a point that leaks as well, and be found right.
Frame: the scan's own, lengths in its units.
"""

from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import grey_closing
from torch import Tensor

from model.data.projected import Projected
from model.depth_filter import keep_mask
from model.projection import SoftZ

HELD_OUT = 0.1
"""Share of the points that is withheld: pictures of the other nine tenths are nearly those of all, and a view of 960x720 has
thousands of points to be judged by."""

GAP, NEARER = 1.0 / 40.0, 0.03
"""A hole narrower than this share of the picture's width is closed; a point this much (of inverse depth) behind such a closed
surface is not judged.  Of the points the filter keeps, 2.4 % were leaks in four views of a scanned arcade (atrium), 0.7 % with
this, at 3 % fewer visible points; at one point in ten 6.6 and 2.0 %."""


@dataclass(frozen=True)
class Targets:
    """Withheld points that a view must show.  index: (K,) int64 pixels.  rgb: (K, 3) uint8.  point: (K,) int64 rows of the
    scan."""

    index: Tensor
    rgb: Tensor
    point: Tensor

    def some(self, most: int, seed: int) -> "Targets":
        """At most ``most`` of them, drawn at random."""
        if len(self.index) <= most:
            return self
        pick = torch.randperm(len(self.index), generator=torch.Generator().manual_seed(seed))[:most].sort().values
        return Targets(self.index[pick], self.rgb[pick], self.point[pick])


def visible(seen: Projected, soft: SoftZ) -> Tensor:
    """(M,) bool: the points at the front surface of all points ``seen``, but for black ones that are no colour (soft.unlit)."""
    width, height = seen.camera.width, seen.camera.height
    depth = torch.full((height * width,), torch.inf, dtype=seen.z.dtype).scatter_reduce_(0, seen.index, seen.z, "amin")
    kept = (keep_mask(depth.reshape(height, width)) & ~_behind_gaps(depth.reshape(height, width))).flatten()
    limit = torch.maximum(depth * (1.0 + soft.relative), depth + soft.absolute)
    front = kept[seen.index] & (seen.z <= limit[seen.index])
    return front & (seen.rgb > 0).any(1) if soft.unlit else front


def _behind_gaps(depth: Tensor) -> Tensor:
    """(H, W) bool: what lies clearly behind the surface around it once that surface's holes are closed.

    Closing inverse depth leaves planes, and the far side of a silhouette, as they are.
    """
    side = 2 * round(GAP * depth.shape[1] / 2) + 1
    inverse = np.pad(1.0 / depth.numpy(), side)
    closed = grey_closing(inverse, (side, side))[side:-side, side:-side]
    return torch.from_numpy(inverse[side:-side, side:-side] < (1.0 - NEARER) * closed)


def targets(seen: Projected, held: Tensor, soft: SoftZ) -> Targets:
    """The visible ones of the withheld points.  seen: all points of the scan.  held: (M,) bool, which are withheld."""
    shown = visible(seen, soft) & held
    return Targets(seen.index[shown], seen.rgb[shown], seen.point[shown])
