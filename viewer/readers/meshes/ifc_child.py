"""Triangles of an IFC file by ifcopenshell, in a process of its own, which a damaged file may end (ifc_file).

Frame of the result: the map's where an IfcMapConversion tells how the project lies on it, else the project's; metres, z up.
"""

import json
import os
import sys
from importlib import import_module
from typing import Any

import numpy as np

_LEFT_OUT = ("IfcOpeningElement", "IfcSpace", "IfcAnnotation")
"""Classes whose shapes are no surfaces of a building."""
_UNITS = "ifcopenshell.util.unit"
_GREY = (200, 200, 205)
_SAME = 0.02
"""Of a scale: projects in millimetres on maps in metres often state 1, which would make them 1,000 times as large."""


def main() -> None:
    """Arguments: the IFC file, and the .npz to write.  A line on standard error and exit code 3 where it cannot be read."""
    try:
        np.savez(sys.argv[2], **triangles(sys.argv[1]))
    except Exception as error:  # whatever the library raises of a stranger's file
        print(f"{type(error).__name__}: {error}"[:400], file=sys.stderr)
        os._exit(3)
    os._exit(0)  # not through destructors of the library


def triangles(path: str) -> dict[str, Any]:
    """vertices (V, 3) float64, faces (F, 3) int32, rgb (V, 3) uint8, element (F,) int32; ``about``: JSON of their names, and of
    what was assumed."""
    geom: Any = import_module("ifcopenshell.geom")
    file: Any = import_module("ifcopenshell").open(path)
    settings = geom.settings()
    settings.set("use-world-coords", True)
    excluded = [name for name in _LEFT_OUT if file.by_type(name)]
    more = {"exclude": excluded} if excluded else {}
    shapes: Any = geom.iterator(settings, file, max(os.cpu_count() or 1, 1), **more)
    vertices, faces, rgb, element, names, start = [], [], [], [], list[str](), 0
    going = shapes.initialize()
    while going:
        shape = shapes.get()
        places = np.array(shape.geometry.verts, np.float64).reshape(-1, 3)
        corners = np.array(shape.geometry.faces, np.int64).reshape(-1, 3)
        if len(corners):
            colours = np.array([_rgb(material) for material in shape.geometry.materials] or [_GREY], np.uint8)
            of_face = np.array(shape.geometry.material_ids, np.int64)
            if len(of_face) != len(corners):
                of_face = np.zeros(len(corners), np.int64)
            of_face = np.where((of_face >= 0) & (of_face < len(colours)), of_face, 0)
            vertices.append(places[corners].reshape(-1, 3))
            rgb.append(np.repeat(colours[of_face], 3, axis=0))
            faces.append(start + np.arange(3 * len(corners)).reshape(-1, 3))
            start += 3 * len(corners)
            element.append(np.full(len(corners), len(names)))
            names.append(_name(file.by_id(shape.id)))
        going = shapes.next()
    if not faces:
        raise ValueError("it holds no shape")
    places, notes = _on_map(file, np.concatenate(vertices))
    about = np.array(json.dumps({"names": names, "notes": notes}))
    return {"vertices": places, "faces": np.concatenate(faces).astype(np.int32), "rgb": np.concatenate(rgb),
            "element": np.concatenate(element).astype(np.int32), "about": about}


def _rgb(material: Any) -> tuple[int, int, int]:
    colour = material.diffuse
    values = [colour.r(), colour.g(), colour.b()] if hasattr(colour, "r") else list(colour)[:3]
    if not all(np.isfinite(value) and value >= 0 for value in values):
        return _GREY
    red, green, blue = (min(round(255 * value), 255) for value in values)
    return red, green, blue


def _name(entity: Any) -> str:
    """Such as "IfcWall North wall", by its name, else its tag or identifier."""
    given = getattr(entity, "Name", None) or getattr(entity, "Tag", None) or entity.GlobalId
    return f"{entity.is_a()} {given}"[:200]


def _on_map(file: Any, places: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Places in metres of the project to those of the map, and what was found of it."""
    if file.schema == "IFC2X3" or not (found := file.by_type("IfcMapConversion")):
        return places, ["no georeference (IfcMapConversion)"]
    conversion = found[0]
    project = float(import_module(_UNITS).calculate_unit_scale(file))
    crs = conversion.TargetCRS
    unit = getattr(crs, "MapUnit", None)
    metre = project if unit is None else float(_metres(unit))
    stated = getattr(conversion, "Scale", None) or 1.0
    scale = float(stated) * metre / project
    notes = [f"georeference {getattr(crs, 'Name', None) or 'without a name'} (IfcMapConversion)"]
    if abs(scale - 1) > _SAME and stated == 1.0:
        scale = 1.0
        notes.append("its scale of 1 does not fit the units of project and map and is left out")
    along = conversion.XAxisAbscissa
    turn = np.arctan2(conversion.XAxisOrdinate or 0.0, 1.0 if along is None else along)
    x, y, z = (scale * places).T
    shift = metre * np.array([conversion.Eastings, conversion.Northings, conversion.OrthogonalHeight], np.float64)
    there = np.column_stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z]) + shift
    return there, notes


def _metres(unit: Any) -> float:
    """Of a named unit of length."""
    if unit.is_a("IfcConversionBasedUnit"):
        factor = unit.ConversionFactor
        return float(factor.ValueComponent.wrappedValue) * _metres(factor.UnitComponent)
    return float(import_module(_UNITS).get_prefix_multiplier(unit.Prefix))
