"""Inspect: a click shows what is known of the nearest measured point; the status bar shows the one under the pointer."""

from typing import TYPE_CHECKING

import numpy as np

from ...tools.look import CLASSES
from ...tools.pick import Picked, surface_around
from .editing import Pointing, unit_of
from .tool import Overlay, PointerEvent, Tool, ToolContext

if TYPE_CHECKING:
    from ..overlay import OverlayCanvas


def lines_of(picked: Picked, context: ToolContext) -> list[str]:
    """What a card says of a point: one line a fact."""
    assert context.scene is not None
    unit, around = unit_of(context), surface_around(context.scene, picked.position)
    x, y, z = picked.position
    lines = [f"x {x:.4f}   y {y:.4f}   z {z:.4f} {unit}", f"scan: {picked.station}", f"intensity: {picked.intensity}"]
    if picked.classification is not None:
        name = CLASSES.get(picked.classification, ("user-defined",))[0]
        lines.append(f"class: {picked.classification} ({name})")
    lines.append("colour: {}, {}, {}".format(*picked.rgb))
    lines.append(f"distance from the camera: {picked.distance:.3f} {unit}")
    if np.isfinite(around.spacing):
        lines.append(f"density: {around.density:,.0f} points/{unit}² (spacing {around.spacing:.4f} {unit})")
        lines.append(f"scatter from the local plane: {around.noise:.4f} {unit} (1 sigma)")
    return lines


class UnderPointer(Overlay):
    """Keeps ``Work.under_pointer`` up to date while the picture is at rest, for the status bar.  Draws nothing itself."""

    name = "point under the pointer"

    def __init__(self) -> None:
        self._pointing = Pointing()

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        context.session.work.under_pointer = self._pointing.at(context, context.session.pointer)


class InspectPoint(Tool):
    """Marks the measured point under the pointer; a click opens its card, a click beside the scan closes it."""

    name, label, letter, key = "inspect", "Inspect", "I", "I"
    help = "click a point for its coordinates, scan, intensity, class and density"
    cursor = "crosshair"
    takes_clicks = True

    def __init__(self) -> None:
        self._pointing = Pointing()
        self.picked: Picked | None = None
        self._lines: list[str] = []

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.button != "left" or event.clicks != 1:
            return False
        self.picked = self._pointing.at(context, event.position)
        self._lines = lines_of(self.picked, context) if self.picked is not None else []
        if self.picked is None:
            context.toast("No measured point here: this pixel is filled or background")
        return False

    def left(self, context: ToolContext) -> None:
        self.picked, self._lines = None, []

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        hovered = context.session.work.under_pointer
        if hovered is not None:
            overlay.marker(hovered.position, "accent", 5.0, "ring")
        if self.picked is not None:
            overlay.marker(self.picked.position, "accent", 5.0)
            overlay.label(self.picked.position, "\n".join(self._lines), offset=(14.0, 10.0))

    def panel(self, ui, context: ToolContext) -> None:
        if self.picked is None:
            ui.text_wrapped("Click a measured point. Filled pixels and background have none.")
            return
        for line in self._lines:
            ui.text_wrapped(line)
        if ui.button("Copy coordinates"):
            ui.set_clipboard_text("{:.6f} {:.6f} {:.6f}".format(*self.picked.position))
            context.toast("Coordinates copied")
