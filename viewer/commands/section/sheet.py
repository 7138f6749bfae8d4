"""A drawing on a sheet of paper: frame with coordinates, title, scale bar and north arrow, as PNG or PDF to scale.

One pixel of the drawing is 1/dpi inch of paper, in both formats: a length measured on the print times the scale is the length
in the scan.  The sheet is as large as the drawing and its borders.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.files.atomic_write import passes_through, write_atomic
from ... import __version__
from ...common.errors import InputError
from ...common.fonts import families, in_order
from ...common.text import counted
from ...work.measuring.measure_text import unit_name
from .cut import KINDS
from .draw_dimensions import draw_dimensions
from .model_lines import draw_models
from .sheet_text import fitting

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...grid.scene import Scene
    from ...work.dimensioning.dimensions import CutDimensions
    from ...work.sheets.cut_lines import Trace
    from .model_lines import ModelLines
    from .orthographic import Drawing

SUFFIXES = (".png", ".pdf", ".dxf")
INCH = 0.0254
"""Metres."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 20.0, 10.0, 10.0, 36.0
"""Borders around the drawing, millimetres; the title lies at the bottom."""
_NARROWEST = 150.0
"""Width of a sheet, at least, millimetres: the title's."""
_TICKS = 14.0
"""Millimetres between two labelled coordinates, at least."""
_BAR = (25.0, 62.0)
"""Shortest and longest scale bar, millimetres."""
_INK, _QUIET = "#16191d", "#6a7078"
CUT_WIDTH = 1.0
"""Of traced lines, points: 0.35 mm."""
_COMPASS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


@dataclass(frozen=True)
class Paper:
    """scale: such as 50 for 1:50.  dpi: pixels an inch.  metres: of a file unit.  assumed: whether the file names no unit."""

    scale: float
    dpi: int
    metres: float
    assumed: bool

    @property
    def millimetre(self) -> float:
        """File units of a millimetre of paper."""
        return self.scale / 1000 / self.metres

    @property
    def pixel(self) -> float:
        """File units of one pixel."""
        return INCH / self.dpi * self.scale / self.metres


def round_length(least: float) -> float:
    """The smallest of 1, 2 and 5 times a power of ten that is not below ``least``."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= least * (1 - 1e-12)))


def write_figures(out: Path, figures: Sequence[tuple["Figure", int]]) -> None:
    """Writes sheets with their pixels an inch: a PNG of one, or a PDF with a page for each.  Raises InputError; then nothing is
    left behind."""
    data = BytesIO()
    _save(figures, data, out.suffix.lower().removeprefix("."))
    write_whole(out, lambda beside: beside.write_bytes(data.getvalue()))


def drawn_texts(figures: Iterable["Figure"]) -> list[str]:
    """All texts of figures, as they are drawn."""
    from matplotlib.text import Text

    return [text.get_text() for figure in figures for text in figure.findobj(Text) if isinstance(text, Text)]


def write_whole(out: Path, writer: Callable[[Path], object]) -> None:
    """Writes a file beside its place and renames it.  Raises InputError where it cannot be written."""
    try:
        write_atomic(out, writer)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=out,
                         remedy="make room, or choose another place for it") from None


def check_out(out: Path) -> None:
    """Raises InputError where a sheet cannot be written there."""
    if out.suffix.lower() not in SUFFIXES:
        raise InputError(f"{out.suffix or 'no ending'} is not written", option="--out", value=out,
                         remedy=f"use {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
    check_place(out)


def check_place(out: Path) -> None:
    """Raises InputError where no file can be written at that place."""
    if out.is_dir() or passes_through(out):
        raise InputError("is not a file that can be replaced", option="--out", value=out, remedy="choose another name")
    if not out.parent.is_dir():
        raise InputError("its folder does not exist", option="--out", value=out, remedy=f"make {out.parent} first")


def _save(figures: Sequence[tuple["Figure", int]], data: BytesIO, kind: str) -> None:
    import matplotlib as mpl
    from matplotlib.backends.backend_pdf import PdfPages

    # no date, so that the same section gives the same bytes; type 42: text stays text
    with mpl.rc_context({"pdf.fonttype": 42, "svg.hashsalt": "pointglass"}):
        if kind == "pdf":
            with PdfPages(data, metadata={"CreationDate": None, "Creator": f"pointglass {__version__}"}) as pages:
                for figure, dpi in figures:
                    pages.savefig(figure, dpi=dpi)
        else:
            ((figure, dpi),) = figures
            figure.savefig(data, format=kind, dpi=dpi, metadata={"Software": f"pointglass {__version__}"})


def borders(drawing: "Drawing", paper: Paper) -> tuple[int, int, int, int]:
    """(left, top, width, height), pixels: where the drawing lies on the sheet, and the sheet's size."""
    rows, columns = drawing.image.shape[:2]
    left, right, top, bottom, narrowest = (round(millimetres / 1000 / INCH * paper.dpi)
                                           for millimetres in (_LEFT, _RIGHT, _TOP, _BOTTOM, _NARROWEST))
    width = max(left + columns + right, narrowest)
    return left + (width - left - columns - right) // 2, top, width, top + rows + bottom


