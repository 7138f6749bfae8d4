"""The rows of the Meshes tool in the inspector: which mesh, what its file says, how it looks, and where it stands."""

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ....common.text import bytes_text
from ....picture.meshes.mesh_layer import MESH_UP_AXES, MeshLayer
from ....readers.meshes.mesh_data import PLAIN, MeshData
from ....work.meshes.laid_meshes import apart, assumed, bounds_of
from ...kit.theme import fitted
from ...kit.widgets import tooltip_beside, work_rows
from ...kit.worker import Worker
from ..editing import unit_of
from ..registering.move_fields import Moving, move_fields, moved_rows, number_field
from ..tool import ToolContext
from .mesh_loads import MeshLoads

_LEAST_OPACITY = 0.05


class Laying(Moving, Protocol):
    """What the panel shows and changes: viewer.window.interaction.meshes.mesh_tool.Meshes."""

    loads: MeshLoads
    chosen: int | None
    exporting: Worker | None

    def ask_export(self, context: ToolContext) -> None: ...
    def mesh(self, layer: MeshLayer) -> MeshData | None: ...
    def layer(self, context: ToolContext) -> MeshLayer | None: ...
    def ask(self, context: ToolContext) -> None: ...
    def change(self, context: ToolContext, number: int, label: str, gesture: object = None, **changes: Any) -> None: ...
    def remove(self, context: ToolContext, number: int) -> None: ...
    def fly_to(self, context: ToolContext, number: int) -> None: ...
    def put_at_middle(self, context: ToolContext) -> None: ...


def draw_panel(ui: Any, tool: Laying, context: ToolContext) -> None:
    """All rows.  ui: the ``imgui`` module, inside a window."""
    if ui.button("Add meshes…"):
        tool.ask(context)
    if ui.is_item_hovered():
        tooltip_beside(ui, "glTF, OBJ, STL, PLY or IFC files, laid beside the scan; or drop them on the picture")
    if tool.loads.worker is not None:
        work_rows(ui, tool.loads.worker)
    meshes = context.document.meshes
    if not meshes and tool.loads.worker is None:
        ui.text_wrapped("Models beside the points, drawn, clipped and measured like them: glTF, OBJ, STL, PLY, IFC.")
    for number, layer in enumerate(meshes):
        ui.push_id(number)
        if ui.selectable(fitted(layer.name, ui.get_content_region_avail().x), number == tool.chosen)[0]:
            tool.chosen = None if number == tool.chosen else number
        ui.pop_id()
    if meshes and tool.exporting is None and ui.button("Export meshes…"):
        tool.ask_export(context)
    if tool.exporting is not None:
        ui.text_wrapped(tool.exporting.title)
    layer = tool.layer(context)
    if layer is None or tool.chosen is None:
        return
    ui.separator()
    mesh = tool.mesh(layer)
    if mesh is None:
        ui.text_wrapped("Its file is not in memory." if layer.path not in tool.loads.failed else "Its file cannot be read.")
    else:
        _facts(ui, layer, mesh, context)
    _look(ui, tool, layer, tool.chosen, context)
    _axes(ui, tool, layer, tool.chosen, context)
    if mesh is not None:
        _place(ui, tool, layer, mesh, context)


def _facts(ui: Any, layer: MeshLayer, mesh: MeshData, context: ToolContext) -> None:
    unit = unit_of(context)
    extent = "\u2009×\u2009".join(f"{side:.4g}" for side in np.ptp(bounds_of(layer, mesh), axis=0))
    ui.text_unformatted(f"{len(mesh.faces):,} triangles".replace(",", "\u2009"))
    ui.text_unformatted(f"{extent} {unit}")
    size = Path(layer.path).stat().st_size if Path(layer.path).exists() else 0
    ui.text_unformatted(f"{mesh.format}, {bytes_text(size)}")
    for note in (assumed(layer, mesh), *mesh.notes):
        ui.text_wrapped(f"{note}.")


def _look(ui: Any, tool: Laying, layer: MeshLayer, number: int, context: ToolContext) -> None:
    changed, own = ui.checkbox("Colours of its file", layer.colour is None)
    if changed:
        tool.change(context, number, f"Colour {layer.name}", colour=None if own else PLAIN)
    elif layer.colour is not None:
        changed, colour = ui.color_edit3("##colour", [level / 255 for level in layer.colour])
        if changed:
            levels = tuple(min(max(round(255 * level), 0), 255) for level in colour)
            tool.change(context, number, f"Colour {layer.name}", ("mesh colour", number), colour=levels)
    ui.align_text_to_frame_padding()
    ui.text_unformatted("opacity")
    ui.same_line(ui.calc_text_size("m" * 5).x)
    ui.set_next_item_width(-1)
    changed, value = ui.slider_float("##opacity", 100 * layer.opacity, 100 * _LEAST_OPACITY, 100.0, "%.0f %%")
    if changed and 100 * _LEAST_OPACITY <= value <= 100:
        tool.change(context, number, f"Opacity of {layer.name}", ("mesh opacity", number), opacity=round(value) / 100)


def _axes(ui: Any, tool: Laying, layer: MeshLayer, number: int, context: ToolContext) -> None:
    ui.align_text_to_frame_padding()
    ui.text_unformatted("up axis")
    for axis in MESH_UP_AXES:
        ui.same_line()
        if ui.radio_button(axis, layer.up == axis) and layer.up != axis:
            tool.change(context, number, f"Turn {layer.name}", up=axis)
    changed, value = number_field(ui, "scale", layer.scale, "%.6g")
    if ui.is_item_hovered():
        tooltip_beside(ui, f"{unit_of(context)} in a unit of the file")
    if changed and 1e-9 <= value <= 1e9:
        tool.change(context, number, f"Scale {layer.name}", ("mesh scale", number), scale=value)


def _place(ui: Any, tool: Laying, layer: MeshLayer, mesh: MeshData, context: ToolContext) -> None:
    unit = unit_of(context)
    scene = context.scene
    away = 0.0 if scene is None else apart(bounds_of(layer, mesh), scene.bounds)
    if away > 0:
        ui.text_wrapped(f"It lies {away:.4g} {unit} away from the scan.")
    move_fields(ui, tool, context)
    ui.same_line()
    if ui.button("To the scan's middle"):
        tool.put_at_middle(context)
    if moved_rows(ui, tool, layer.transform, context):
        ui.same_line()
    if ui.button("Fly to it") and tool.chosen is not None:
        tool.fly_to(context, tool.chosen)
    ui.same_line()
    if ui.button("Remove") and tool.chosen is not None:
        tool.remove(context, tool.chosen)

