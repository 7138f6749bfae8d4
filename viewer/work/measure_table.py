"""Measurements as a CSV table."""

import csv
import io
from collections.abc import Iterable
from pathlib import Path

from ...model.common.files.atomic_write import write_atomic
from ..common.errors import InputError
from ..common.text import exact_text
from .measure import Measurement, components, evaluate, unit_name

PARTS = ("horizontal", "vertical", "dx", "dy", "dz")
OF_FIT = ("place_x", "place_y", "place_z", "direction_x", "direction_y", "direction_z", "length", "seen_degrees", "points")
"""Of a fitted surface: a place on the plane or on the axis, and its normal or the direction of the axis."""
COLUMNS = ("name", "kind", "value", "uncertainty_k2", "unit", "residual", "point", "x", "y", "z", "spacing", "noise", "scan",
           *PARTS, *OF_FIT)


def csv_text(measurements: Iterable[Measurement], metres_per_unit: float | None) -> str:
    """The measurements as CSV (RFC 4180, ``.`` as decimal point): one row a point, the value in the first of each, and of a
    distance its parts."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(COLUMNS)
    unit = unit_name(metres_per_unit)
    for measurement in measurements:
        result = evaluate(measurement)
        head = [measurement.name, measurement.kind, exact_text(result.value), exact_text(result.uncertainty),
                "deg" if result.power == 0 else unit if result.power == 1 else f"{unit}^2", exact_text(result.residual)]
        parts = components(measurement)
        of_it = [""] * len(PARTS) if parts is None else [*map(exact_text, (parts.horizontal, parts.vertical, *parts.along))]
        of_it += _of_fit(measurement)
        for number, point in enumerate(measurement.points, 1):
            first, last = (head, of_it) if number == 1 else ([*head[:2], *[""] * 4], [""] * len(of_it))
            place = map(exact_text, point.position)
            writer.writerow([*first, number, *place, exact_text(point.spacing), exact_text(point.noise), point.scan, *last])
    return out.getvalue()


def _of_fit(measurement: Measurement) -> list[str]:
    if (fit := measurement.fit) is None:
        return [""] * len(OF_FIT)
    length = "" if fit.kind == "plane" else exact_text(fit.high - fit.low)
    seen = "" if fit.kind == "plane" else exact_text(fit.seen)
    return [*map(exact_text, (*fit.place, *fit.direction)), length, seen, str(fit.count)]


def write_csv(path: Path, measurements: Iterable[Measurement], metres_per_unit: float | None) -> None:
    """Writes :func:`csv_text`; an older file stays on failure.  Raises InputError naming the file."""
    text = csv_text(measurements, metres_per_unit)
    try:
        write_atomic(path, lambda beside: beside.write_bytes(text.encode("utf-8")))
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=path, remedy="save it elsewhere") from None
