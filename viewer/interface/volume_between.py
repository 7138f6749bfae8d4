"""The volume between the surfaces of two scans, from Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from .arguments import python_names, vector_of
from .compare_scans import cloud_of

if TYPE_CHECKING:
    from ..work.measuring.volume import Volume
    from .open_scan import Scan


def volume_between(
    before: Scan | npt.ArrayLike,
    after: Scan | npt.ArrayLike,
    corners: npt.ArrayLike,
    *,
    up: npt.ArrayLike = (0.0, 0.0, 1.0),
    registration: float = 0.0,
) -> Volume:
    """What was taken away (``cut``) and added (``fill``) between two scans inside a polygon seen along the up axis.

    before, after: open scans, or (N, 3) and (M, 3) coordinates; both in one frame and unit.
    corners: (K, 3) of the polygon, in order around it, near the surfaces.  up: direction that is up.
    registration: uncertainty (95 %) of the height of both to each other, in their unit.

    Returns a Volume: ``cut``, ``fill``, ``cut_uncertainty``, ``fill_uncertainty``, and ``net`` (cut less fill) with its
    ``uncertainty``, 95 %, in cubed units; ``empty``: share of the area that a scan did not see, which was interpolated.

    Raises InputError where units or reference systems differ, the corners enclose nothing, or there are too few points.

    >>> import numpy as np, pointglass
    >>> rng = np.random.default_rng(1)
    >>> ground, later = (np.c_[rng.uniform(0, 4, (40_000, 2)), rng.normal(0, 0.002, 40_000)] for _ in range(2))
    >>> later[(np.abs(later[:, :2] - 2) < 0.5).all(axis=1), 2] += 0.3
    >>> found = pointglass.volume_between(ground, later, [(1, 1, 0), (3, 1, 0), (3, 3, 0), (1, 3, 0)])
    >>> abs(found.fill - 0.3) < found.fill_uncertainty < 0.05
    True
    """
    from ..commands.comparing.read_cloud import check_together
    from ..work.comparing.cloud_scale import scale_of
    from ..work.fits.measured import in_cloud
    from ..work.measuring.height_grid import MOST
    from ..work.measuring.height_grid import volume_between as measured

    with python_names():
        if not (np.isfinite(registration) and registration >= 0):
            raise InputError("expected a length, 0 or more", option="registration", value=registration)
        axis = vector_of("up", up)
        try:
            polygon = np.asarray(corners, np.float64)
        except (TypeError, ValueError):
            polygon = np.empty(0)
        if polygon.shape[1:] != (3,) or len(polygon) < 3 or not np.isfinite(polygon).all():
            raise InputError("expected (K, 3) finite numbers, at least three corners", option="corners", value=corners)
        if not axis.any():
            raise InputError("expected a direction that is not zero", option="up", value=up)
        (one, _, _, meta), (other, _, _, other_meta) = cloud_of("before", before), cloud_of("after", after)
        check_together(Path("before"), meta, Path("after"), other_meta)
        clouds = [cloud[np.isfinite(cloud).all(axis=1)] for cloud in (one, other)]
        if min(map(len, clouds)) < 30:
            raise InputError("a scan has too few points for a volume")
        place = polygon[0]
        spacing = max(scale_of(cloud - cloud.min(axis=0)).spacing for cloud in clouds)
        found = measured(in_cloud(clouds[0], place, MOST), in_cloud(clouds[1], place, MOST), polygon - place, spacing,
                         axis / np.linalg.norm(axis), registration)
    return replace(found, place=tuple((place + found.place).tolist()), dates=("before", "after"))
