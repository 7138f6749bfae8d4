"""Surfaces fitted to measured points, from Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from ..picture.clip import vector
from ..work.fits.fit import KINDS, Fit, fit_at
from .arguments import vector_of

if TYPE_CHECKING:
    from ..grid.scene import Scene

_NEAR = 10.0
"""Point spacings within which a measured point must lie: farther off, another surface may be meant.  Where points are a
hundred times sparser than in the median of the scan, a place on the surface has one so near with 1 - exp(-pi), 96 %."""


def fit_surface(scene: Scene, position: npt.ArrayLike, kind: str) -> Fit:
    """As :meth:`pointglass.Scan.fit`."""
    from ..work.fits.measured import in_scene

    place = vector_of("position", position)
    if kind not in KINDS:
        raise InputError(f"expected one of {', '.join(KINDS)}", option="kind", value=kind)
    reach = _NEAR * scene.spacing
    near = in_scene(scene, place)(np.zeros(3), np.eye(3), np.full(3, reach)).xyz
    if len(near) == 0:
        raise InputError(f"position {place.tolist()}: no measured point lies within {reach:.3g} of it",
                         remedy="give a place on the scan, such as a row of scan.points.xyz")
    nearest = near[np.linalg.norm(near, axis=1).argmin()]
    return fit_at(scene, vector(place + nearest), kind)
