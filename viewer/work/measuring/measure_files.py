"""Files of measurements: a table (CSV), a drawing (DXF), or map features (GeoJSON), by the ending of the name."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ....model.common.files.atomic_write import write_atomic
from ...common.errors import InputError
from ...common.text import table_bytes

if TYPE_CHECKING:
    from ...preprocess.scan_description import ScanDescription
    from .measurement import Measurement

ENDINGS = {"CSV table": (".csv",), "DXF drawing": (".dxf",), "GeoJSON": (".geojson", ".json")}
"""Each kind of file as a person reads it, and the endings of its names; the first one is given where there is none."""

_HALF = "backslashreplace"
"""What becomes of half a character (an unpaired surrogate), of a scan whose file name is not UTF-8."""


def write_measurements(path: Path, measurements: "Sequence[Measurement]", facts: "ScanDescription") -> None:
    """Writes the measurements; an older file stays on failure.  facts: of the scan, with what was assigned to it: its unit and
    its reference system.  Raises InputError naming the file."""
    writer = _writer(path, measurements, facts)
    try:
        write_atomic(path, writer)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=path, remedy="save it elsewhere") from None


def _writer(path: Path, measurements: "Sequence[Measurement]", facts: "ScanDescription") -> Callable[[Path], object]:
    ending = path.suffix.lower()
    if ending in ENDINGS["CSV table"]:
        from .measure_table import csv_text

        return lambda beside: beside.write_bytes(table_bytes(csv_text(measurements, facts.metres_per_unit)))
    if ending in ENDINGS["DXF drawing"]:
        from .measure_dxf import write_dxf

        return lambda beside: write_dxf(beside, measurements, facts.metres_per_unit)
    if ending in ENDINGS["GeoJSON"]:
        from .measure_geojson import geojson_text

        unit, crs = facts.metres_per_unit, facts.crs
        return lambda beside: beside.write_bytes(geojson_text(measurements, unit, crs).encode(errors=_HALF))
    known = ", ".join(ending for endings in ENDINGS.values() for ending in endings)
    raise InputError(f"measurements are not written as {ending or 'a file without an ending'!r}", file=path,
                     remedy=f"end the name with one of {known}")
