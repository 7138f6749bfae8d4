"""Measurements as GeoJSON, for programs of maps.

Coordinates are those of the scan's file, its heights too, in the member ``crs`` of the GeoJSON of 2008, which GDAL and QGIS
read.  RFC 7946 knows degrees of WGS 84 only, in which a measurement would be rounded and the file's axes lost.
"""

import json
import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from .measure_shapes import shapes_of
from .measure_text import base_height, silhouette_text, unit_name, value_text
from .measurement import Measurement
from .values import components, evaluate


def geojson_text(measurements: Iterable[Measurement], metres_per_unit: float | None, crs: str | None) -> str:
    """The measurements as one collection.  crs: "EPSG:25832", or the name of another system, which is told in words only."""
    head: dict[str, Any] = {"type": "FeatureCollection"}
    if crs is not None and (code := re.fullmatch(r"EPSG:(\d+)", crs)):
        head["crs"] = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{code[1]}"}}
    elif crs is not None:
        head["description"] = f"coordinates in {crs}"
    unit = unit_name(metres_per_unit)
    return json.dumps(head | {"features": [_feature(item, unit) for item in measurements]}, indent=1, ensure_ascii=False)


def _feature(measurement: Measurement, unit: str) -> dict[str, Any]:
    result = evaluate(measurement)
    facts: dict[str, Any] = {
        "name": measurement.name, "kind": measurement.kind, "text": value_text(measurement, unit),
        "value": None if result.place is not None else result.value, "uncertainty_k2": result.uncertainty,
        "unit": {0: "deg", 1: unit, 2: f"{unit}^2", 3: f"{unit}^3", None: unit}[result.power],
    }  # fmt: skip
    if (parts := components(measurement)) is not None:
        facts |= {"horizontal": parts.horizontal, "vertical": parts.vertical, **dict(zip(("dx", "dy", "dz"), parts.along))}
    if about := silhouette_text(measurement):
        facts["note"] = about
    if (volume := measurement.volume) is not None:
        facts |= {"cut": volume.cut, "cut_uncertainty_k2": volume.cut_uncertainty, "fill": volume.fill,
                  "fill_uncertainty_k2": volume.fill_uncertainty, "base_height": base_height(measurement), "area": volume.area,
                  "empty_share": volume.empty, "layered_share": volume.layered}  # fmt: skip
        facts |= dict(zip(("before", "after"), volume.dates))
    if (fit := measurement.fit) is not None:
        facts |= {"direction": list(fit.direction), "scatter": fit.sigma, "points": fit.count}
    return {"type": "Feature", "geometry": _geometry(measurement), "properties": facts}


def _geometry(measurement: Measurement) -> dict[str, Any]:
    """What was measured, without what explains it: the axis of a pipe, the square on a plane, the ring of a circle."""
    shapes, fit = shapes_of(measurement), measurement.fit
    if shapes.place is not None:
        return {"type": "Point", "coordinates": shapes.place.tolist()}
    if fit is not None and fit.kind == "pipe":
        axis, place = np.array(fit.direction), np.array(fit.place)
        return {"type": "LineString", "coordinates": [(place + end * axis).tolist() for end in (fit.low, fit.high)]}
    if fit is not None:
        (closed,) = [ring.points for ring in shapes.rings] or [line.points for line in shapes.lines]
        return _polygon(closed)
    if shapes.area is not None:
        return _polygon(shapes.points)
    if measurement.kind == "edge":
        return {"type": "MultiPoint", "coordinates": shapes.points.tolist()}
    if measurement.profile is not None and len(shapes.lines[0].points) < 2:
        return {"type": "Point", "coordinates": shapes.label.tolist()}
    (line,) = [line for line in shapes.lines if not line.helper and not line.closed]
    return {"type": "LineString", "coordinates": line.points.tolist()}


def _polygon(corners: np.ndarray) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[*corners.tolist(), corners[0].tolist()]]}
