"""The volume of what was measured in a box, from Python."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from ..picture.clip import box_around
from .arguments import python_names, vector_of
from .compare_scans import cloud_of

if TYPE_CHECKING:
    from ..work.measuring.volume import Volume
    from .open_scan import Scan


def volume_in_box(scan: Scan | npt.ArrayLike, box: npt.ArrayLike, *, up: npt.ArrayLike = (0.0, 0.0, 1.0)) -> Volume:
    """What lies between the lowest face of a box and the surface that is measured in it, such as a heap on the ground.

    scan: an open scan, or (N, 3) coordinates.  box: (2, 3) its lowest and highest corner, in their unit.  up: direction that is
    up; heights are measured along the axis nearest to it.

    Returns a Volume: ``cut`` and its ``uncertainty``, 95 %, in cubed units; ``empty``: share of the area without points, which
    was interpolated; ``layered``: share with walls or two surfaces.  What hangs over the ground is left out.

    Raises InputError where the box is none, or too few points lie in it.

    >>> import numpy as np, pointglass
    >>> rng = np.random.default_rng(1)
    >>> ground = np.c_[rng.uniform(0, 4, (40_000, 2)), rng.normal(0, 0.002, 40_000)]
    >>> ground[(np.abs(ground[:, :2] - 2) < 0.5).all(axis=1), 2] += 0.3
    >>> found = pointglass.volume_in_box(ground, [(1, 1, 0), (3, 3, 1)])
    >>> abs(found.cut - 0.3) < found.uncertainty < 0.05
    True
    """
    from ..work.comparing.cloud_scale import scale_of
    from ..work.fits.measured import in_cloud
    from ..work.measuring.height_grid import MOST
    from ..work.measuring.height_grid import volume_in_box as measured

    with python_names():
        axis = vector_of("up", up)
        try:
            corners = np.asarray(box, np.float64)
        except (TypeError, ValueError):
            corners = np.empty(0)
        if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (corners[1] > corners[0]).all():
            raise InputError("expected [[xmin, ymin, zmin], [xmax, ymax, zmax]], each maximum above its minimum", option="box",
                             value=box)
        if not axis.any():
            raise InputError("expected a direction that is not zero", option="up", value=up)
        cloud = cloud_of("scan", scan)[0]
        cloud = cloud[np.isfinite(cloud).all(axis=1)]
        if len(cloud) < 30:
            raise InputError("has too few points for a volume", option="scan")
        spacing = scale_of(cloud - cloud.min(axis=0)).spacing
        found, _ = measured(in_cloud(cloud, corners[0], MOST), box_around(*(corners - corners[0])), spacing,
                            axis / np.linalg.norm(axis))
    return replace(found, place=tuple((corners[0] + found.place).tolist()))
