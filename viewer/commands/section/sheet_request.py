"""What is asked of a sheet besides the cut, and the sheet that is made: on standard paper or as large as its drawing; or a DXF.

The command line and the window's Section tool make their sheets here.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ... import __version__
from ...common.text import counted
from ...picture.meshes.mesh_layer import MeshLayer
from ...work.measuring.measure_text import unit_name
from ...work.measuring.measurement import Measurement
from ...work.selection import Selection
from ...work.sheets.cut_lines import Trace, trace
from ...work.sheets.grid_north import axis_name, has_grid_north
from ...work.sheets.paper_layout import fitted
from .cut import KINDS, Cut, cut_slab
from .draw_dimensions import cut_dimensions, short_text
from .model_lines import ModelLines, model_lines, model_text, widened
from .orthographic import draw, slab_extent, slab_points
from .paper_sheet import paper_sheet
from .sheet import INCH, Paper, round_length, sheet, short_reference, write_whole
from .title_block import Facts, bar_room

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...grid.scene import Scene

THICKNESS = 0.2
"""Metres of a plan or section, unless given."""
SCALE, DPI = 50.0, 300
"""Of a sheet that is as large as its drawing, unless given."""
_DXF_GRID, _DXF_MILLIMETRES = 8.0, 30.0
"""Steps of the grid of a DXF along its longer side, at most; millimetres of a step, were it printed at no given scale."""


@dataclass(frozen=True)
class SheetRequest:
    """scale: N of 1:N; None: 50, on standard paper the largest that fits.  dpi: pixels an inch; None: the usual.

    paper: a key of paper_layout.SIZES; None: the sheet is as large as its drawing.  orientation: "landscape", "portrait", None:
    whichever fits better.  title: "" for the scan's.  date: "" for today.  lines: whether lines are traced.  picture: whether
    the points are drawn.
    """

    scale: float | None = None
    dpi: int | None = None
    paper: str | None = None
    orientation: str | None = None
    title: str = ""
    author: str = ""
    date: str = ""
    lines: bool = False
    picture: bool = True


@dataclass(frozen=True, eq=False)
class Sheet:
    """A sheet that was drawn.  count: measured points.  trace: None where no lines were traced.  models: that the cut meets.
    remarks: what was left out, lines for a person."""

    figure: "Figure"
    dpi: int
    scale: float
    count: int
    trace: Trace | None
    models: tuple[ModelLines, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height, millimetres."""
        width, height = self.figure.get_size_inches() * INCH * 1000
        return float(width), float(height)


def paper_of(scene: "Scene", scale: float, dpi: int = DPI) -> Paper:
    """A sheet for a scene; where its unit is unknown it is taken as the metre, and the sheet says so."""
    metres = scene.meta.metres_per_unit
    return Paper(scale, dpi, float(metres or 1.0), assumed=not metres)


def make_sheet(selection: Selection, cut: Cut, request: SheetRequest, *, meshes: Sequence[MeshLayer] = (),
               measurements: Sequence[Measurement] = (), number: str = "1", png: bool = False) -> Sheet:  # fmt: skip
    """Draws a cut of the points in sight.

    meshes: beside the scan, which are cut.  measurements: of which lengths in the cut become dimensions.
    number: of the sheet, in the title block.  png: whether pixels will be whole.
    Raises InputError where the cut holds no point, a given scale does not fit, or the drawing is too large.
    """
    scene = selection.scene
    models = model_lines(meshes, cut, (*selection.clips, *selection.within))
    extent = widened(slab_extent(selection, cut), models)
    lines = traced(selection, cut) if request.lines else None
    if request.paper is None:
        paper = paper_of(scene, request.scale or SCALE, request.dpi or DPI)
        drawing = draw(selection, cut, paper.pixel, extent, picture=request.picture)
        shown = cut_dimensions(cut, measurements, unit_name(paper.metres), paper.millimetre)
        figure = sheet(drawing, paper, scene, request.title or scene.meta.title, lines, models,
                       shown)
        return Sheet(figure, paper.dpi, paper.scale, extent[2], lines, models, tuple(short_text(shown)))
    low, high, count = extent
    metres = float(scene.meta.metres_per_unit or 1.0)
    size = (high - low)[:2] * metres
    layout, scale = fitted(request.paper, request.orientation, (float(size[0]), float(size[1])), request.scale)
    dpi = request.dpi or layout.dpi
    paper = paper_of(scene, scale, dpi)
    drawing = draw(selection, cut, paper.pixel, extent, picture=request.picture)
    room = bar_room(layout)
    bar = max(round_length(share * room / 1000 * scale) for share in (0.2, 0.4, 0.5))
    bar = bar if bar / scale * 1000 <= room else round_length(0.2 * room / 1000 * scale)
    picture = f"{counted(count, 'point')}, spacing {scene.spacing:.3g}, {dpi} dpi" if request.picture else "left out"
    facts = Facts(
        title=request.title or scene.meta.title, scan=scene.meta.title, kind=f"{KINDS[cut.kind].capitalize()} {cut.text}",
        scale=f"1:{scale:g}", paper=f"{layout.size} {layout.orientation}", date=request.date or time.strftime("%Y-%m-%d"),
        author=request.author, number=number, reference=reference_of(scene), picture=picture,
        notes=(*_line_notes(lines, unit_name(metres)), f"pointglass {__version__}: nothing filled, nothing repainted"),
        north=cut.kind == "plan" and has_grid_north(scene.meta, cut_up(cut)), bar=(bar, bar / scale * 1000),
    )  # fmt: skip
    shown = cut_dimensions(cut, measurements, unit_name(metres), paper.millimetre)
    figure = paper_sheet(drawing, layout, dpi, (low + high)[:2] / 2, facts, axes_of(cut), metres=metres, scale=scale,
                         trace=lines, models=models,
                         dimensions=shown, whole_pixels=png)
    return Sheet(figure, dpi, scale, count, lines, models, tuple(short_text(shown)))


