"""Scene: which way is up, the unit of the coordinates, and the project file."""

from dataclasses import replace
from typing import Any

from viewer.tools.document import UP_AXES
from viewer.window.interaction.editing import edit, metres_per_unit, save_project, step
from viewer.window.interaction.tool import Tool, ToolContext

UNITS: dict[str, float | None] = {
    "as the file says": None, "metres": 1.0, "millimetres": 0.001, "centimetres": 0.01, "feet": 0.3048,
    "US survey feet": 1200 / 3937,
}  # fmt: skip


class SceneSettings(Tool):
    """Its panel holds what a person assigns to the scans; the pointer flies as usual."""

    name, label, letter = "scene", "Scene", "S"
    help = "up axis, units and project file"

    def panel(self, ui: Any, context: ToolContext) -> None:
        document = context.document
        ui.text_unformatted("up axis")
        ui.set_next_item_width(-1)
        current = next((name for name, axis in UP_AXES.items() if axis == document.up), "other")
        if ui.begin_combo("##up", current):
            for name, axis in UP_AXES.items():
                if ui.selectable(name, name == current)[0] and axis != document.up:
                    edit(context, f"Up axis {name}", up=axis)
                    context.renew_picture()
            ui.end_combo()
        if ui.is_item_hovered():
            ui.set_tooltip("for flying, heights, level slabs and turning clips")
        self._units(ui, context)
        ui.separator()
        work = context.session.work
        path = work.project_path
        ui.text_wrapped(f"Project: {path.name if path is not None else 'none'}{' (changed)' if work.history.changed else ''}")
        if ui.button("Save project"):
            save_project(context)
        for verb, label, redo in (("Undo", work.history.undo_label, False), ("Redo", work.history.redo_label, True)):
            if redo:
                ui.same_line()
            ui.begin_disabled(label is None)
            if ui.button(verb):
                step(context, redo=redo)
            ui.end_disabled()
            if label and ui.is_item_hovered():
                ui.set_tooltip(f"{verb}: {label}")

    def _units(self, ui: Any, context: ToolContext) -> None:
        """One unit for all scans: they share the scene's coordinates."""
        scans = context.document.scans
        if not scans:
            return
        assigned = scans[0].metres_per_unit
        current = next((name for name, metres in UNITS.items() if metres == assigned), f"{assigned:g} m" if assigned else "")
        ui.text_unformatted("unit")
        ui.set_next_item_width(-1)
        if ui.begin_combo("##unit", current):
            for name, metres in UNITS.items():
                if ui.selectable(name, name == current)[0] and metres != assigned:
                    edit(context, f"Unit: {name}", scans=tuple(replace(scan, metres_per_unit=metres) for scan in scans))
            ui.end_combo()
        if ui.is_item_hovered():
            known = metres_per_unit(context)
            ui.set_tooltip(f"{known:g} metres" if known else "unknown: measurements are shown without a unit's name")
