"""Inspect: a click shows what is known of the nearest measured point; the status bar shows the one under the pointer."""

import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...common.text import coordinate, plain
from ...grid.records.point_marks import HAS_CLASS, marks_of
from ...picture.colour_modes import CLASSES
from ...work.meshes.pick_mesh import ON_MODEL
from ...work.places.pick import Picked, is_quick, surface_around
from ..kit import icons
from ..session.exact_points import ExactPoints
from .editing import Pointing, unit_of
from .tool import Overlay, PointerEvent, Tool, ToolContext

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ..kit.overlay import OverlayCanvas


def lines_of(picked: Picked, context: ToolContext) -> list[str]:
    """What a card says of a point: one line a fact."""
    assert context.scene is not None
    unit, (x, y, z) = unit_of(context), picked.position
    lines = [f"x {coordinate(x)}   y {coordinate(y)}   z {coordinate(z)} {unit}"]
    if picked.index == ON_MODEL:
        return [*lines, f"{picked.station}: not measured", f"distance from the camera: {picked.distance:.3f} {unit}"]
    around = surface_around(context.scene, picked.position)
    lines.append(f"scan: {picked.station}")
    if picked.intensity is not None:
        lines.append(f"intensity: {plain(picked.intensity)}")
    if (text := class_text(picked, context)) is not None:
        lines.append(f"class: {text}")
    lines.append("colour: {}, {}, {}".format(*picked.rgb))
    lines.append(f"distance from the camera: {picked.distance:.3f} {unit}")
    if np.isfinite(around.spacing):
        lines.append(f"density: {around.density:,.0f} points/{unit}² (spacing {around.spacing:.4f} {unit})")
        lines.append(f"scatter from the local plane: {around.noise:.4f} {unit} (1 sigma)")
    return lines


def class_text(picked: Picked, context: ToolContext) -> str | None:
    """The class of a point, as the document has it and as its file does; None where it has none."""
    own, scene = picked.classification, context.scene
    marks = None if scene is None else marks_of(scene, context.document)
    if marks is not None and (entry := int(marks.table[marks.of_point[picked.index]])) & HAS_CLASS:
        code, file = entry & 255, "none in the file" if own is None else f"file: {own}"
        return f"{code} {CLASSES.get(code, ('user-defined',))[0]} ({file})"
    return None if own is None else f"{own} ({CLASSES.get(own, ('user-defined',))[0]})"


def more_lines_of(picked: Picked) -> list[str]:
    """What the panel says besides: the other attributes in the file, and how precise the values are."""
    lines = [f"{name.replace('_', ' ')}: {plain(value)}" for name, value in picked.attributes.items()]
    if picked.note is not None:
        lines.append(picked.note)
    elif not picked.exact:
        lines.append("Rounded by the grid; the file is being read.")
    return lines


class UnderPointer(Overlay):
    """Keeps ``session.work.under_pointer`` up to date while the picture is at rest, for the status bar.  Draws nothing itself.

    The point is shown with the grid's values until those of the file have been read, on a thread; of formats in which that
    takes a pass over the file, a click reads them.
    """

    name = "point under the pointer"

    def __init__(self) -> None:
        self._pointing, self._reading = Pointing(meshes=True), ExactPoints()
        self._exact: tuple[weakref.ref[Scene], Picked] | None = None

    def follow(self, context: ToolContext) -> None:
        work = context.session.work
        self._reading.poll()
        shown = context.session.interface
        found = self._pointing.at(context, context.session.pointer, wait=False) if shown else work.under_pointer
        scene = context.scene
        if found is not None and scene is not None:
            known = self._exact[1] if self._exact is not None and self._exact[0]() is scene else None
            if known is not None and known.index == found.index:
                found = replace(known, distance=found.distance, pixel=found.pixel)
            elif not (self._reading.busy or found.exact) and is_quick(scene, found.index):
                of = weakref.ref(scene)
                self._reading.start(context, found, lambda exact: self._arrived(of, exact))
        work.under_pointer = found

    def _arrived(self, scene: "weakref.ref[Scene]", exact: Picked) -> None:
        self._exact = scene, exact


class InspectPoint(Tool):
    """Marks the measured point under the pointer; a click opens its card, a click beside the scan closes it."""

    name, label, icon, key = "inspect", "Inspect", icons.INSPECT, "I"
    help = "click a point for its coordinates, scan, intensity, class and density"
    cursor = "crosshair"
    takes_clicks = picks = True

    def __init__(self) -> None:
        self._pointing, self._reading = Pointing(meshes=True), ExactPoints()
        self.picked: Picked | None = None
        self._lines: list[str] = []
        self._more: list[str] = []

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.button != "left" or event.clicks != 1:
            return False
        found = self._pointing.clicked(context, event.position)
        if found is None:
            self._show(None, context)
        else:
            self._show(self._reading.of(context, found, lambda exact: self._arrived(exact, context)), context)
        return False

    def _arrived(self, exact: Picked, context: ToolContext) -> None:
        """The values of the file are there."""
        if self.picked is not None and self.picked.index == exact.index:
            self._show(exact, context)

    def _show(self, picked: Picked | None, context: ToolContext) -> None:
        self.picked = picked
        self._lines = [] if picked is None else lines_of(picked, context)
        self._more = [] if picked is None else more_lines_of(picked)

    def follow(self, context: ToolContext) -> None:
        self._reading.poll()

    def left(self, context: ToolContext) -> None:
        self.picked, self._lines, self._more = None, [], []

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
        for line in (*self._lines, *self._more):
            ui.text_wrapped(line)
        if ui.button("Copy coordinates"):
            ui.set_clipboard_text(" ".join(coordinate(value) for value in self.picked.position))
            context.toast("Coordinates copied")
