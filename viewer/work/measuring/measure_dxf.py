"""Measurements as a DXF drawing in three dimensions: a layer for each kind, lengths and diameters as dimensions, other values
as texts.  By ezdxf.

Coordinates and the unit are those of the scan's file.  A pipe is its axis and a circle at each end, a plane a square on it.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.text import printable
from ..dimensioning.dimensions import OFFSET, dimension_text, measured_line
from ..dimensioning.dxf_texts import STYLE, add_dimension, add_styles, save_drawing
from .measure_shapes import Shapes, shapes_of
from .measure_text import decimals_of, unit_name, value_text
from .measurement import KINDS, Measurement
from .values import evaluate

if TYPE_CHECKING:
    from ezdxf.layouts.layout import Modelspace

INSUNITS = {"m": 6, "mm": 4, "cm": 5, "km": 7, "ft": 2, "in": 1, "ftUS": 21}
"""$INSUNITS of DXF by unit_name; 0 of others: none."""
_COLOURS = (1, 2, 3, 4, 5, 6, 30, 40, 80, 140, 200, 220)
"""Indices of AutoCAD's colours, one for each kind."""
_TEXT = 0.02
"""Height of texts, as a share of the largest side of what is drawn."""


def write_dxf(path: Path, measurements: Iterable[Measurement], metres_per_unit: float | None) -> None:
    """Writes the measurements to an open path; the caller replaces an older file.  Raises OSError."""
    import ezdxf

    drawing = ezdxf.new("R2010", units=INSUNITS.get(unit_name(metres_per_unit), 0))  # type: ignore[reportPrivateImportUsage]
    space, unit = drawing.modelspace(), unit_name(metres_per_unit)
    drawn = [(measurement, shapes_of(measurement)) for measurement in measurements]
    height = _TEXT * _size([shapes for _, shapes in drawn])
    add_styles(drawing, height)
    for measurement, shapes in drawn:
        layer = f"POINTGLASS {KINDS[measurement.kind].name.upper()}"
        if layer not in drawing.layers:
            drawing.layers.add(layer, color=_COLOURS[list(KINDS).index(measurement.kind) % len(_COLOURS)])
        _add(space, shapes, layer)
        if measurement.kind == "pipe" and (fit := measurement.fit) is not None:
            axis, place = np.array(fit.direction), np.array(fit.place)
            space.add_line(place + fit.low * axis, place + fit.high * axis, dxfattribs={"layer": layer, "linetype": "CENTER"})
        if not _dimensioned(space, measurement, shapes, unit, height, layer):
            told = f"{printable(measurement.name)}: {value_text(measurement, unit)}"
            space.add_text(told, height=height, dxfattribs={"layer": layer, "style": STYLE}).set_placement(shapes.label)
    if "CENTER" not in drawing.linetypes:
        drawing.linetypes.add("CENTER", [2.0, 1.25, -0.25, 0.25, -0.25], description="Center ____ _ ____")
    save_drawing(drawing, path)


def _dimensioned(space: "Modelspace", measurement: Measurement, shapes: Shapes, unit: str, height: float, layer: str) -> bool:
    """Adds the dimension of a length or a diameter; False of other kinds, and of a length of 0."""
    ends, up = measured_line(measurement), np.array(measurement.up)
    if measurement.kind in ("pipe", "circle"):
        points = shapes.rings[0].points
        ends, up = points[[len(points) // 2, 0]], np.array(measurement.fits[0].direction)
    if ends is None or not np.linalg.norm(ends[1] - ends[0]) > 0:
        return False
    text = f"{printable(measurement.name)}: {dimension_text(measurement, unit)}"
    add_dimension(space, ends, OFFSET * height, text, decimals_of(evaluate(measurement)), layer, up)
    return True


def _add(space: "Modelspace", shapes: Shapes, layer: str) -> None:
    attributes = {"layer": layer}
    for line in shapes.lines:
        if len(line.points) == 2:
            space.add_line(*line.points, dxfattribs=attributes)
        else:
            space.add_polyline3d(line.points, close=line.closed, dxfattribs=attributes)
    for ring in shapes.rings:
        _add_circle(space, ring.centre, ring.axis, ring.radius, attributes)
    for point in shapes.points if shapes.place is None else [shapes.place]:
        space.add_point(point, dxfattribs=attributes)


def _add_circle(space: "Modelspace", centre: np.ndarray, axis: np.ndarray, radius: float, attributes: dict) -> None:
    """A circle is given in the frame of its own axis (OCS)."""
    from ezdxf.math import OCS

    inside = OCS(axis).from_wcs(centre)  # type: ignore[arg-type]
    space.add_circle(inside, radius, dxfattribs={**attributes, "extrusion": axis})


def _size(shapes: list[Shapes]) -> float:
    """The largest side of all that is drawn; 1 where it has none."""
    every = [part for each in shapes for part in (each.points, *(line.points for line in each.lines))]
    if not every:
        return 1.0
    return float(np.ptp(np.concatenate(every), axis=0).max()) or 1.0
