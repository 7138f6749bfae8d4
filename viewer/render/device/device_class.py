"""Choices that depend on the kind of device: workgroup shapes of the compute rasteriser, and how exactly pictures repeat.

Classes: ``software`` (OpenGL on the processor), ``nvidia``, ``amd``, ``intel``, ``other``.
"""

import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...common.errors import InputError

if TYPE_CHECKING:
    import numpy as np

WORKGROUP_VARIABLE = "POINTGLASS_WORKGROUP"
"""Environment variable LANESxROWS that replaces the workgroup shape of the device's class, for measurements."""

DIFFERING_PIXELS = 5e-4
"""Share of the pixels in which two pictures of one scene and camera may differ on a GPU: two rasterisers, or either and the
float64 reference.  Division need not be rounded there as IEEE 754 says (OpenGL 4.6, 4.7.1: 2.5 units in the last place), and
a point on the border of two pixels may fall into either.  0.05 % is what a reading of the shaders proposed; no GPU has measured
it yet.  Software OpenGL repeats every byte: there nothing may differ."""

FOLLOWING_PIXELS = 1e-2
"""The same for what is made from the raw picture, filtered and filled: a pixel that differs changes what the filter keeps and
the fill makes around it.  A choice, not measured yet."""

_VENDORS = {"nvidia": "nvidia", "amd": "amd", "ati technologies": "amd", "radeon": "amd", "intel": "intel"}


@dataclass(frozen=True)
class Workgroup:
    """Shape of a workgroup of the compute rasteriser.  lanes: invocations.  rows: batches of up to shader.BATCH points that it
    draws one after the other."""

    lanes: int
    rows: int

    def __str__(self) -> str:
        return f"{self.lanes}x{self.rows}"


_SMALL = Workgroup(64, 1)
WORKGROUPS: dict[str, tuple[Workgroup, ...]] = {
    "software": (Workgroup(8, 8),),
    "nvidia": (_SMALL, Workgroup(128, 8), Workgroup(128, 40)),
    "amd": (_SMALL, Workgroup(64, 8), Workgroup(128, 40)),
    "intel": (_SMALL, Workgroup(32, 8)),
    "other": (_SMALL, Workgroup(128, 8)),
}
"""Shapes by class, the default first.  ``--raster auto`` measures all of a GPU's on the first picture and keeps the fastest.

software: a workgroup costs as much as 60 points there, and lanes beyond the processor's eight run one after the other,
whether a point is left for them or not.  Both passes over 1.6M to 6M points took 0.6 to 0.75 of the time of a lane a point
with 64 a batch (128 to 512 points in eight lanes differ by 5 %); eight batches a group took 3 to 5 % less time than one (10M
to 100M points with a level of detail, most runs short).
GPUs: candidates, not measured yet.  64x1 has the most groups, for short draw lists; 128x40 is about the 10,000 points for
128 threads of compute_rasterizer (Schuetz 2021); 8 batches lie between.  64 and 32 lanes: waves of AMD and Intel."""


def device_class(vendor: str, renderer: str, *, software: bool) -> str:
    """The class of a device, from the driver's strings."""
    if software:
        return "software"
    names = f"{vendor} {renderer}".lower()
    return next((kind for word, kind in _VENDORS.items() if word in names), "other")


def workgroups(kind: str) -> tuple[Workgroup, ...]:
    """Shapes to choose from on a device of this class, the default first; the environment's alone where it names one.

    Raises InputError where the environment variable is malformed.
    """
    given = os.environ.get(WORKGROUP_VARIABLE)
    if not given:
        return WORKGROUPS[kind]
    match = re.fullmatch(r"(\d+)x(\d+)", given)
    if match is None or not (1 <= int(match[1]) <= 1024 and 1 <= int(match[2]) <= 1024):
        raise InputError(f"{WORKGROUP_VARIABLE}={given}: expected LANESxROWS, each from 1 to 1024, for example 128x8")
    return (Workgroup(int(match[1]), int(match[2])),)


def pictures_agree(made: "np.ndarray", expected: "np.ndarray", *, software: bool, share: float = DIFFERING_PIXELS) -> bool:
    """Whether two pictures of one scene and camera are as equal as this project promises: in software OpenGL to the byte, on a
    GPU but for ``share`` of the pixels (two pixels at least).

    made, expected: (H, W) or (H, W, channels), of any one type.
    """
    differing = made != expected
    if differing.ndim == 3:
        differing = differing.any(axis=2)
    return int(differing.sum()) <= (0 if software else max(2, share * differing.size))
