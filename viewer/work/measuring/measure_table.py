"""Measurements as a CSV table."""

import csv
import io
import math
from collections.abc import Callable, Iterable

from ...common.text import plain, table_places
from .measure_text import base_height, unit_name
from .measurement import MeasuredPoint, Measurement
from .values import components, evaluate

PARTS = ("horizontal", "vertical", "dx", "dy", "dz")
OF_FIT = ("place_x", "place_y", "place_z", "direction_x", "direction_y", "direction_z", "length", "seen_degrees", "points")
"""Of the surface fitted at a point: a place on the plane or on the axis, and its normal or the direction of the axis."""
FOUND = ("found_x", "found_y", "found_z")
"""The place that a measurement has found, of a corner; it has no value then."""
OF_VOLUME = ("cut", "cut_uncertainty_k2", "fill", "fill_uncertainty_k2", "base_height", "area", "empty_share", "layered_share")
"""Of a volume, whose value is cut - fill: above and below the base, the base in the middle of the polygon, and the shares of
the area without points and with walls or two surfaces."""
SILHOUETTE = "beyond"
"""Of a point on a silhouette: how far the contour may lie beyond it."""
COLUMNS = ("name", "kind", "value", "uncertainty_k2", "unit", "residual", "point", "x", "y", "z", "spacing", "noise", "scan",
           *PARTS, *OF_FIT, *FOUND, SILHOUETTE, *OF_VOLUME)

LOSS = 1e-6
"""Share of the point spacing that places may lose for shorter texts: those of a scan that was turned have every digit."""


def csv_text(measurements: Iterable[Measurement], metres_per_unit: float | None) -> str:
    """The measurements as CSV (RFC 4180, ``.`` as decimal point): one row a point with the surface fitted there; in the first
    of each measurement the value, the parts of a distance, the place found, and what a volume is made of."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(COLUMNS)
    unit = unit_name(metres_per_unit)
    for measurement in measurements:
        result = evaluate(measurement)
        value = plain(result.value) if result.place is None else ""
        head = [measurement.name, measurement.kind, value, plain(result.uncertainty),
                {0: "deg", 1: unit, 2: f"{unit}^2", 3: f"{unit}^3", None: unit}[result.power],
                plain(result.residual)]
        places = _places(measurement)
        parts = components(measurement)
        of_it = [""] * len(PARTS) if parts is None else places((parts.horizontal, parts.vertical, *parts.along))
        found = [""] * len(FOUND) if result.place is None else places(result.place)
        for number, point in enumerate(measurement.points, 1):
            first = number == 1
            writer.writerow([
                *head[:2], *(head[2:] if first else [""] * 4), number, *_place(point),
                plain(point.spacing), plain(point.noise), point.scan, *(of_it if first else [""] * len(of_it)),
                *_of_fit(point, places), *(found if first else [""] * len(found)),
                "" if point.beyond is None else plain(math.hypot(*point.beyond)),
                *(_of_volume(measurement) if first else [""] * len(OF_VOLUME)),
            ])  # fmt: skip
    return out.getvalue()


def _of_volume(measurement: Measurement) -> list[str]:
    if (volume := measurement.volume) is None:
        return [""] * len(OF_VOLUME)
    values = (volume.cut, volume.cut_uncertainty, volume.fill, volume.fill_uncertainty, base_height(measurement), volume.area,
              volume.empty, volume.layered)  # fmt: skip
    return [plain(value) for value in values]


def _place(point: MeasuredPoint) -> list[str]:
    return table_places(point.position, loss=LOSS * point.spacing)


def _places(measurement: Measurement) -> Callable[[Iterable[float]], list[str]]:
    """Writes what was computed from the points of a measurement."""
    size = max(abs(value) for point in measurement.points for value in point.position)
    spacing = min(point.spacing for point in measurement.points)
    return lambda values: table_places(values, size, LOSS * spacing)


def _of_fit(point: MeasuredPoint, places: Callable[[Iterable[float]], list[str]]) -> list[str]:
    if (fit := point.fit) is None:
        return [""] * len(OF_FIT)
    length = "" if fit.kind == "plane" else plain(fit.high - fit.low)
    seen = "" if fit.kind == "plane" else plain(fit.seen)
    return [*places(fit.place), *map(plain, fit.direction), length, seen, str(fit.count)]
