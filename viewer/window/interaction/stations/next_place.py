"""PageDown and PageUp: the next and the previous station, photograph in place, or photograph looked at by itself.

tool: the Stations tool.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ....work.places.pick import station_name
from ...kit.widgets import tooltip_beside
from ..tool import ToolContext
from .picture_viewer import of_scan
from .stand_at_photo import show_photo, stand_at

if TYPE_CHECKING:
    from ....grid.scene import Scene

AT_PLACE = 1e-3
"""Shares of the scan's extent within which the camera stands at a place."""
KEYS = {"PAGE_UP": -1, "PAGE_DOWN": 1}


def places_of(scene: "Scene") -> list[tuple[int, str, np.ndarray, bool]]:
    """(number, name, position, inferred) of each station whose place is known."""
    scans = scene.meta.scans
    return [(number, station_name(scene, number), place, number < len(scans) and scans[number].inferred)
            for number, place in enumerate(scene.scan_places) if np.isfinite(place).all()]


def step(tool: Any, context: ToolContext, by: int) -> None:
    """Goes to the next of what is looked at now, the first after the last; by: -1 for the one before."""
    what, names, here, go = _stops(tool, context)
    if len(names) > (here is not None):
        number = (here + by) % len(names) if here is not None else 0 if by > 0 else len(names) - 1
        go(number)
        context.toast(f"{names[number]}, {what} {number + 1} of {len(names)}")


def step_buttons(ui: Any, tool: Any, context: ToolContext) -> None:
    """Two buttons side by side, where there is somewhere to go."""
    what, names, _, _ = _stops(tool, context)
    if len(names) < 2:
        return
    for text, by, tip in (("Previous", -1, f"The {what} before (PageUp)"), ("Next", 1, f"The next {what} (PageDown)")):
        if by > 0:
            ui.same_line()
        if ui.button(text):
            step(tool, context, by)
        if ui.is_item_hovered():
            tooltip_beside(ui, tip)


def _stops(tool: Any, context: ToolContext) -> tuple[str, list[str], int | None, Callable[[int], object]]:
    """What is stepped through, the name of each, the number of the one that is looked at, and what goes to one."""
    viewed, shown, scene = tool.viewer.viewed, context.session.work.photo, context.scene
    for number, picture in enumerate(tool.pictures):
        if viewed is not None and viewed.key is picture:
            return ("photograph", [each.name for each in tool.pictures], number,
                    lambda other: tool.viewer.open(context, of_scan(tool.pictures[other])))
    for number, photo in enumerate(tool.photos):
        if shown is not None and shown.photo is photo:
            return ("photograph", [each.title for each in tool.photos], number,
                    lambda other: show_photo(context, tool.photos[other]))
    places = places_of(scene) if scene is not None else []
    if scene is None or not places:
        return "station", [], None, lambda other: None
    away = [float(np.linalg.norm(place - context.camera.position)) for _, _, place, _ in places]
    nearest = int(np.argmin(away))
    there = away[nearest] < AT_PLACE * float(np.ptp(scene.bounds, axis=0).max())
    return ("station", [name for _, name, _, _ in places], nearest if there else None,
            lambda other: stand_at(context, places[other][2]))
