"""Units and names of coordinate reference systems, from the WKT and GeoTIFF records a LAS file carries.

Only what a viewer needs, the length of one file unit in metres and a name to show, so that no projection library is.
"""

import re

_LENGTHS = {9001: ("metre", 1.0), 9002: ("foot", 0.3048), 9003: ("US survey foot", 1200 / 3937)}
_LENGTHS |= {9005: ("Clarke's foot", 0.3047972654), 9036: ("kilometre", 1000.0)}
_NUMBER = r"\+?((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)"
_UNIT = re.compile(rf'\b(?:LENGTHUNIT|UNIT)\s*\[\s*"([^"]*)"\s*,\s*{_NUMBER}\s*[\],]', re.IGNORECASE)
_ANGLES = re.compile("degree|radian|grad|gon|second|minute", re.IGNORECASE)
_VERTICAL = re.compile(r"\b(?:VERT_CS|VERTCRS|VERTICALCRS)\s*\[", re.IGNORECASE)
_PROJECTED = re.compile(r'\b(?:PROJCS|PROJCRS|PROJECTEDCRS|LOCAL_CS|ENGCRS|GEOCCS)\s*\[\s*"([^"]*)"', re.IGNORECASE)
_GEOGRAPHIC = re.compile(r'\b(?:GEOGCS|GEOGCRS|GEODCRS|GEOGRAPHICCRS)\s*\[\s*"([^"]*)"', re.IGNORECASE)
# EPSG blocks known to be in metres: UTM on NAD83, on WGS 84 north and south, on ETRS89
_METRIC = (range(26901, 26924), range(32601, 32661), range(32701, 32761), range(25828, 25839))

Reference = tuple[str | None, str, float | None]
"""Name of the reference system or None, name of the unit, metres per unit or None."""


def from_wkt(text: str) -> Reference:
    """Reads a WKT 1 or 2 definition.  Geographic systems have the unit ``degree`` and no metres per unit."""
    text = text.strip("\0 \n\r\t")
    horizontal = _VERTICAL.split(text)[0]
    if match := _PROJECTED.search(horizontal):
        lengths = [(name, float(value)) for name, value in _UNIT.findall(horizontal) if not _ANGLES.search(name)]
        unit, metres = (
            lengths[-1] if lengths else ("unknown", None)
        )  # the last is the projection's own, not the ellipsoid's
        return match[1], unit, metres if metres and 0 < metres < float("inf") else None
    if match := _GEOGRAPHIC.search(horizontal):
        return match[1], "degree", None
    return None, "unknown", None


def from_geokeys(
    keys: dict[int, int], ascii_text: str = "", ascii_spans: dict[int, tuple[int, int]] | None = None
) -> Reference:
    """Reads GeoTIFF keys: the short values, and (offset, length) of those that are texts in ``ascii_text``."""
    code = keys.get(3072, 32767)
    name = f"EPSG:{code}" if code not in (0, 32767) else None
    for key in (1026, 3073, 2049):
        if name is None and ascii_spans and key in ascii_spans:
            offset, length = ascii_spans[key]
            name = ascii_text[offset : offset + length].strip("|\0 ") or None
    if keys.get(1024) == 2:
        return name or (f"EPSG:{keys[2048]}" if keys.get(2048, 32767) != 32767 else None), "degree", None
    unit = keys.get(3076) or keys.get(4099)
    if unit in _LENGTHS:
        return name, *_LENGTHS[unit]
    if any(code in block for block in _METRIC):
        return name, "metre", 1.0
    return name, "unknown", None
