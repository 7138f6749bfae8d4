"""What libraries give that declare no types, or declare less than they do, as Any: type checkers ask nothing of it."""

from importlib import import_module
from pathlib import Path
from typing import Any

import laspy

lazrs: Any = import_module("lazrs")
libe57: Any = import_module("pye57.libe57")


def any_typed(value: object) -> Any:
    """The value itself, which a type checker takes for anything."""
    return value


def read_las(path: str | Path) -> Any:
    """laspy's LasData, whose dimensions are attributes that behave as arrays."""
    return laspy.read(path)


def polylines(drawing: Any, layer: str) -> list[Any]:
    """The polylines of a layer of a drawing that ezdxf read."""
    return list(drawing.modelspace().query(f'LWPOLYLINE[layer=="{layer}"]'))