def sheet(drawing: "Drawing", paper: Paper, scene: "Scene", title: str, trace: "Trace | None" = None,
          models: "Sequence[ModelLines]" = (), dimensions: "CutDimensions | None" = None) -> "Figure":  # fmt: skip
    """The sheet as a matplotlib figure, with traced lines, those of meshes and dimensions where there are any."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    left, top, width, height = borders(drawing, paper)
    rows, columns = drawing.image.shape[:2]
    figure = Figure(figsize=(width / paper.dpi, height / paper.dpi), dpi=paper.dpi, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((left / width, 1 - (top + rows) / height, columns / width, rows / height))
    extent = (drawing.left, drawing.left + columns * drawing.pixel, drawing.top - rows * drawing.pixel, drawing.top)
    axes.imshow(drawing.image, extent=extent, interpolation="none", aspect="auto")
    for line in trace.lines if trace is not None else ():
        ring = np.concatenate([line.vertices, line.vertices[:1]]) if line.closed else line.vertices
        axes.plot(*ring.T, color=_INK, linewidth=CUT_WIDTH, solid_joinstyle="miter")
    draw_models(axes, models, CUT_WIDTH, traced=_INK if trace is not None and trace.lines else None)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    if dimensions is not None:
        draw_dimensions(axes, dimensions, paper.millimetre, np.array(extent).reshape(2, 2).T)
    step = round_length(_TICKS / 1000 * paper.scale / paper.metres)
    for axis, low, high in ((axes.xaxis, extent[0], extent[1]), (axes.yaxis, extent[2], extent[3])):
        ticks = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step + 0.0  # no -0
        axis.set_ticks(ticks, [_number(value, step) for value in ticks])
    axes.tick_params(labelsize=6, width=0.5, length=3, color=_INK, labelcolor=_INK, pad=2)
    for label in axes.get_yticklabels():
        label.set(rotation=90, verticalalignment="center")
    for spine in axes.spines.values():
        spine.set(linewidth=0.5, color=_INK, position=("outward", 1.5))
    _title(figure, drawing, paper, scene, title)
    return figure


def _number(value: float, step: float) -> str:
    return f"{value:.{max(0, -int(np.floor(np.log10(step) + 1e-9)))}f}"


def _title(figure: "Figure", drawing: "Drawing", paper: Paper, scene: "Scene", title: str) -> None:
    """Title, facts, scale bar and north arrow below the drawing, lengths in millimetres of the sheet."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon, Rectangle

    width, height = figure.get_size_inches() * INCH * 1000

    def at(x: float, y: float) -> tuple[float, float]:
        return x / width, y / height

    cut = drawing.cut
    figure.add_artist(Line2D([10 / width, 1 - 10 / width], [23 / height] * 2, color=_INK, linewidth=0.8))
    metres = round_length(_BAR[0] / 1000 * paper.scale)
    length = metres / paper.scale * 1000
    right = width - 24
    room = right - length - 10 - 4  # the scale bar lies beside the title
    caption = f"{KINDS[cut.kind].capitalize()} {cut.text}   ·   1:{paper.scale:g}"
    for y, text, size, weight in ((16.5, title, 10, "bold"), (11.5, caption, 7.5, "normal")):
        text, fits = fitting(text, room, size, weight == "bold")
        figure.text(*at(10, y), in_order(text), fontsize=fits, fontweight=weight, color=_INK, parse_math=False,
                    fontfamily=families(text))
    unit = unit_name(paper.metres) + (" (assumed: the file names no unit)" if paper.assumed else "")
    crs = scene.meta.crs
    frame = f"coordinates in {unit}" + (f", {short_reference(crs)}" if crs else "")
    facts = f"{counted(drawing.count, 'measured point')}, spacing {scene.spacing:.3g}   ·   {frame}"
    facts, fits = fitting(facts, width - 20, 6)
    figure.text(*at(10, 7.2), facts, fontsize=fits, color=_QUIET, parse_math=False)
    figure.text(*at(10, 4.0), f"pointglass {__version__}: nothing filled, nothing repainted", fontsize=6, color=_QUIET)
    parts = 4
    for part in range(parts):
        corner = right - length + part * length / parts
        figure.add_artist(Rectangle(at(corner, 13), length / parts / width, 1.6 / height, linewidth=0.4, edgecolor=_INK,
                                    facecolor=_INK if part % 2 == 0 else "white", transform=figure.transFigure))
    for place, text in ((0.0, "0"), (0.5, f"{metres / 2:g}"), (1.0, f"{metres:g} m")):
        figure.text(*at(right - length + place * length, 15.8), text, fontsize=6, color=_INK, ha="center")
    if cut.kind == "plan":
        tip = [(0.0, 7.0), (2.2, 0.0), (0.0, 1.6), (-2.2, 0.0)]
        figure.add_artist(Polygon([at(width - 13.5 + x, 10.5 + y) for x, y in tip], closed=True, facecolor=_INK,
                                  transform=figure.transFigure))
        figure.text(*at(width - 13.5, 18.3), "N" if crs else "Y", fontsize=7, fontweight="bold", color=_INK, ha="center")
    else:
        heading = np.degrees(np.arctan2(cut.forward[0], cut.forward[1])) % 360
        name = _COMPASS[round(heading / 45) % 8]
        figure.text(*at(width - 13.5, 13), f"looking\n{name if crs else ''} {heading:.0f}°".replace("\n ", "\n"), fontsize=6,
                    color=_INK, ha="center", linespacing=1.3)


def short_reference(text: str, most: int = 60) -> str:
    text = " ".join(text.split())
    if text.startswith(("PROJCS", "GEOGCS", "COMPD_CS", "PROJCRS", "GEOGCRS", "COMPOUNDCRS")) and text.count('"') > 1:
        text = text.split('"')[1]
    return text if len(text) <= most else text[: most - 1] + "…"
