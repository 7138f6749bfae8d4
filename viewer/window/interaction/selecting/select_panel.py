"""The controls of the Select tool: the shape, what is selected, and what becomes of it."""

from typing import Any

import numpy as np

from ....picture.colour_modes import CLASSES
from ....picture.regions import LAST_CLASS
from ....work.selecting.connected_region import usual_gap
from ....work.selecting.select_points import HOW
from ...kit.number_field import number_input
from ...kit.theme import fitted
from ...kit.widgets import tooltip_beside
from ..editing import edit, metres_per_unit, unit_of
from ..tool import ToolContext
from .listed_sets import class_name, thousands


class SelectPanel:
    """code: the class that is to be given."""

    def __init__(self, tool: Any, shapes: dict[str, str]):
        """tool: the Select tool, whose panel this is.  shapes: its ways to select, with a line about each."""
        self._tool, self._shapes, self.code = tool, shapes, 6

    def draw(self, ui: Any, context: ToolContext) -> None:
        tool = self._tool
        self._choices(ui, context)
        ui.separator()
        selection = context.document.selection
        for line in self._lines(context):
            ui.text_unformatted(fitted(line, ui.get_content_region_avail().x))
        if ui.button("Invert"):
            tool.invert(context)
        self._tip(ui, "Selects what is in sight and is not selected now")
        ui.begin_disabled(not selection or tool.job.worker is not None)
        ui.same_line()
        if ui.button("Clear"):
            edit(context, "Select nothing", selection=type(selection)())
        self._tip(ui, "Selects nothing (Esc)")
        self._uses(ui, context)
        ui.end_disabled()

    def _lines(self, context: ToolContext) -> tuple[str, str]:
        """What is selected, or was done with it: always two lines, so that the buttons below stay where they are."""
        tool, selection = self._tool, context.document.selection
        if tool.job.worker is not None:
            return f"{tool.job.worker.title}…", ""
        if not selection:
            label, (what, become) = tool.done
            if what and context.session.work.history.undo_label == label:
                return what, f"{become}; Ctrl+Z undoes"
            return "Nothing is selected.", ""
        counted = f"{thousands(selection.count)} point{'' if selection.count == 1 else 's'} selected"
        if tool.facts is None or tool.facts.bounds is None:
            return counted, ""
        x, y, z = np.ptp(tool.facts.bounds, axis=0)
        return counted, f"{x:.4g} × {y:.4g} × {z:.4g} {unit_of(context)}"

    def _choices(self, ui: Any, context: ToolContext) -> None:
        tool = self._tool
        half = ui.get_content_region_avail().x / 2
        for number, (shape, what) in enumerate(self._shapes.items()):
            if number % 2:
                ui.same_line(half)
            if ui.radio_button(shape, tool.shape == shape):
                tool.choose_shape(shape)
            self._tip(ui, what[0].upper() + what[1:])
        ui.set_next_item_width(-1)
        if ui.begin_combo("##how", {"new": "new selection", "add": "add to it", "subtract": "take from it"}[tool.how]):
            for how, what in HOW.items():
                if ui.selectable(how, how == tool.how)[0]:
                    tool.how = how
                self._tip(ui, what[0].upper() + what[1:])
            ui.end_combo()
        if tool.shape == "lasso":
            tool.seen_only = ui.checkbox("only what is seen", tool.seen_only)[1]
            self._tip(ui, "Points behind others stay as they are; otherwise all points inside the line, near or far")
        if tool.shape == "box":
            self._box(ui, context)
        elif tool.shape == "plane":
            tool.other_side = ui.checkbox("below, or the far side", tool.other_side)[1]
            self._tip(ui, "Otherwise above the plane; of an upright one, the side of the camera")
        elif tool.shape == "connected" and context.scene is not None:
            tool.smooth = ui.checkbox("end at edges", tool.smooth)[1]
            self._tip(ui, "One smooth surface; otherwise everything that is not separated by a gap")
            ui.set_next_item_width(-1)
            usual = usual_gap(context.scene)
            changed, gap = number_input(ui, "##gap", tool.gap or usual, f"gap %.3f {unit_of(context)}")
            if changed:
                tool.gap = gap if gap > 0 else None
            self._tip(ui, "Points farther apart do not hang together; 0: from the spacing of the points")

    def _box(self, ui: Any, context: ToolContext) -> None:
        tool = self._tool
        metres = metres_per_unit(context)
        tool.box.panel(ui, max(0, min(6, round(3 + np.log10(metres)))) if metres else 3, context)
        ui.begin_disabled(tool.box.box is None)
        if ui.button("Select inside"):
            tool.finish(context)
        ui.end_disabled()

    def _uses(self, ui: Any, context: ToolContext) -> None:
        tool, document = self._tool, context.document
        ui.separator()
        for label, what, do in (
            ("Keep", "Keeps them as a region, which the outliner lists", lambda: tool.keep(context)),
            ("Hide", "Hides them as a region; its eye in the outliner shows them again",
             lambda: tool.keep(context, "Hidden", shown=False)),
            ("Only", "Hides all other points", lambda: tool.show_alone(context, document.selection)),
            ("Delete", "Takes them from pictures, measurements and exports (Delete); the file stays as it is, and the eye of "
             "'Deleted' in the outliner shows them again", lambda: tool.delete(context)),
            ("Export…", "Writes them as whole records of their files: LAZ, LAS, E57 or PLY",
             lambda: context.saves.points.ask(document.selection, "selection")),
        ):  # fmt: skip
            if label not in ("Keep", "Delete"):
                ui.same_line()
            if ui.button(label):
                do()
            self._tip(ui, what)
        ui.separator()
        ui.set_next_item_width(-1)
        if ui.begin_combo("##class", f"class {class_name(self.code)}"):
            for code in CLASSES:
                if ui.selectable(class_name(code), code == self.code)[0]:
                    self.code = code
            ui.end_combo()
        self._tip(ui, "The class of ASPRS that the points get")
        ui.set_next_item_width(ui.calc_text_size("m" * 5).x)
        changed, code = ui.input_int("##code", self.code, 0, 0)
        if changed and 0 <= code <= LAST_CLASS:
            self.code = int(code)
        self._tip(ui, f"Its number, 0 to {LAST_CLASS}; from 64 on it is your own")
        ui.same_line()
        if ui.button("Classify"):
            tool.classify(context, self.code)
        self._tip(ui, "Gives the selected points this class in the project and in exports; the file stays as it is")
        ui.begin_disabled(not document.reclassified)
        if ui.button("Class as in file"):
            tool.classify(context, None)
        ui.end_disabled()
        self._tip(ui, "Gives the selected points the class of their file again")

    @staticmethod
    def _tip(ui: Any, text: str) -> None:
        if ui.is_item_hovered(ui.HoveredFlags_.allow_when_disabled):
            tooltip_beside(ui, text)
