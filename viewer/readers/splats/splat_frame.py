"""The way from a file of splats back to the scan that pointglass made them from, as its export writes it into SPZ and GLB.

A mapping of JSON: ``to_scan``, three rows of four numbers, from the file's coordinates to the scan's; ``unit`` and
``metres_per_unit`` of the scan's coordinates, ``crs`` and ``wkt``, name and definition of its reference system, where they are
known.  A PLY has them as comments (viewer.readers.ply.splat_ply_source).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import crs
from ..source import Source

OF_SPLATS = " of Gaussian splats"
"""Ends the name of each format of splats (Source.format)."""
_NO_NAMES = ("unknown", "mixed")
"""``crs`` where no one system is known."""
MOVED = 2.0**-36
"""Relative precision of float32 coordinates that were moved to map coordinates, thousands of times as large."""


@dataclass(frozen=True, eq=False)
class SplatFrame:
    """to_scan: (3, 4) float64, from the file's coordinates to the scan's.  The rest: as in the mapping, None where unknown."""

    to_scan: np.ndarray
    unit: str | None = None
    metres_per_unit: float | None = None
    wkt: str | None = None
    crs_name: str | None = None

    def placed(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) coordinates of the file in the scan's."""
        return xyz @ self.to_scan[:, :3].T + self.to_scan[:, 3]

    def tell(self, source: Source) -> None:
        """Gives a source the unit and the reference system."""
        if self.wkt:
            source.crs, source.units, source.metres_per_unit = crs.from_wkt(self.wkt)
            source.crs_text = self.wkt
        source.crs = source.crs or self.crs_name
        if source.metres_per_unit is None and self.metres_per_unit is not None:
            source.units, source.metres_per_unit = self.unit or "unit", self.metres_per_unit


def splat_frame(found: Any) -> SplatFrame | None:
    """The frame in a mapping; None where it is none, or not as the export writes it."""
    if not isinstance(found, Mapping):
        return None
    try:
        to_scan = np.array(found.get("to_scan"), np.float64)
        metres = float(found["metres_per_unit"]) if "metres_per_unit" in found else None
    except (TypeError, ValueError):
        return None
    if to_scan.shape != (3, 4) or not np.isfinite(to_scan).all():
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        if not 1e-12 <= abs(np.linalg.det(to_scan[:, :3])) < np.inf:
            return None
    unit, wkt, name = found.get("unit"), found.get("wkt"), found.get("crs")
    return SplatFrame(to_scan, unit if isinstance(unit, str) else None, metres if metres and 0 < metres < np.inf else None,
                      wkt if isinstance(wkt, str) else None, name if isinstance(name, str) and name not in _NO_NAMES else None)
