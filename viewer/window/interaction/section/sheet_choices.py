"""What a person chooses of a sheet besides the cut: paper, scale, title, author, traced lines.  And how it is drawn."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ....commands.section.cut import Cut
from ....commands.section.sheet_request import SCALE, SheetRequest, make_sheet, write_lines
from ....common.fonts import boxes_line
from ....picture.meshes.mesh_layer import MeshLayer
from ....work.measuring.measurement import Measurement
from ....work.selection import Selection
from ....work.sheets.paper_layout import SIZES
from ...kit.widgets import tooltip_beside
from ...saving.capture import name_kept
from .sheet_preview import preview_dpi

SCALES = (5, 10, 20, 50, 100, 200, 500, 1000)
FORMATS = {"PDF sheet": (".pdf",), "PNG sheet": (".png",), "DXF drawing of traced lines": (".dxf",)}
_AS_DRAWN = "as large as the drawing"


class SheetChoices:
    """paper: a key of paper_layout.SIZES; None: as large as the drawing.  scale: N of 1:N; None: the largest that fits.
    lines: whether the lines that are cut are traced.  dimensions: whether measured lengths in the
    cut are drawn.  title, author: of the title block."""

    def __init__(self) -> None:
        self.paper: str | None = None
        self.scale: int | None = int(SCALE)
        self.lines, self.dimensions = False, True
        self.title = self.author = ""

    def request(self, dpi: int | None = None) -> SheetRequest:
        """As the choices are now."""
        return SheetRequest(self.scale, dpi, self.paper, title=self.title, author=self.author, lines=self.lines)

    def measured(self, measurements: tuple[Measurement, ...]) -> tuple[Measurement, ...]:
        """Those that may be drawn as dimensions."""
        return measurements if self.dimensions else ()

    def panel(self, ui: Any) -> None:
        """The rows of the choices."""
        ui.set_next_item_width(-1)
        if ui.begin_combo("##paper", f"paper {self.paper}" if self.paper else _AS_DRAWN):
            for size in (None, *SIZES):
                if ui.selectable(size or _AS_DRAWN, size == self.paper)[0]:
                    self.paper = size
                    self.scale = None if size else int(SCALE)
            ui.end_combo()
        ui.set_next_item_width(-1)
        if ui.begin_combo("##scale", f"scale 1:{self.scale}" if self.scale else "largest scale that fits"):
            for scale in ((None,) if self.paper else ()) + SCALES:
                if ui.selectable(f"1:{scale}" if scale else "largest that fits", scale == self.scale)[0]:
                    self.scale = scale
            ui.end_combo()
        self.lines = ui.checkbox("trace lines", self.lines)[1]
        if ui.is_item_hovered():
            tooltip_beside(ui, "draws a line along walls that are cut; open where nothing was measured")
        self.dimensions = ui.checkbox("dimensions", self.dimensions)[1]
        if ui.is_item_hovered():
            tooltip_beside(ui, "draws the measured lengths and diameters that lie in the cut")
        for name in ("title", "author") if self.paper else ():
            ui.set_next_item_width(-1)
            setattr(self, name, ui.input_text_with_hint(f"##{name}", name, getattr(self, name))[1])


def sheet_work(out: Path, selection: Selection, cut: Cut, request: SheetRequest, meshes: tuple[MeshLayer, ...],
               measurements: tuple[Measurement, ...]) -> Callable[[], tuple[Path, str]]:
    """What draws and saves a sheet, or a DXF of its lines, by the ending of ``out``; it returns the file, and a line about
    letters that no font here has, "" where there are none.  Raises InputError when it is called."""

    def work() -> tuple[Path, str]:
        from ....commands.section.sheet import drawn_texts, write_figures

        boxes = ""
        with name_kept(out):
            if out.suffix.lower() == ".dxf":
                write_lines(out, selection, cut, request, meshes, measurements)
            else:
                made = make_sheet(selection, cut, request, meshes=meshes, measurements=measurements,
                                  png=out.suffix.lower() == ".png")
                write_figures(out, [(made.figure, made.dpi)])
                boxes = boxes_line(drawn_texts([made.figure]))
        return out, boxes

    return work


def preview_work(selection: Selection, cut: Cut, choices: SheetChoices, meshes: tuple[MeshLayer, ...],
                 measurements: tuple[Measurement, ...]) -> Callable[[], np.ndarray]:
    """What draws a coarse picture of a sheet, (H, W, 3) uint8."""
    scene, scale = selection.scene, float(choices.scale or SCALE)
    if choices.paper is None:
        longest = float(np.ptp(scene.bounds, axis=0).max())
        dpi = preview_dpi(longest, scale, float(scene.meta.metres_per_unit or 1.0))
    else:
        dpi = preview_dpi(SIZES[choices.paper][1] / 1000, 1.0, 1.0)
    request = choices.request(dpi)

    def work() -> np.ndarray:
        figure = make_sheet(selection, cut, request, meshes=meshes, measurements=measurements, png=True).figure
        figure.canvas.draw()
        return np.array(figure.canvas.buffer_rgba())[..., :3]  # type: ignore[attr-defined]

    return work
