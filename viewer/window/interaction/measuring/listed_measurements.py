"""The measurements of the document as the outliner and the tool's panel list them."""

import re
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ....common.errors import PointglassError
from ....work.document import replaced, without
from ....work.ghosts import NAME as GHOSTS
from ....work.measuring.measure_text import components_text, fit_text, silhouette_text, value_text, volume_text
from ....work.measuring.measurement import Measurement
from ....work.measuring.values import components, evaluate
from ...flight.navigation import view_along
from ...kit import icons
from ...kit.widgets import compact_button, compact_width, tooltip_beside
from ..editing import edit, unit_of
from ..outline import Group, Row
from ..tool import Tool, ToolContext
from .profile_graph import draw_profile, write_profile

LEAST_SPACINGS = 100.0
"""Size of what is looked at, at least, in spacings of the points: nearer, a picture of points is blurred."""


_NO_NAME = re.compile(rf"scan \d+|model .*|{re.escape(GHOSTS)}", re.DOTALL)
"""What a point may say in place of a scan's name: the number of a scan without one, a mesh, ghosts."""


def not_open(measurement: Measurement, names: Collection[str]) -> list[str]:
    """The scans that points of a measurement were picked on and that are not open, by name.  names: of those that are."""
    of = dict.fromkeys(point.scan for point in measurement.points)
    return [name for name in of if name and name not in names and not _NO_NAME.fullmatch(name)]


def names_of_scans(context: ToolContext) -> Callable[[], Collection[str]]:
    """Gives the names of the scans that are open, collected where a measurement asks for them."""
    return cache(lambda: {scan.name for scan in context.scene.meta.scans} if context.scene is not None else set())


def measurement_group(tool: Tool, context: ToolContext) -> Group:
    """A click selects the tool, whose panel has every value; the menu looks at a measurement, copies its value, deletes it."""
    found, names = context.document.measurements, names_of_scans(context)

    def value_of(number: int) -> str:
        return value_text(found[number], unit_of(context))

    def row(number: int) -> Row:
        name, value = found[number].name, value_of(number)
        if gone := not_open(found[number], names()):
            return Row(name, f"{value}; not open", f"{name}: {value}\nIts scan is not open: {', '.join(gone)}")
        return Row(name, value, f"{name}: {value}")

    def rename(number: int, name: str) -> None:
        edit(context, "Rename measurement", ("rename", number),
             measurements=replaced(found, number, replace(found[number], name=name)))

    return Group("Measurements", icons.MEASURE, len(found), row, lambda number: setattr(tool, "wanted", True), rename=rename,
                 commands={
                     "Look at it": lambda number: look_at(context, number),
                     "Copy its value": lambda number: context.clipboard.write(value_of(number)),
                     "Delete": lambda number: edit(context, f"Delete {found[number].name}",
                                                   measurements=without(found, number)),
                 })  # fmt: skip


def draw_list(ui: Any, context: ToolContext) -> None:
    """Every measurement in the panel: its name, its value and what is known about it."""
    found, unit, names = context.document.measurements, unit_of(context), names_of_scans(context)
    for number, item in enumerate(found):
        ui.push_id(number)
        ui.separator()
        ui.set_next_item_width(-compact_width((icons.REMOVE,), context.theme))
        changed, name = ui.input_text("##name", item.name)
        if changed:
            edit(context, "Rename measurement", ("rename", number),
                 measurements=replaced(found, number, replace(item, name=name)))
        ui.same_line()
        gone = compact_button(icons.REMOVE, context.theme)
        if ui.is_item_hovered():
            tooltip_beside(ui, "Delete this measurement")
        ui.text_wrapped(value_text(item, unit))
        if others := not_open(item, names()):
            ui.text_wrapped(f"Its scan is not open: {', '.join(others)}")
        for about in filter(None, (fit_text(item, unit), volume_text(item, unit), silhouette_text(item))):
            ui.text_wrapped(about)
        if item.profile is not None:
            draw_profile(ui, item, unit, context.theme.scale)
            if ui.button("Profile…"):
                context.files.save("profile", "Save the stations of the profile", "profile.csv", {"CSV table": (".csv",)},
                                   lambda path, item=item: _save_profile(context, path, item))
            if ui.is_item_hovered():
                tooltip_beside(ui, "Saves station, height and number of points as CSV; the line is in Export… as DXF, GeoJSON")
        if (parts := components(item)) is not None:
            ui.text_wrapped(components_text(parts, unit))
        if item.kind == "area":
            ui.text_wrapped(f"corners lie {evaluate(item).residual:.4f} {unit} (RMS) off their plane")
        ui.pop_id()
        if gone:
            edit(context, f"Delete {item.name}", measurements=without(found, number))
            return

def _save_profile(context: ToolContext, path: Path, item: Measurement) -> None:
    try:
        write_profile(path, item)
    except PointglassError as error:
        context.session.notices.say("The profile cannot be saved", error)
    else:
        context.tell_saved(path)


def look_at(context: ToolContext, number: int) -> None:
    """Flies straight towards a measurement, to where it fills about a third of the picture; turns where that is nearer."""
    places = np.array([point.position for point in context.document.measurements[number].points])
    flight, scene = context.session.flight, context.scene
    assert scene is not None
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(float(np.linalg.norm(high - low)), LEAST_SPACINGS * scene.spacing)
    state, middle = flight.state, (low + high) / 2
    away = middle - state.position
    distance = float(np.linalg.norm(away))
    ahead = away / distance if distance > 0 else state.forward
    wanted = 1.5 * size / np.tan(np.radians(flight.field_of_view) / 2)
    flight.glide_to(view_along(middle - ahead * min(wanted, distance), ahead, state.speed, state.upright))
