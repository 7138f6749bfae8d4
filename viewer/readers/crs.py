"""Units and names of coordinate reference systems: from the WKT and GeoTIFF records of files, or assigned by a person.

WKT is read by patterns and not by pyproj, for two reasons: many files hold abbreviated definitions that PROJ refuses, and
pyproj takes 0.1 s to import, which opening most files does without.  EPSG codes and PROJ strings are looked up in pyproj.
"""

import logging
import re
from functools import lru_cache
from typing import TYPE_CHECKING

from ..common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

_LENGTHS = {9001: ("metre", 1.0), 9002: ("foot", 0.3048), 9003: ("US survey foot", 1200 / 3937)}
_LENGTHS |= {9005: ("Clarke's foot", 0.3047972654), 9036: ("kilometre", 1000.0)}
"""Unit name and metres per unit by EPSG code of the unit."""
_NUMBER = r"\+?((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)"
_UNIT = re.compile(rf'\b(?:LENGTHUNIT|UNIT)\s*\[\s*"([^"]*)"\s*,\s*{_NUMBER}\s*[\],]', re.IGNORECASE)
_ANGLES = re.compile("degree|radian|grad|gon|second|minute", re.IGNORECASE)
_VERTICAL = re.compile(r"\b(?:VERT_CS|VERTCRS|VERTICALCRS)\s*\[", re.IGNORECASE)
_PROJECTED = re.compile(r'\b(?:PROJCS|PROJCRS|PROJECTEDCRS|LOCAL_CS|ENGCRS|GEOCCS)\s*\[\s*"([^"]*)"', re.IGNORECASE)
_GEOGRAPHIC = re.compile(r'\b(?:GEOGCS|GEOGCRS|GEODCRS|GEOGRAPHICCRS)\s*\[\s*"([^"]*)"', re.IGNORECASE)
_EPSG = re.compile(r"\s*(?:EPSG\s*:{1,2}\s*)?(\d{1,6}(?:\+\d{1,6})?)\s*", re.IGNORECASE)  # 26917+6360: with heights
_USER_DEFINED = 32767  # in GeoTIFF, instead of an EPSG code
MOST_SHOWN = 50
"""Systems that a search returns at most; a narrower search finds the others."""
_LONGEST_NAME = 80  # characters of a name that are shown: a line of a terminal

_SAME_UNIT = 1e-7  # relative; feet of two kinds differ by 2e-6

Length = tuple[str, float]
"""Name of a unit of length, and metres per unit."""
Reference = tuple[str | None, str, float | None]
"""Name of the reference system or None, name of the unit, metres per unit or None."""
UNKNOWN: Reference = (None, "unknown", None)
_log = logging.getLogger(__name__)


def from_wkt(text: str) -> Reference:
    """Reads a WKT 1 or 2 definition.  Geographic systems have the unit ``degree`` and no metres per unit."""
    text = text.strip("\0 \n\r\t")
    horizontal = _VERTICAL.split(text)[0]
    if match := _PROJECTED.search(horizontal):
        lengths = [(name, float(value)) for name, value in _UNIT.findall(horizontal) if not _ANGLES.search(name)]
        unit, metres = lengths[-1] if lengths else ("unknown", None)  # the last is the projection's, not the ellipsoid's
        return match[1], unit, metres if metres and 0 < metres < float("inf") else None
    if match := _GEOGRAPHIC.search(horizontal):
        return match[1], "degree", None
    return UNKNOWN


def from_text(text: str) -> Reference:
    """Reads WKT, an EPSG code or a PROJ string; any other text is a name without units."""
    found = from_wkt(text)
    if found[0] is not None or not text.strip():
        return found
    name = " ".join(text.split())[:_LONGEST_NAME]
    if (match := _EPSG.fullmatch(text)) or text.lstrip().startswith("+"):
        return name, *_units(f"EPSG:{match[1]}" if match else text)
    return name, "unknown", None


