"""Units and coordinate reference system (CRS) that a person assigns to scans: what a scene's facts are with them.

Coordinates are never changed: an assignment says what they mean.  A CRS brings its unit of length; a unit that is assigned as
well takes precedence, for scans that are stored in millimetres of a national grid.
"""

from collections.abc import Iterable
from dataclasses import replace

from ..preprocess.scan_description import Assigned, ScanDescription
from .document import ScanFile

UNITS: dict[str, float] = {
    "metre": 1.0, "millimetre": 0.001, "centimetre": 0.01, "kilometre": 1000.0, "foot": 0.3048,
    "US survey foot": 1200 / 3937, "inch": 0.0254,
}  # fmt: skip
"""Name -> metres per unit, of the units that a person may assign."""


def with_reference(meta: ScanDescription, scans: Iterable[ScanFile]) -> ScanDescription:
    """The description with the CRS and the unit that a document assigns; ``meta`` itself where it assigns none.

    Scans share the scene's frame, so the first assignment is that of all.  Raises InputError where the code of the CRS is
    unknown or pyproj, which knows the codes, cannot be loaded.
    """
    scans = list(scans)
    code = next((scan.crs for scan in scans if scan.crs), None)
    metres = next((scan.metres_per_unit for scan in scans if scan.metres_per_unit), None)
    if code is None and metres is None:
        return meta
    found = meta
    if code is not None:
        from ..readers.crs import assigned

        name, units, length = assigned(code)
        found = replace(found, crs=name, units=units, metres_per_unit=length)
    if metres is not None:
        found = replace(found, units=unit_name_of(metres), metres_per_unit=metres)
    return replace(found, assigned=Assigned(crs=code is not None, unit=metres is not None))


def unit_name_of(metres: float) -> str:
    """The name of a unit by its length in metres; "0.5 m" where it has none."""
    return next((name for name, value in UNITS.items() if abs(metres / value - 1) < 1e-9), f"{metres:g} m")


def wkt_of(meta: ScanDescription) -> str | None:
    """WKT 1 of what was assigned, for files that are exported; None where nothing was.  meta: of :func:`with_reference`.

    A unit that differs from that of the CRS makes the coordinates local ones: no registered system has them.
    """
    if not meta.assigned:
        return None
    if meta.assigned.unit:
        name = f"{meta.crs} in {meta.units}" if meta.crs else "local coordinates"
        return f'LOCAL_CS["{name.replace(chr(34), "")}",UNIT["{meta.units}",{meta.metres_per_unit!r}]]'
    from ..readers.crs import wkt

    return wkt(meta.crs or "")
