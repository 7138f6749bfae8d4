"""The rows of the Align tool in the inspector: which scan moves, its pairs with what they are off by, surfaces, numbers."""

from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from ....common.rigid_transform import Rows
from ....common.text import counted, printable
from ....picture.meshes.mesh_layer import MeshLayer
from ....work.registration.point_pairs import LEAST, PairFit
from ....work.scan_files import FilePart
from ...kit import icons
from ...kit.theme import fitted
from ...kit.widgets import compact_button, tooltip_beside, work_rows
from ...kit.worker import Worker
from ..editing import unit_of
from ..tool import ToolContext
from .bearing import BearingLine
from .clicked_pairs import Pairs
from .move_fields import Moving, move_fields, moved_rows, number_field


class Aligning(Moving, Protocol):
    """What the panel shows and changes: viewer.window.interaction.registering.align_tool.Align."""

    moving: int
    pairs: Pairs
    line: BearingLine
    levelling: bool
    result: str
    worker: Worker | None

    def parts(self, context: ToolContext) -> list[FilePart]: ...
    def names(self, context: ToolContext) -> list[str]: ...
    def mesh(self, context: ToolContext) -> MeshLayer | None: ...
    def transform(self, context: ToolContext) -> Rows: ...
    def choose(self, number: int) -> None: ...
    def apply_pairs(self, context: ToolContext) -> None: ...
    def refine(self, context: ToolContext) -> None: ...
    def turn_to_bearing(self, context: ToolContext) -> None: ...


def name_of(part: FilePart) -> str:
    """The name of a file, for a person."""
    return printable(Path(part.path).name)


def draw_panel(ui: Any, tool: Aligning, context: ToolContext) -> None:
    """All rows.  ui: the ``imgui`` module, inside a window."""
    parts = tool.parts(context)
    if not parts:
        ui.text_wrapped("Scans can be moved once all points are read and their files are told apart.")
        return
    names = tool.names(context)
    if tool.moving >= len(names):
        return
    _which(ui, tool, names)
    if tool.worker is not None:
        work_rows(ui, tool.worker)
        return
    if len(names) > 1:
        _pairs(ui, tool, context)
    else:
        ui.text_wrapped("Open a second scan to align this one to it, or lay a model beside it (Meshes) to align that.")
    if tool.result:
        ui.text_wrapped(tool.result)
    ui.separator()
    _numbers(ui, tool, context)


def _which(ui: Any, tool: Aligning, names: list[str]) -> None:
    width = ui.get_content_region_avail().x
    if len(names) == 1:
        ui.text_unformatted(fitted(names[0], width))
        return
    ui.text_unformatted("what moves")
    ui.set_next_item_width(-1)
    if ui.begin_combo("##moving", names[tool.moving]):
        for number, name in enumerate(names):
            ui.push_id(number)
            if ui.selectable(name, number == tool.moving)[0]:
                tool.choose(number)
            ui.pop_id()
        ui.end_combo()


def _pairs(ui: Any, tool: Aligning, context: ToolContext) -> None:
    pairs, unit = tool.pairs, unit_of(context)
    if pairs.count < LEAST:
        more = LEAST - pairs.count
        where = "one scan, then the same place in the other" if tool.mesh(context) is None else (
            "the model, then the same place in the scan")
        ui.text_wrapped(f"Click a place in {where}: {counted(more, 'more pair')}.")
    found = pairs.fit()
    for number in range(pairs.count):
        ui.push_id(number)
        gone = compact_button(icons.REMOVE, context.theme)
        if ui.is_item_hovered():
            tooltip_beside(ui, "Take this pair away")
        ui.same_line()
        ui.align_text_to_frame_padding()
        off = f"off by {found.residuals[number]:.3g} {unit}" if isinstance(found, PairFit) else ""
        ui.text_unformatted(f"pair {number + 1}  {off}")
        ui.pop_id()
        if gone:
            pairs.drop(number)
            return
    if isinstance(found, str):
        ui.text_wrapped(found)
    elif found is not None:
        ui.text_unformatted(f"RMS {found.rms:.3g} {unit}")
    ui.begin_disabled(not isinstance(found, PairFit))
    if ui.button("Apply pairs"):
        tool.apply_pairs(context)
    ui.end_disabled()
    ui.same_line()
    if ui.button("Refine (ICP)"):
        tool.refine(context)
    if ui.is_item_hovered():
        tooltip_beside(ui, "Compares the surfaces of both scans, from where the pairs lead, else from where the scan is")


def _numbers(ui: Any, tool: Aligning, context: ToolContext) -> None:
    move_fields(ui, tool, context)
    if tool.mesh(context) is not None:
        moved_rows(ui, tool, tool.transform(context), context)
        return
    ui.same_line()
    if ui.button("Click its floor…" if tool.levelling else "Level…"):
        tool.levelling = not tool.levelling
        tool.line.clear()
    if ui.is_item_hovered():
        tooltip_beside(ui, "A click on its floor fits a plane there and makes it horizontal")
    if ui.button("Cancel bearing" if tool.line.asks or tool.line.places else "Bearing…"):
        tool.levelling = False
        tool.line.toggle()
    if ui.is_item_hovered():
        tooltip_beside(ui, "Click the two ends of a line on the scan, as a wall or towards north,\n"
                           "and type its bearing: degrees clockwise from the y axis (0 north, 90 east)")
    if tool.line.complete:
        changed, value = number_field(ui, "bearing", tool.line.bearing, "%.4f°")
        if changed and isfinite(value):
            tool.line.bearing = value
        if ui.button("Turn to bearing"):
            tool.turn_to_bearing(context)
    moved_rows(ui, tool, tool.transform(context), context)
