"""Units and coordinate reference system (CRS) that a person assigns to scans: what a scene's facts are with them.

Coordinates are never changed: an assignment says what they mean.  A CRS brings its unit of length; a unit that is assigned as
well takes precedence, for scans that are stored in millimetres of a national grid.
"""

from collections.abc import Iterable

from .document import ScanFile

UNITS: dict[str, float] = {
    "metre": 1.0, "millimetre": 0.001, "centimetre": 0.01, "kilometre": 1000.0, "foot": 0.3048,
    "US survey foot": 1200 / 3937, "inch": 0.0254,
}  # fmt: skip
"""Name -> metres per unit, of the units that a person may assign."""


def with_reference(meta: dict, scans: Iterable[ScanFile]) -> dict:
    """``Scene.meta`` with the CRS and the unit that a document assigns; ``meta`` itself where it assigns none.

    Scans share the scene's frame, so the first assignment is that of all.  Sets ``crs``, ``units``, ``metres_per_unit``, and
    ``assigned`` (the names of what was assigned: ``crs``, ``unit``).  Raises InputError where the code of the CRS is unknown or
    pyproj, which knows the codes, cannot be loaded.
    """
    scans = list(scans)
    code = next((scan.crs for scan in scans if scan.crs), None)
    metres = next((scan.metres_per_unit for scan in scans if scan.metres_per_unit), None)
    found = dict(meta)
    if code is not None:
        from ..readers.crs import assigned

        found["crs"], found["units"], found["metres_per_unit"] = assigned(code)
    if metres is not None:
        found["units"], found["metres_per_unit"] = unit_name_of(metres), metres
    done = [name for name, value in (("crs", code), ("unit", metres)) if value is not None]
    return found | {"assigned": done} if done else meta


def unit_name_of(metres: float) -> str:
    """The name of a unit by its length in metres; "0.5 m" where it has none."""
    return next((name for name, value in UNITS.items() if abs(metres / value - 1) < 1e-9), f"{metres:g} m")


def wkt_of(meta: dict) -> str | None:
    """WKT 1 of what was assigned, for files that are exported; None where nothing was.  meta: of :func:`with_reference`.

    A unit that differs from that of the CRS makes the coordinates local ones: no registered system has them.
    """
    done = meta.get("assigned") or []
    if not done:
        return None
    if "unit" in done:
        name = f"{meta['crs']} in {meta['units']}" if meta.get("crs") else "local coordinates"
        return f'LOCAL_CS["{name.replace(chr(34), "")}",UNIT["{meta["units"]}",{meta["metres_per_unit"]!r}]]'
    from ..readers.crs import wkt

    return wkt(meta["crs"])
