"""Which way grid north is on a plan, and what the axes of a sheet are called."""

import logging
import re
from typing import TYPE_CHECKING

from ..places.up_axis import Z_UP

if TYPE_CHECKING:
    from ...preprocess.scan_description import ScanDescription

_PROJECTION = re.compile(r"utm|mercator|lambert|gau(ss|ß)|state.?plane|stereograph|albers|cassini|krovak|grid|zone",
                         re.IGNORECASE)  # fmt: skip
"""Words in the names of projected systems, for names that pyproj does not know (ESRI writes underscores)."""
_log = logging.getLogger(__name__)


def has_grid_north(meta: "ScanDescription", up: tuple[float, float, float]) -> bool:
    """Whether +y of the file is grid north: its reference system is a projected one, and z is up.

    Takes a tenth of a second where the file names a system.
    """
    if meta.crs in (None, "", "mixed") or meta.in_degrees or meta.metres_per_unit is None or tuple(up) != Z_UP:
        return False
    name = str(meta.crs)
    try:
        from pyproj import CRS

        return bool(CRS.from_user_input(name).is_projected)
    except Exception as error:  # pyproj is missing, or knows no such name
        _log.info("%s: %s", name, error)
        return _PROJECTION.search(name) is not None


def axis_name(direction: tuple[float, float, float]) -> str:
    """"x", "-z" and so on of a unit vector along an axis of the file; "" of any other."""
    for axis, along in zip("xyz", direction, strict=True):
        if abs(abs(along) - 1.0) < 1e-9:
            return axis if along > 0 else f"-{axis}"
    return ""