def from_geokeys(
    keys: dict[int, int], ascii_text: str = "", ascii_spans: dict[int, tuple[int, int]] | None = None
) -> Reference:
    """Reads GeoTIFF keys: the short values, and (offset, length) of those that are texts in ``ascii_text``."""
    code = keys.get(3072, _USER_DEFINED)
    name = f"EPSG:{code}" if code not in (0, _USER_DEFINED) else None
    for key in (1026, 3073, 2049):
        if name is None and ascii_spans and key in ascii_spans:
            offset, length = ascii_spans[key]
            name = ascii_text[offset : offset + length].strip("|\0 ") or None
    if keys.get(1024) == 2:
        geographic = keys.get(2048, _USER_DEFINED)
        return name or (f"EPSG:{geographic}" if geographic != _USER_DEFINED else None), "degree", None
    if (unit := keys.get(3076)) in _LENGTHS:
        return name, *_LENGTHS[unit]
    if name is not None and name.startswith("EPSG:"):
        return name, *_units(name)
    unit = keys.get(4099)  # of heights, where nothing is said of x and y
    return (name, *_LENGTHS[unit]) if unit in _LENGTHS else (name, "unknown", None)


def height_unit(text: str) -> Length | None:
    """The unit of heights that a definition (WKT, EPSG codes as 26917+6360, a PROJ string) states, None where it has none."""
    parts = _VERTICAL.split(text)
    if len(parts) > 1:
        lengths = [(name, float(value)) for name, value in _UNIT.findall(parts[1]) if not _ANGLES.search(name)]
        return next(((name, metres) for name, metres in lengths if 0 < metres < float("inf")), None)
    if (match := _EPSG.fullmatch(text)) or text.lstrip().startswith("+"):
        return _height_axis(f"EPSG:{match[1]}" if match else text)
    return None


def height_unit_of_geokeys(keys: dict[int, int]) -> Length | None:
    """The unit of heights that GeoTIFF keys state, by code of the unit or of the vertical system."""
    if (unit := keys.get(4099)) in _LENGTHS:
        return _LENGTHS[unit]
    code = keys.get(4096, _USER_DEFINED)
    return _height_axis(f"EPSG:{code}") if code not in (0, _USER_DEFINED) else None


def height_warning(name: str, units: str, metres: float | None, heights: Length | None) -> list[str]:
    """A warning where heights have another unit than x and y, else none.  name: of the file.  units, metres: of x and y."""
    if heights is None or units == "unknown" or (metres is not None and abs(heights[1] / metres - 1) < _SAME_UNIT):
        return []
    if metres is None and abs(heights[1] - 1) < _SAME_UNIT:  # degrees and metres, which is said elsewhere
        return []
    unit = heights[0].strip()
    return [f"{name}: heights are in {unit} (1 = {heights[1]:.7g} m), x and y in {units}; lengths and angles that are not "
            "level are wrong until it is exported with one unit"]  # fmt: skip


@lru_cache(maxsize=64)
def assigned(text: str) -> Reference:
    """The reference system that a person assigns: an EPSG code ("EPSG:25832" or "25832").  Replaces ``crs``, ``units`` and
    ``metres_per_unit`` of a scan; coordinates are not changed.

    Raises InputError where there is no such code, it is not a system of positions, or pyproj cannot be loaded.
    """
    match = _EPSG.fullmatch(text)
    if match is None:
        raise InputError(f"{text[:30]!a} is not an EPSG code", remedy="give a number such as EPSG:25832 (see epsg.io)")
    code = f"EPSG:{match[1]}"
    try:
        return code, *_looked_up(code)
    except ImportError as error:
        raise InputError(f"{code}: pyproj, which knows the codes, cannot be loaded ({error})",
                         remedy="pip install pyproj") from None
    except ValueError:
        raise InputError(f"{code}: there is no such horizontal reference system", remedy="see epsg.io for its code") from None


@lru_cache(maxsize=1)
def catalogue() -> tuple[tuple[str, str, str], ...]:
    """(code, name, area of use) of every EPSG system with horizontal axes that is not deprecated, in order of code.

    Takes a few tenths of a second.  Raises InputError where pyproj cannot be loaded.
    """
    try:
        from pyproj.database import query_crs_info
        from pyproj.enums import PJType
    except ImportError as error:
        raise InputError(f"pyproj, which knows the names of systems, cannot be loaded ({error})",
                         remedy="pip install pyproj") from None
    kinds = [PJType.PROJECTED_CRS, PJType.GEOGRAPHIC_2D_CRS, PJType.GEOGRAPHIC_3D_CRS, PJType.COMPOUND_CRS]
    found = query_crs_info(auth_name="EPSG", pj_types=kinds)
    areas: dict[tuple[int, str], list[str]] = {}  # a system used in several areas is found once for each
    for info in found:
        areas.setdefault((int(info.code), info.name), []).append((info.area_of_use.name if info.area_of_use else None) or "")
    return tuple((f"EPSG:{code}", name, " ".join(places)) for (code, name), places in sorted(areas.items()))


