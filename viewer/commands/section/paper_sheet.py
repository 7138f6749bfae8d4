"""A drawing on a sheet of standard paper: frame, coordinate grid, traced lines and title block as vectors, points as a picture.

One pixel of the drawing is 1/dpi inch of paper: a length measured on the print times the scale is the length in the scan.
Frame of the page: millimetres from its lower left corner (viewer.work.sheets.paper_layout).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...work.sheets.paper_layout import Layout, grid_places, grid_step, grid_text
from .draw_dimensions import draw_dimensions
from .model_lines import draw_models
from .sheet_text import POINTS, text_width, write
from .title_block import INK, MIDDLE, QUIET, THICK, THIN, Facts, draw_strip

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...work.dimensioning.dimensions import CutDimensions
    from ...work.sheets.cut_lines import Trace
    from .model_lines import ModelLines
    from .orthographic import Drawing

MM = 25.4
"""Of an inch."""
_GRID = {"A4": 25.0, "A3": 30.0, "A2": 40.0, "A1": 50.0, "A0": 60.0}
"""Millimetres between two lines of the grid, at least: a label has room between them."""
_CROSS, _TICK = 1.5, 2.0
"""Half the length of a cross of the grid, and of a tick at the edge, millimetres."""
_TEXT = 1.9 * POINTS


class PaperTransform:
    """Paper coordinates of the cut (file units) to millimetres of the page, such that pixels of the drawing are those of a PNG.

    middle: (2,) paper coordinates of what lies in the middle of the layout's area.
    """

    def __init__(self, drawing: "Drawing", layout: Layout, dpi: int, middle: np.ndarray):
        left, bottom, width, height = layout.area
        self._pixel = MM / dpi
        column, row = drawing.pixel_of(np.asarray(middle)[None])[0]
        self.column = round((left + width / 2) / self._pixel - column)
        """Of the page's pixels: where the drawing's left edge lies."""
        self.row = round((bottom + height / 2) / self._pixel + row)
        """Pixels from the page's lower edge to the drawing's upper one."""
        self._drawing = drawing

    def page(self, paper: np.ndarray) -> np.ndarray:
        """(n, 2) millimetres of (n, 2) paper coordinates."""
        pixels = self._drawing.pixel_of(paper)
        return np.stack([self.column + pixels[:, 0], self.row - pixels[:, 1]], axis=1) * self._pixel

    def paper(self, page: np.ndarray) -> np.ndarray:
        """(n, 2) paper coordinates of (n, 2) millimetres."""
        pixels = np.asarray(page, np.float64) / self._pixel
        drawing = self._drawing
        return np.stack([drawing.left + (pixels[:, 0] - self.column) * drawing.pixel,
                         drawing.top - (self.row - pixels[:, 1]) * drawing.pixel], axis=1)  # fmt: skip


def paper_sheet(drawing: "Drawing", layout: Layout, dpi: int, middle: np.ndarray, facts: Facts, axes: tuple[str, str], *,
                metres: float, scale: float, trace: "Trace | None" = None, models: "Sequence[ModelLines]" = (),
                dimensions: "CutDimensions | None" = None, whole_pixels: bool = False) -> "Figure":  # fmt: skip
    """The sheet as a matplotlib figure.

    middle: (2,) paper coordinates in the middle of the sheet.  axes: names of the coordinates to the right and upwards.
    metres: of a file unit.  whole_pixels: the page has the pixels of a PNG, which are whole; else the paper's exact size.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    inches = np.array(layout.sides) / MM
    if whole_pixels:
        inches = np.round(inches * dpi) / dpi
    figure = Figure(figsize=(float(inches[0]), float(inches[1])), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    place = PaperTransform(drawing, layout, dpi, middle)
    _picture(figure, drawing, layout, place, dpi)
    page = figure.add_axes((0, 0, 1, 1), frameon=False, zorder=2)
    page.set(xlim=(0, inches[0] * MM), ylim=(0, inches[1] * MM), xticks=[], yticks=[], autoscale_on=False)
    _grid(page, layout, place, axes, grid_step(scale, metres, _GRID[layout.size]))
    if trace is not None:
        left, bottom, width, height = layout.area
        edge = Rectangle((left, bottom), width, height, transform=page.transData)
        for line in trace.lines:
            ring = np.concatenate([line.vertices, line.vertices[:1]]) if line.closed else line.vertices
            for drawn in page.plot(*place.page(ring).T, color=INK, linewidth=MIDDLE, solid_joinstyle="miter"):
                drawn.set_clip_path(edge)
    left, bottom, width, height = layout.area
    edge = Rectangle((left, bottom), width, height, transform=page.transData)
    draw_models(page, models, MIDDLE, placed=place.page, edge=edge, corner=(left, bottom + height),
                traced=INK if trace is not None and trace.lines else None)
    corners = place.paper(np.array([[left, bottom], [left + width, bottom + height]]))
    if dimensions is not None:
        draw_dimensions(page, dimensions, scale / 1000 / metres, corners, placed=place.page, edge=edge)
    for rectangle, width in ((layout.frame, THICK), (layout.area, THIN)):
        page.add_patch(Rectangle(rectangle[:2], *rectangle[2:], fill=False, edgecolor=INK, linewidth=width, joinstyle="miter"))
    draw_strip(page, layout, facts)
    return figure


def _picture(figure: "Figure", drawing: "Drawing", layout: Layout, place: PaperTransform, dpi: int) -> None:
    """The drawing's pixels, cut at the edge of its area, where no point lies."""
    left, bottom, width, height = (value / MM * dpi for value in layout.area)
    rows, columns = drawing.image.shape[:2]
    first = max(int(np.ceil(left)) - place.column, 0), max(place.row - int(bottom + height), 0)
    last = min(int(left + width) - place.column, columns), min(place.row - int(np.ceil(bottom)), rows)
    if last[0] <= first[0] or last[1] <= first[1]:
        return
    image = drawing.image[first[1] : last[1], first[0] : last[0]]
    across, up = figure.get_size_inches() * dpi
    axes = figure.add_axes(((place.column + first[0]) / across, (place.row - last[1]) / up, image.shape[1] / across,
                            image.shape[0] / up), frameon=False, zorder=1)  # fmt: skip
    axes.imshow(image, interpolation="none", aspect="auto")
    axes.set(xticks=[], yticks=[])


def _grid(page: Any, layout: Layout, place: PaperTransform, names: tuple[str, str], step: float) -> None:
    """Crosses where coordinates are round, ticks at the edge, and labels around it."""
    left, bottom, width, height = layout.area
    corners = place.paper(np.array([[left, bottom], [left + width, bottom + height]]))
    xs, ys = (grid_places(corners[0, axis], corners[1, axis], step) for axis in (0, 1))
    at_x = place.page(np.stack([xs, np.full(len(xs), corners[0, 1])], axis=1))[:, 0]
    at_y = place.page(np.stack([np.full(len(ys), corners[0, 0]), ys], axis=1))[:, 1]
    for x in at_x:
        for y in at_y:
            page.plot([x - _CROSS, x + _CROSS], [y, y], color=QUIET, linewidth=THIN)
            page.plot([x, x], [y - _CROSS, y + _CROSS], color=QUIET, linewidth=THIN)
    band = layout.area[0] - layout.frame[0]
    looks: dict[str, Any] = {"color": INK, "ha": "center", "va": "center"}
    names = tuple(f"{name} →" for name in names)  # type: ignore[assignment]
    taken = [text_width(name, _TEXT) + 3.0 for name in names]
    for x, value in zip(at_x, xs, strict=True):
        text = grid_text(value, step)
        half = text_width(text, _TEXT) / 2 + 1.0
        for y, inward, free in ((bottom, 1, taken[0]), (bottom + height, -1, 0.0)):
            page.plot([x, x], [y, y + inward * _TICK], color=INK, linewidth=THIN)
            if left + half <= x <= left + width - half - free:
                write(page, x, y - inward * band / 2, text, _TEXT, **looks)
    for y, value in zip(at_y, ys, strict=True):
        text = grid_text(value, step)
        half = text_width(text, _TEXT) / 2 + 1.0
        for x, inward, free in ((left, 1, taken[1]), (left + width, -1, 0.0)):
            page.plot([x, x + inward * _TICK], [y, y], color=INK, linewidth=THIN)
            if bottom + half <= y <= bottom + height - half - free:
                write(page, x - inward * band / 2, y, text, _TEXT, rotation=90, **looks)
    write(page, left + width - 1.0, bottom - band / 2, names[0], _TEXT, color=QUIET, ha="right", va="center")
    write(page, left - band / 2, bottom + height - 1.0, names[1], _TEXT, color=QUIET, ha="center", va="top", rotation=90)
