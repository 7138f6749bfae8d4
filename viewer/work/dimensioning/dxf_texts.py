"""Texts and dimensions in a DXF drawing, in one style: Arial, which has the letters of most scripts where a program has it.

A dimension is a DIMENSION, which CAD programs measure, edit and move, with ticks for arrows; its text stands over its line.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace

STYLE = "POINTGLASS"
"""Name of the style of texts and of that of dimensions."""
_TICK, _BESIDE = 0.4, 0.35
"""Length of a tick, and the gap at the line and beyond it, in heights of the text."""


def add_styles(drawing: "Drawing", height: float) -> None:
    """Adds the styles to a drawing.  height: of the texts of dimensions, in its unit."""
    drawing.styles.add(STYLE, font="arial.ttf")
    # names of AutoCAD: text over the line and along it, ticks, a decimal point, zeros at the end kept
    looks = {"dimtxt": height, "dimtxsty": STYLE, "dimtad": 1, "dimtih": 0, "dimtoh": 0, "dimtix": 1, "dimtmove": 0,
             "dimjust": 0, "dimtsz": _TICK * height, "dimasz": _TICK * height, "dimgap": _BESIDE * height,
             "dimexo": _BESIDE * height, "dimexe": _BESIDE * height, "dimdsep": ord("."), "dimzin": 0, "dimlfac": 1.0,
             "dimscale": 1.0, "dimtofl": 1}  # fmt: skip
    drawing.dimstyles.add(STYLE, dxfattribs=looks)


def save_drawing(drawing: "Drawing", path: Path) -> None:
    """Writes a drawing to an open path, with its extents, which CAD programs show first.  Raises OSError."""
    from ezdxf import bbox

    space = drawing.modelspace()
    extents = bbox.extents(space, fast=True)
    if extents.has_data:
        space.reset_extents(extents.extmin, extents.extmax)
        width, height, _ = extents.size
        drawing.set_modelspace_vport(max(height, width / 2, 1e-3), extents.center.vec2)
    drawing.saveas(path)


def add_dimension(space: "Modelspace", ends: np.ndarray, offset: float, text: str, digits: int, layer: str,
                  up: np.ndarray | None = None) -> None:
    """Adds the dimension of a length above 0.

    ends: (2, 2), or (2, 3) with ``up``: (3,) the direction in which the dimension line lies off them, as far as it is at right
    angles to them.  offset: of the line, to the left of the way from the first end to the second.  text: ``<>`` stands for the
    length.  digits: after its point.
    """
    from ezdxf.math import UCS

    frame, points = None, [tuple(end) for end in ends.tolist()]
    if up is not None:
        along = ends[1] - ends[0]
        length = float(np.linalg.norm(along))
        along = along / length
        across = up - (up @ along) * along
        if np.linalg.norm(across) < 1e-3:
            across = np.eye(3)[np.abs(along).argmin()]
            across = across - (across @ along) * along
        frame = UCS(ends[0].tolist(), along.tolist(), (across / np.linalg.norm(across)).tolist())
        points = [(0.0, 0.0), (length, 0.0)]
    made: Any = space.add_aligned_dim(points[0], points[1], offset, text, STYLE, {"dimdec": digits}, {"layer": layer})
    made.render(ucs=frame)