def matching(text: str, systems: "Sequence[tuple[str, str, str]]", most: int = MOST_SHOWN) -> list[tuple[str, str, str]]:
    """The systems of :func:`catalogue` that a person may mean: a code begun, or words of name and area; at most ``most``.

    Exact codes come first, then names that hold every word, then those whose area of use holds the rest.
    """
    text = text.strip().casefold()
    digits = text.removeprefix("epsg").strip(" :")
    if digits.isdecimal():
        exact = [row for row in systems if row[0] == f"EPSG:{int(digits)}"]
        begun = [row for row in systems if row[0].startswith(f"EPSG:{digits}") and row not in exact]
        named = [row for row in systems if digits in row[1] and row not in exact and row not in begun]
        return [*exact, *begun, *named][:most]
    words = text.split()
    if not words:
        return []
    by_name = [row for row in systems if all(word in row[1].casefold() for word in words)]
    named = set(by_name)
    by_area = [row for row in systems if row not in named and all(word in f"{row[1]} {row[2]}".casefold() for word in words)]
    return [*sorted(by_name, key=lambda row: len(row[1])), *by_area][:most]


def wkt(code: str) -> str:
    """WKT 1 (GDAL's) of an EPSG code; WKT 2 where version 1 cannot express it.  Raises InputError as :func:`assigned`."""
    name = assigned(code)[0]
    assert name is not None
    return wkt_of_definition(name)


def wkt_of_definition(definition: str) -> str:
    """WKT 1 (GDAL's) of an EPSG code or a PROJ string; WKT 2 where version 1 cannot express it.  Raises ValueError where PROJ
    knows no such system, ImportError where pyproj cannot be loaded."""
    from pyproj.enums import WktVersion
    from pyproj.exceptions import CRSError

    system = _crs(definition)
    try:
        return system.to_wkt(WktVersion.WKT1_GDAL)
    except CRSError:
        return system.to_wkt()


@lru_cache(maxsize=64)
def title(code: str) -> str | None:
    """The full name of an EPSG code, "EPSG:25832" -> "ETRS89 / UTM zone 32N"; None where it is not known."""
    match = _EPSG.fullmatch(code)
    try:
        return _crs(f"EPSG:{match[1]}").name if match else None
    except (ImportError, ValueError) as error:
        _log.info("%s has no name: %s", code, error)
        return None


def system(definition: str):
    """pyproj's object of a definition.  Raises ValueError where PROJ cannot read it, ImportError where pyproj is missing."""
    return _crs(definition)


def _units(definition: str) -> tuple[str, float | None]:
    """Unit and metres per unit of a definition in a file; unknown where pyproj does not know it, which the log says."""
    try:
        return _looked_up(definition)
    except (ImportError, ValueError) as error:
        _log.info("units of %s are unknown: %s", definition[:_LONGEST_NAME], error)
        return "unknown", None


def _looked_up(definition: str) -> tuple[str, float | None]:
    """Unit and metres per unit of the horizontal axes.  Raises ValueError where PROJ knows no such system."""
    axes = [axis for axis in _crs(definition).axis_info if axis.direction not in ("up", "down")]
    if not axes:
        raise ValueError("it has no horizontal axes")
    if any(axis.unit_name == "degree" for axis in axes):
        return "degree", None
    return axes[0].unit_name, float(axes[0].unit_conversion_factor)


def _height_axis(definition: str) -> Length | None:
    """The unit of the vertical axis of a definition, None where it has none or pyproj does not know it, which the log says."""
    try:
        axes = [axis for axis in _crs(definition).axis_info if axis.direction in ("up", "down")]
    except (ImportError, ValueError) as error:
        _log.info("heights of %s are unknown: %s", definition[:_LONGEST_NAME], error)
        return None
    return (axes[0].unit_name, float(axes[0].unit_conversion_factor)) if axes else None


def _crs(definition: str):
    """pyproj's object.  Raises ValueError, ImportError."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(definition)
    except CRSError as error:
        raise ValueError((str(error).splitlines() or ["not known"])[0][:_LONGEST_NAME]) from None
