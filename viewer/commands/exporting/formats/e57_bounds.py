"""Bounds of the records that are written of a scan of E57, in the scan's own frame: metres and radians."""

from typing import Any

import numpy as np

from ....readers.e57.e57_nodes import library
from .e57_file import NodeCopy

_FIELDS = ("cartesianX", "cartesianY", "cartesianZ", "sphericalRange", "sphericalAzimuth", "sphericalElevation")
_CARTESIAN = {f"{axis}{end}": (f"cartesian{axis.upper()}", end) for axis in "xyz" for end in ("Minimum", "Maximum")}
_SPHERICAL = {
    "rangeMinimum": ("sphericalRange", "Minimum"), "rangeMaximum": ("sphericalRange", "Maximum"),
    "elevationMinimum": ("sphericalElevation", "Minimum"), "elevationMaximum": ("sphericalElevation", "Maximum"),
    "azimuthStart": ("sphericalAzimuth", "Minimum"), "azimuthEnd": ("sphericalAzimuth", "Maximum"),
}  # fmt: skip
"""Child of the bounds -> field, and which end of its values."""


class RecordBounds:
    """Lowest and highest coordinates of written records, Cartesian and spherical.  Records that have only Cartesian coordinates
    get the spherical ones computed from these."""

    def __init__(self) -> None:
        self._ends: dict[str, tuple[float, float]] = {}

    def add(self, fields, arrays: dict[str, np.ndarray], count: int) -> None:
        """fields: RawField of the records.  arrays: their values as stored, of which ``count`` are written."""
        if not count:
            return
        known = {field.name: np.asarray(field.scaled(arrays[field.name][:count]), np.float64)
                 for field in fields if field.name in _FIELDS}  # fmt: skip
        if known.keys() >= set(_FIELDS[:3]) and not known.keys() & set(_FIELDS[3:]):
            x, y, z = (known[name] for name in _FIELDS[:3])
            flat = np.hypot(x, y)
            known |= zip(_FIELDS[3:], (np.hypot(flat, z), np.arctan2(y, x), np.arctan2(z, flat)), strict=True)
        for name, values in known.items():
            low, high = self._ends.get(name, (np.inf, -np.inf))
            finite = values[np.isfinite(values)]
            if len(finite):
                self._ends[name] = min(low, float(finite.min())), max(high, float(finite.max()))

    def write(self, node: Any, made: Any, copy: NodeCopy, source: Any) -> None:
        """Sets the bounds that the scan ``node`` of the file ``source`` has in the new scan ``made``.  Azimuths that pass from
        +180 to -180 degrees are kept: they hold a part of the records too."""
        for name, children in (("cartesianBounds", _CARTESIAN), ("sphericalBounds", _SPHERICAL)):
            if not node.isDefined(name):
                continue
            old, libe57 = node[name], library()
            turned = old.isDefined("azimuthStart") and old.isDefined("azimuthEnd") and _value(old, "azimuthStart") > _value(
                old, "azimuthEnd")  # fmt: skip
            bounds = libe57.StructureNode(copy.image)
            for index in range(old.childCount()):
                child = old[index]
                field, end = children.get(child.elementName(), ("", ""))
                if field not in self._ends or (turned and field == "sphericalAzimuth"):
                    bounds.set(child.elementName(), copy.copied(child, source))
                else:
                    value = self._ends[field][end == "Maximum"]
                    bounds.set(child.elementName(), libe57.FloatNode(copy.image, value, libe57.E57_DOUBLE))
            made.set(name, bounds)


def _value(structure: Any, name: str) -> float:
    node = structure[name]
    return float(node.scaledValue() if isinstance(node, library().ScaledIntegerNode) else node.value())