def write_lines(out: Path, selection: Selection, cut: Cut, request: SheetRequest, meshes: Sequence[MeshLayer] = (),
                measurements: Sequence[Measurement] = ()) -> list[str]:
    """Traces the lines of a cut and writes them, those of meshes, and the measured lengths in the cut as dimensions, as a DXF
    drawing in the file's unit.  Returns what was drawn, and what was left out, lines for a person.  Raises InputError; then
    nothing is left behind."""
    from ...work.sheets.cut_dxf import write_cut_dxf

    scene, models = selection.scene, model_lines(meshes, cut, (*selection.clips, *selection.within))
    low, high, count = widened(slab_extent(selection, cut), models)
    lines = traced(selection, cut)
    unit = unit_name(scene.meta.metres_per_unit)
    size = float(max((high - low)[:2])) or 1.0
    step = round_length(size / _DXF_GRID)
    shown = cut_dimensions(cut, measurements, unit, _drawn_millimetre(scene, request, (high - low)[:2], step))
    texts = (request.title or scene.meta.title, f"{KINDS[cut.kind].capitalize()} {cut.text}",
             f"coordinates: {', '.join(axes_of(cut))}; {reference_of(scene, assumed=False)}",
             *_line_notes(lines, unit), *model_text(models, unit),
             f"{counted(count, 'measured point')}; {request.date or time.strftime('%Y-%m-%d')}; "
             f"{request.author + '; ' if request.author else ''}pointglass {__version__}")  # fmt: skip
    write_whole(out, lambda beside: write_cut_dxf(beside, lines, low[:2], high[:2], step, texts, scene.meta.metres_per_unit,
                                                  [(model.name, model.colour[1], model.lines) for model in models],
                                                  shown))
    return [f"{trace_text(lines, unit)}, in {out}", *model_text(models, unit), *short_text(shown)]


def _drawn_millimetre(scene: "Scene", request: SheetRequest, size: np.ndarray, step: float) -> float:
    """File units of a millimetre of the sheet that is asked for, so that a DXF has the dimensions of the PDF.  Without a scale
    or paper it has those of its own size, too: a drawing can be enlarged.  size: (2,) of the drawing.  step: of its grid."""
    scale = request.scale
    if scale is None and request.paper is not None:
        width, height = (size * float(scene.meta.metres_per_unit or 1.0)).tolist()
        scale = fitted(request.paper, request.orientation, (width, height), None)[1]
    if scale is not None:
        return paper_of(scene, scale).millimetre
    return min(paper_of(scene, SCALE).millimetre, step / _DXF_MILLIMETRES)


def traced(selection: Selection, cut: Cut) -> Trace:
    """The lines along what a cut cuts.  Raises InputError of an elevation without a cut plane."""
    scene = selection.scene
    slab = cut_slab(cut, THICKNESS / (scene.meta.metres_per_unit or 1.0))
    return trace(slab_points(selection, slab), scene.spacing or scene.cell_size / 16)


def trace_text(lines: Trace, unit: str) -> str:
    """What was traced, in a line."""
    if not lines.lines:
        return "no lines traced: nothing in the cut lies along lines"
    return (f"{counted(len(lines.lines), 'line')} traced, {lines.length:.4g} {unit} in all, scatter {lines.sigma:.2g} {unit}, "
            f"open where gaps exceed {lines.gap:.2g} {unit}")  # fmt: skip


def reference_of(scene: "Scene", *, assumed: bool = True) -> str:
    """Reference system and unit of coordinates.  assumed: whether a unit that the file does not name is taken as the metre, as
    a sheet, which has a scale, needs it."""
    metres = scene.meta.metres_per_unit
    unit = unit_name(metres if metres or not assumed else 1.0)
    unit += "" if metres else " (assumed: the file names no unit)" if assumed else " (the file names none)"
    return f"{short_reference(scene.meta.crs) if scene.meta.crs else 'none stated'}, {unit}"


def axes_of(cut: Cut) -> tuple[str, str]:
    """Names of the coordinates to the right and upwards on the sheet."""
    if cut.kind == "plan":
        return axis_name(cut.right) or "right", axis_name(cut.up) or "up"
    return "along the line" if cut.kind == "line" else axis_name(cut.right) or "right", "height"


def cut_up(cut: Cut) -> tuple[float, float, float]:
    """The up axis of a plan."""
    x, y, z = (0.0 - along for along in cut.forward)
    return x, y, z


def _line_notes(lines: Trace | None, unit: str) -> tuple[str, ...]:
    if lines is None:
        return ()
    if not lines.lines:
        return ("no lines traced: nothing lies along lines",)
    return (f"lines traced: scatter {lines.sigma:.2g} {unit} (1 sigma),", f"open where gaps exceed {lines.gap:.2g} {unit}")
