"""Rows of the Scene tool's panel that assign a coordinate reference system (CRS) and a unit of length to the scans.

The list of systems comes from pyproj, on a thread: reading it takes some tenths of a second.  A code that is typed and a name
that is chosen become one undoable step each.
"""

from dataclasses import replace
from typing import Any

from ...common.errors import InputError
from ...readers import crs
from ...work.reference import UNITS, unit_name_of
from ..kit import theme
from ..kit.widgets import tooltip_beside
from ..kit.worker import Worker
from .editing import edit
from .tool import ToolContext

AS_FILE = "as the file says"
_POPUP = (420.0, 330.0)
"""Width and height of the list of systems, design units: a full name fits beside its code."""


def assign_crs(context: ToolContext, text: str | None) -> None:
    """Assigns the system of an EPSG code to every scan, None: none; its unit replaces one assigned before.

    Raises InputError where the code is unknown or pyproj cannot be loaded; nothing is changed then.
    """
    code = crs.assigned(text)[0] if text is not None else None
    scans = tuple(replace(scan, crs=code, metres_per_unit=None) for scan in context.document.scans)
    edit(context, f"CRS: {code or AS_FILE}", scans=scans)


def assign_unit(context: ToolContext, metres: float | None) -> None:
    """Assigns a unit of so many metres to every scan; None: that of the CRS or of the file."""
    scans = tuple(replace(scan, metres_per_unit=metres) for scan in context.document.scans)
    edit(context, f"Unit: {unit_name_of(metres) if metres else AS_FILE}", scans=scans)


class ReferencePanel:
    """search: what is typed into the list of systems."""

    def __init__(self) -> None:
        self.search = ""
        self._systems: Worker | None = None
        self._found: tuple[str, list[tuple[str, str, str]]] | None = None
        self._problem = ""

    def draw(self, ui: Any, context: ToolContext) -> None:
        """Both rows, and below them why an assignment of the project cannot be used."""
        scans = context.document.scans
        if not scans or context.scene is None:
            return
        code, look = scans[0].crs, context.theme
        of_file = context.scene.meta.crs
        ui.text_unformatted("reference system")
        ui.set_next_item_width(-1)
        width, height = (look.px(side) for side in _POPUP)
        ui.set_next_window_size_constraints((width, look.px(80)), (width, height))
        shown = f"{code}  {_title(code)}" if code else AS_FILE
        room = ui.get_content_region_avail().x - look.px(40)  # the arrow and the frame's padding
        if ui.begin_combo("##crs", theme.fitted(shown, room), ui.ComboFlags_.height_largest):
            self._list(ui, context, code, f"{AS_FILE}: {of_file}" if of_file else f"{AS_FILE} (it names none)")
            ui.end_combo()
        elif ui.is_item_hovered(ui.HoveredFlags_.for_tooltip):
            tooltip_beside(ui, f"{shown}\nWhat the coordinates mean; they are not changed."
                               if code else f"The file's reference system: {of_file or 'none'}")
        self._unit(ui, context, scans[0].metres_per_unit, AS_FILE if code is None else "that of the system")
        context.session.work.facts(context.scene.meta)
        if (problem := context.session.work.reference_problem) is not None:
            ui.push_text_wrap_pos(0.0)
            theme.text_in(theme.WARN, problem)
            ui.pop_text_wrap_pos()

    def _list(self, ui: Any, context: ToolContext, code: str | None, unassigned: str) -> None:
        if ui.is_window_appearing():
            self.search, self._problem = "", ""
            ui.set_keyboard_focus_here()
        if self._systems is None:
            self._systems = Worker(crs.catalogue, "Reading the list of reference systems", context.session.loads.wake)
        ui.set_next_item_width(-1)
        entered, self.search = ui.input_text_with_hint("##search", "EPSG code or name, such as 25832 or UTM 33N", self.search,
                                                       ui.InputTextFlags_.enter_returns_true)
        if entered and self.search.strip():
            self._enter(ui, context)
        if self._problem:
            ui.text_wrapped(self._problem)
        if ui.selectable(unassigned, code is None)[0]:
            self._choose(ui, context, None)
        ui.separator()
        if not self._systems.finished:
            ui.text_unformatted("Reading the list of systems…")
        elif self._systems.error is not None:
            ui.text_wrapped(str(self._systems.error))
        else:
            self._matches(ui, context, code)

    def _matches(self, ui: Any, context: ToolContext, code: str | None) -> None:
        rows = self._rows()
        if not rows:
            ui.text_wrapped("Type a code or words of a name or country." if not self.search.strip() else
                            "No system of this code or name; epsg.io has the list.")
        for number, name, area in rows:
            if ui.selectable(f"{number}  {name}", number == code)[0]:
                self._choose(ui, context, number)
            if area and ui.is_item_hovered(ui.HoveredFlags_.for_tooltip):
                tooltip_beside(ui, area)

    def _rows(self) -> list[tuple[str, str, str]]:
        """The systems that match what is typed; searched again only when that changes."""
        if self._systems is None or not self._systems.finished or self._systems.error is not None:
            return []
        if self._found is None or self._found[0] != self.search:
            self._found = self.search, crs.matching(self.search, self._systems.result)
        return self._found[1]

    def _enter(self, ui: Any, context: ToolContext) -> None:
        """Enter chooses a code that was typed, or the only system of a name; several systems have to be told apart."""
        rows = self._rows()
        if len(rows) > 1 and not self.search.upper().removeprefix("EPSG").strip(" :").isdecimal():
            self._problem = f"{len(rows) if len(rows) < crs.MOST_SHOWN else 'Many'} systems have this name; choose one below."
        else:
            self._choose(ui, context, rows[0][0] if len(rows) == 1 else self.search)

    def _choose(self, ui: Any, context: ToolContext, text: str | None) -> None:
        try:
            assign_crs(context, text)
        except InputError as error:
            self._problem = str(error)
        else:
            ui.close_current_popup()

    def _unit(self, ui: Any, context: ToolContext, metres: float | None, unassigned: str) -> None:
        ui.text_unformatted("unit")
        ui.set_next_item_width(-1)
        if ui.begin_combo("##unit", unit_name_of(metres) if metres else unassigned):
            if ui.selectable(unassigned, metres is None)[0] and metres is not None:
                assign_unit(context, None)
            for name, length in UNITS.items():
                if ui.selectable(name, length == metres)[0] and length != metres:
                    assign_unit(context, length)
            ui.end_combo()
        elif ui.is_item_hovered(ui.HoveredFlags_.for_tooltip):
            known = context.session.facts.metres_per_unit
            tooltip_beside(ui, f"1 unit = {known:g} m" if known else "unknown: measurements are shown without a unit's name")

    def close(self) -> None:
        """The window closes; the list is read to its end, which takes less than a second."""
        if self._systems is not None:
            self._systems.join(10.0)


def _title(code: str) -> str:
    return crs.title(code) or ""
