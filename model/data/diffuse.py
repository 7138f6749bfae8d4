"""Points in the colours of the true picture: what a scan of a matt place with perfect exposures would hold.

What stations photographed differs from a true picture by exposure and by gloss even where nothing is noisy.  A network that is
told "no noise" and shown such differences learns to blur all the same.  Taking nothing but geometry from the scan, as the
paper does for photographs (Vanherck et al. 2025, "Training Data Generation"), gives pairs that are free of noise in fact.
"""

from dataclasses import replace

import numpy as np
import torch

from model.data.dataset import Scan, TruePicture
from model.data.projected import Projected

RELATIVE, METRES = 0.015, 0.01
"""A point within so much of the true depth, relative and absolute, is on the surface that the picture shows."""


def diffuse(seen: Projected, scan: Scan, shot: TruePicture) -> Projected:
    """The projected points, those on the surfaces that ``shot`` shows in its colours, at its own resolution.

    Points behind, and hanging in front, keep the scan's colours.  Where the shot's depth is unknown nothing changes.
    """
    depth = shot.depth()
    if depth is None or not len(seen.point):
        return seen
    rows = seen.point.numpy()
    local = (scan.xyz[rows] - shot.camera_to_world[:3, 3]) @ (shot.camera_to_world[:3, :3] * (1.0, -1.0, -1.0))
    z = local[:, 2]
    column = np.clip((shot.fl * local[:, 0] / z + shot.cx).astype(np.int64), 0, shot.width - 1)
    row = np.clip((shot.fl * local[:, 1] / z + shot.cy).astype(np.int64), 0, shot.height - 1)
    on_surface = np.abs(z - depth[row, column]) <= RELATIVE * z + METRES
    rgb = np.where(on_surface[:, None], shot.rgb()[row, column], seen.rgb.numpy())
    return replace(seen, rgb=torch.from_numpy(rgb))
