"""Scene: which way is up, the reference system and unit of the coordinates, and the project file."""

from typing import Any

from ...picture.edits import UP_AXES
from ..kit import icons
from ..kit.widgets import tooltip_beside
from .editing import edit, step
from .reference_panel import ReferencePanel
from .tool import Tool, ToolContext


class SceneSettings(Tool):
    """Its panel holds what a person assigns to the scans; the pointer flies as usual."""

    name, label, icon = "scene", "Scene", icons.SCENE
    help = "up axis, reference system, unit and project file"

    def __init__(self) -> None:
        self.reference = ReferencePanel()

    def panel(self, ui: Any, context: ToolContext) -> None:
        document = context.document
        ui.text_unformatted("up axis")
        ui.set_next_item_width(-1)
        current = next((name for name, axis in UP_AXES.items() if axis == document.up), "other")
        if ui.begin_combo("##up", current):
            for name, axis in UP_AXES.items():
                if ui.selectable(name, name == current)[0] and axis != document.up:
                    edit(context, f"Up axis {name}", up=axis)
            ui.end_combo()
        if ui.is_item_hovered():
            tooltip_beside(ui, "for flying, heights, level slabs and turning clips")
        self.reference.draw(ui, context)
        ui.separator()
        work = context.session.work
        ui.text_wrapped(f"Project: {work.project.name if work.project is not None else 'not saved yet'}")
        if ui.button("Save project"):
            context.save_project()
        for verb, label, redo in (("Undo", work.history.undo_label, False), ("Redo", work.history.redo_label, True)):
            if redo:
                ui.same_line()
            ui.begin_disabled(label is None)
            if ui.button(verb):
                step(context, redo=redo)
            ui.end_disabled()
            if label and ui.is_item_hovered():
                tooltip_beside(ui, f"{verb}: {label}")

        if context.files.has_system:
            context.files.prefer_window(ui.checkbox("choose files in this window", context.files.folders.in_window)[1])
            if ui.is_item_hovered():
                tooltip_beside(ui, "not in the dialog of the desktop")

    def close(self) -> None:
        self.reference.close()
