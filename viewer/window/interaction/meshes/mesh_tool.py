"""Meshes: design models beside the scan, listed in the outliner, with colour, opacity, axes and place in the inspector."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....common.rigid_transform import IDENTITY, combined, rigid
from ....common.text import counted
from ....picture.camera import look_at
from ....picture.meshes.mesh_layer import MeshLayer
from ....readers.meshes.mesh_data import MeshData
from ....readers.meshes.mesh_formats import MESH_FORMATS
from ....readers.meshes.mesh_store import kept_mesh
from ....work.document import replaced, without
from ....work.meshes.laid_meshes import bounds_of
from ....work.registration.levelling import by_numbers
from ...kit import icons
from ...kit.worker import Worker
from ...saving.capture import name_kept
from ..editing import edit, end, ended, facts_of
from ..outline import Group, Row
from ..tool import Tool, ToolContext
from .mesh_loads import MeshLoads
from .mesh_panel import draw_panel

_AWAY = 1.9
"""Extents of a mesh, in heights of the picture a unit away, from its middle to where the camera flies to see it."""


class Meshes(Tool):
    """chosen: number of the mesh that the inspector shows, None for none.  shift, degrees: typed, not applied yet."""

    name, label, icon = "meshes", "Meshes", icons.MESH
    help = "lay design models beside the scan: glTF, OBJ, STL, PLY, IFC"

    def __init__(self) -> None:
        self.loads = MeshLoads()
        self.chosen: int | None = None
        self.shift, self.degrees = [0.0, 0.0, 0.0], 0.0
        self.exporting: Worker | None = None
        self._out: Path | None = None

    def mesh(self, layer: MeshLayer) -> MeshData | None:
        """The triangles of a mesh, None where they are not in memory."""
        return kept_mesh(layer.path)

    def layer(self, context: ToolContext) -> MeshLayer | None:
        """The chosen mesh."""
        meshes = context.document.meshes
        return meshes[self.chosen] if self.chosen is not None and self.chosen < len(meshes) else None

    # ---- what is done

    def ask(self, context: ToolContext) -> None:
        """Asks for mesh files."""
        def arrive(paths: list[Path]) -> None:
            context.session.work.arriving_meshes += paths

        context.files.open("scans", "Lay meshes beside the scan", {"Meshes": tuple(MESH_FORMATS)}, arrive, many=True)

    def ask_export(self, context: ToolContext) -> None:
        """Asks for a file, and writes the meshes that are shown there, at their places."""
        from ....commands.exporting.mesh_export import MESH_ENDINGS, export_meshes

        document, metres = context.document, facts_of(context).metres_per_unit

        def chosen(out: Path) -> None:
            def work() -> list[str]:
                with name_kept(out):
                    return export_meshes(document.meshes, out, metres, document.up)[1]

            self._out, self.exporting = out, Worker(work, f"Writing {out.name}", context.wake)

        name = f"{context.session.shown_scan.title.split('.')[0]} meshes.glb"
        context.files.save("exports", "Export the meshes", name, {end[1:].upper(): (end,) for end in MESH_ENDINGS}, chosen)

    def change(self, context: ToolContext, number: int, label: str, gesture: object = None, **changes: Any) -> None:
        """Changes a mesh as one step.  label, gesture: as in History.do."""
        meshes = context.document.meshes
        edit(context, label, gesture, meshes=replaced(meshes, number, replace(meshes[number], **changes)))

    def remove(self, context: ToolContext, number: int) -> None:
        """Takes a mesh away."""
        meshes = context.document.meshes
        edit(context, f"Remove {meshes[number].name}", meshes=without(meshes, number))
        self.chosen = None

    def show(self, context: ToolContext, number: int, on: bool) -> None:
        """Draws a mesh, or does not."""
        layer = context.document.meshes[number]
        self.loads.again(layer.path)
        self.change(context, number, f"{'Show' if on else 'Hide'} {layer.name}", visible=on)

    def move_by_numbers(self, context: ToolContext) -> None:
        """Turns the chosen mesh about the vertical through its middle, and shifts it."""
        layer = self.layer(context)
        mesh = None if layer is None else self.mesh(layer)
        if layer is None or mesh is None or self.chosen is None:
            return
        middle = bounds_of(layer, mesh).mean(axis=0)
        motion = by_numbers((self.shift[0], self.shift[1], self.shift[2]), self.degrees, middle, np.array(context.document.up))
        self.change(context, self.chosen, f"Move {layer.name}", transform=combined(motion, layer.transform))
        self.shift, self.degrees = [0.0, 0.0, 0.0], 0.0

    def put_back(self, context: ToolContext) -> None:
        """Puts the chosen mesh where its file has it."""
        if (layer := self.layer(context)) is not None and self.chosen is not None:
            self.change(context, self.chosen, f"Put {layer.name} back", transform=IDENTITY)

    def put_at_middle(self, context: ToolContext) -> None:
        """Shifts the chosen mesh so that its middle is that of the scan."""
        layer, scene = self.layer(context), context.scene
        mesh = None if layer is None else self.mesh(layer)
        if layer is None or mesh is None or scene is None or self.chosen is None:
            return
        shift = scene.bounds.mean(axis=0) - bounds_of(layer, mesh).mean(axis=0)
        self.change(context, self.chosen, f"Move {layer.name}", transform=combined(rigid(np.eye(3), shift), layer.transform))

    def fly_to(self, context: ToolContext, number: int) -> None:
        """Flies to where a mesh fills the picture, looking the same way."""
        layer = context.document.meshes[number]
        if (mesh := self.mesh(layer)) is None:
            return
        bounds, camera = bounds_of(layer, mesh), context.camera
        middle, extent = bounds.mean(axis=0), float(np.linalg.norm(np.ptp(bounds, axis=0)))
        away = _AWAY * max(extent, 1e-6) * min(camera.fx / camera.width, camera.fy / camera.height)
        place = middle - away * camera.forward
        context.session.flight.show(camera.moved(look_at(place, middle, context.document.up)), glide=True)
        context.renew_picture()

    # ---- what is shown

    def follow(self, context: ToolContext) -> None:
        self.loads.follow(context)
        if (done := ended(self.exporting, context, "The meshes were not written")) is not None:
            self.exporting = None
            if done.error is None and not done.cancelled and self._out is not None:
                context.tell_saved(self._out)
                for line in done.result:
                    context.toast(f"{self._out.name}: {line}")
        if (added := self.loads.added) is not None:
            self.chosen, self.loads.added = added, None
        if self.chosen is not None and self.chosen >= len(context.document.meshes):  # undone, or another document
            self.chosen = None

    def outline(self, context: ToolContext) -> tuple[Group]:
        meshes = context.document.meshes

        def row(number: int) -> Row:
            layer = meshes[number]
            mesh = self.mesh(layer)
            reading = "being read" if self.loads.worker is not None else "cannot be read"
            value = counted(len(mesh.faces), "triangle") if mesh is not None else reading if layer.visible else ""
            return Row(layer.name, value, layer.path, shown=layer.visible, chosen=number == self.chosen, colour=layer.colour)

        def click(number: int) -> None:
            self.wanted, self.chosen = True, number

        return (Group("Meshes", icons.MESH, len(meshes), row, click, show=lambda number, on: self.show(context, number, on),
                      commands={"Fly to it": lambda number: self.fly_to(context, number),
                                "Remove": lambda number: self.remove(context, number)}),)

    def panel(self, ui: Any, context: ToolContext) -> None:
        draw_panel(ui, self, context)

    @property
    def workers(self) -> tuple[Worker | None, ...]:
        return self.loads.worker, self.exporting

    @property
    def unfinished(self) -> str:
        return "Meshes are being written." if self.exporting is not None else ""

    def close(self) -> None:
        self.loads.close()
        end(self.exporting)
