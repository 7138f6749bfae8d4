"""Traced lines of a cut as a flat DXF drawing: polylines, dimensions, a frame of coordinates, texts; a layer for each.  By
ezdxf.

Coordinates are those of the paper in file units: of a plan the x and y of the file, of a section the length along its line and
the height, of an elevation the coordinate to the right and the height.  z is 0.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...common.text import printable
from ..dimensioning.dimensions import CutDimensions, laid_apart
from ..dimensioning.dxf_texts import STYLE, add_dimension, add_styles, save_drawing
from ..measuring.measure_dxf import INSUNITS
from ..measuring.measure_text import unit_name
from .cut_lines import Polyline, Trace
from .paper_layout import grid_places, grid_text

CUT, FRAME, GRID, TEXT, DIMENSIONS = LAYERS = ("POINTGLASS CUT", "POINTGLASS FRAME", "POINTGLASS GRID", "POINTGLASS TEXT",
                                               "POINTGLASS DIMENSIONS")
_COLOURS = {CUT: 7, FRAME: 8, GRID: 8, TEXT: 8, DIMENSIONS: 5}
"""Indices of AutoCAD's colours: 7 is black on white, 8 grey, 5 blue."""
_CUT_WEIGHT = 35
"""Width of lines of the layer CUT, hundredths of a millimetre."""
_NOT_IN_NAMES = frozenset('<>/\\":;?*=|`,')
_HEIGHT, _BESIDE = 0.08, 0.25
"""Height of texts and length of ticks, and the border around what is drawn, in steps of the grid."""
_WIDTH = 0.75
"""Of a letter, in heights of the text: of Arial, whose letters are narrower in the mean."""


def write_cut_dxf(path: Path, trace: Trace, low: np.ndarray, high: np.ndarray, step: float, texts: Sequence[str],
                  metres_per_unit: float | None,
                  models: Sequence[tuple[str, int, Sequence[Polyline]]] = (),
                  dimensions: CutDimensions | None = None) -> None:  # fmt: skip
    """Writes the drawing to an open path; the caller replaces an older file.

    low, high: (2,) paper coordinates of what was measured in the cut.  step: of the grid, file units.  texts: lines beneath the
    frame.  models: name, AutoCAD's colour and lines of each mesh, on a layer of its own.
    dimensions: are laid apart here.  Raises OSError.
    """
    import ezdxf

    unit = INSUNITS.get(unit_name(metres_per_unit), 0)
    drawing = ezdxf.new("R2010", units=unit)  # type: ignore[reportPrivateImportUsage]
    for layer, colour in _COLOURS.items():
        drawing.layers.add(layer, color=colour, lineweight=_CUT_WEIGHT if layer == CUT else 13)
    space = drawing.modelspace()
    for line in trace.lines:
        space.add_lwpolyline(line.vertices.tolist(), close=line.closed, dxfattribs={"layer": CUT})
    for number, (name, colour, lines) in enumerate(models, 1):
        layer = model_layer(name, number)
        drawing.layers.add(layer, color=colour, lineweight=_CUT_WEIGHT)
        for line in lines:
            space.add_lwpolyline(line.vertices.tolist(), close=line.closed, dxfattribs={"layer": layer})
    (left, bottom), (right, top) = low - _BESIDE * step, high + _BESIDE * step
    edge = [(left, bottom), (right, bottom), (right, top), (left, top)]
    space.add_lwpolyline(edge, close=True, dxfattribs={"layer": FRAME})
    size = _HEIGHT * step
    add_styles(drawing, size)
    measured, frame = dimensions or CutDimensions(), np.array(edge)[[0, 2]]

    def width(text: str) -> float:
        return _WIDTH * size * len(text)

    for text in measured.texts:
        if text.outline is not None:
            space.add_lwpolyline(text.outline.tolist(), close=True, dxfattribs={"layer": DIMENSIONS})
        for middle, line in zip(text.middles(size, width, frame), text.lines, strict=True):
            space.add_mtext(printable(line), {"layer": DIMENSIONS, "style": STYLE, "char_height": size, "attachment_point": 5,
                                              "insert": tuple(middle.tolist())})
    for each in laid_apart(measured.lines, size, width, frame, measured.texts):
        add_dimension(space, np.array([each.start, each.end]), each.offset, printable(each.text), each.digits, DIMENSIONS)
    xs, ys = grid_places(left, right, step), grid_places(bottom, top, step)
    for x in xs:
        for y, way in ((bottom, -size), (top, size)):
            space.add_line((x, y), (x, y + way), dxfattribs={"layer": FRAME})
        _text(space, grid_text(x, step), (x - size, bottom - 3.0 * size), size)
        for y in ys:
            space.add_line((x - size, y), (x + size, y), dxfattribs={"layer": GRID})
            space.add_line((x, y - size), (x, y + size), dxfattribs={"layer": GRID})
    for y in ys:
        for x, way in ((left, -size), (right, size)):
            space.add_line((x, y), (x + way, y), dxfattribs={"layer": FRAME})
        _text(space, grid_text(y, step), (left - 2.0 * size, y - size), size, rotation=90.0)
    for row, text in enumerate(texts):
        _text(space, printable(text), (left, bottom - (6.0 + 2.0 * row) * size), size)
    save_drawing(drawing, path)


def model_layer(name: str, number: int) -> str:
    """The layer of a mesh: its number, from 1, and name without the characters that layers may not have."""
    allowed = "".join("_" if letter in _NOT_IN_NAMES else letter for letter in printable(name))
    return f"POINTGLASS MODEL {number} {allowed}"[:255]


def _text(space, text: str, place: tuple[float, float], height: float, rotation: float = 0.0) -> None:
    space.add_text(text, height=height, rotation=rotation, dxfattribs={"layer": TEXT, "style": STYLE}).set_placement(place)
