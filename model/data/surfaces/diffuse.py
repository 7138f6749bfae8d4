"""Diffuse pairs: points in the colours of the true picture, as in a scan of a matt place with perfect exposures.

The colours of stations differ from a true picture by exposure and gloss even without noise.  A network whose noise input is 0
and that sees such differences learns to blur anyway.  Only the geometry is taken from the scan, as the paper does for
photographs (Vanherck et al. 2025, "Training Data Generation"), which gives pairs without noise.
"""

from dataclasses import replace

import numpy as np
import torch

from ..dataset import MergedScan, TruePicture
from .projected import Projected

RELATIVE, METRES = 0.015, 0.01
"""Difference from the true depth, as a share of it and in metres, within which a point is on the visible surface.  Chosen by
hand."""


def diffuse(seen: Projected, scan: MergedScan, view: TruePicture) -> Projected:
    """The projected points, with those on the visible surfaces in the colours of ``view`` at its full resolution.

    Points behind or in front of these surfaces keep the scan's colours.  Without depth in the view nothing changes.
    """
    depth = view.depth()
    if depth is None or not len(seen.point):
        return seen
    rows = seen.point.numpy()
    local = (scan.xyz[rows] - view.camera_to_world[:3, 3]) @ (view.camera_to_world[:3, :3] * (1.0, -1.0, -1.0))
    z = local[:, 2]
    column = np.clip((view.fl * local[:, 0] / z + view.cx).astype(np.int64), 0, view.width - 1)
    row = np.clip((view.fl * local[:, 1] / z + view.cy).astype(np.int64), 0, view.height - 1)
    on_surface = np.abs(z - depth[row, column]) <= RELATIVE * z + METRES
    rgb = np.where(on_surface[:, None], view.rgb()[row, column], seen.rgb.numpy())
    return replace(seen, rgb=torch.from_numpy(rgb))
