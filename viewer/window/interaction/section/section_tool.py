"""Section: plans, elevations and sections to scale of what is in sight, saved as PDF, PNG or DXF.

A click on a measured point sets the height of a plan, or the ends of a section line.  The slab is drawn over the picture; it
can be made a clip, so that the view shows what the sheet will.  Sheets are drawn on a thread of their own.
"""

import weakref
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....commands.section.cut import KINDS, Cut, along_line, elevation, plan
from ....commands.section.sheet_request import THICKNESS
from ....common.errors import InputError
from ....picture.clip import Slab, vector
from ....work.document import unique_name
from ....work.places.pick import Picked
from ....work.places.up_axis import upright_axes
from ....work.selection import Selection
from ...kit import icons
from ...kit.sliders import CLAMP, slider_float
from ...kit.worker import Worker
from ..editing import Pointing, edit, end, ended, metres_per_unit, unit_of
from ..tool import PointerEvent, Tool, ToolContext
from .sheet_choices import FORMATS, SheetChoices, preview_work, sheet_work
from .sheet_preview import SheetPreview

if TYPE_CHECKING:
    from pathlib import Path

    from ...kit.overlay import OverlayCanvas

_HINTS = ("Click the left end of the line.", "Click the right end of the line.", "A further click begins another line.")
"""By the number of ends that are set."""


class SectionTool(Tool):
    """kind: a key of KINDS.  height, azimuth, ends, thickness: of the cut, None until they are set or take a usual value."""

    name, label, icon, key = "section", "Section", icons.SECTION, "N"
    help = "plan, elevation or section to scale, as PDF, PNG or DXF"
    cursor = "crosshair"
    takes_clicks = True

    def __init__(self) -> None:
        self._pointing = Pointing()
        self.kind = "plan"
        self.height: float | None = None
        self.azimuth = 0.0
        self.ends: list[np.ndarray] = []
        self.thickness: float | None = None
        self.sheet = SheetChoices()
        self.worker: Worker | None = None
        self.preview = SheetPreview()

    def cut(self, context: ToolContext) -> Cut | None:
        """The cut as it is set; None while a line lacks an end."""
        scene = context.scene
        if scene is None:
            return None
        up = context.document.up
        if self.kind == "elevation":
            return elevation(self.azimuth, None, scene.bounds, up)
        thickness = self.thickness or self._usual_thickness(context)
        if self.kind == "plan":
            return plan(self._height(context), thickness, up)
        if len(self.ends) < 2:
            return None
        level = upright_axes(up)[:, :2]
        return along_line(self.ends[0] @ level, self.ends[1] @ level, thickness, up)

    def _usual_thickness(self, context: ToolContext) -> float:
        return THICKNESS / (metres_per_unit(context) or 1.0)

    def _height(self, context: ToolContext) -> float:
        """Where a person set it, else a third of the way up."""
        if self.height is not None:
            return self.height
        low, high = self._heights(context)
        return low + 0.35 * (high - low)

    def _heights(self, context: ToolContext) -> tuple[float, float]:
        """Lowest and highest coordinate along the up axis."""
        assert context.scene is not None
        ends = context.scene.bounds @ np.array(context.document.up)
        return float(ends.min()), float(ends.max())

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.button != "left" or event.clicks != 1 or self.kind == "elevation":
            return False
        picked = self._pointing.clicked(context, event.position)
        if picked is None:
            return False
        taken = context.session.work.exact_points.of(context, picked, lambda exact: self._arrived(picked, exact, context))
        place = np.array(taken.position)
        if self.kind == "plan":
            self.height = float(place @ np.array(context.document.up))
        else:
            self.ends = [place] if len(self.ends) != 1 else [*self.ends, place]
        return False

    def _arrived(self, picked: Picked, exact: Picked, context: ToolContext) -> None:
        """The exact place of a picked point is there."""
        up = np.array(context.document.up)
        if self.height == float(np.array(picked.position) @ up):
            self.height = float(np.array(exact.position) @ up)
        self.ends = [np.array(exact.position) if np.array_equal(end, picked.position) else end for end in self.ends]

    def hint(self, context: ToolContext) -> str:
        if self.kind == "plan":
            return "" if self.height is not None else "Click the height of the cut"
        if self.kind == "elevation" or len(self.ends) == 2:
            return ""
        return "Click the other end of the line" if self.ends else "Click one end of the line"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        for place in self.ends if self.kind == "line" else ():
            overlay.marker(place, "accent", 5.0, "diamond")
        cut = self.cut(context)
        if cut is None or context.scene is None or not np.isfinite([cut.near, cut.far]).all():
            return
        corners = np.array(np.meshgrid(*context.scene.bounds.T)).reshape(3, -1).T
        paper = cut.paper(corners)
        low, high = paper.min(axis=0), paper.max(axis=0)
        left, right = max(low[0], cut.left), min(high[0], cut.rightmost)
        for depth in (cut.near, cut.far):
            square = [(left, low[1], depth), (right, low[1], depth), (right, high[1], depth), (left, high[1], depth)]
            overlay.polyline(np.array(square) @ cut.axes + np.array(cut.origin), "accent", 1.5, closed=True)

    def keep_slab(self, context: ToolContext) -> None:
        """Makes the slab a clip, so that the view shows what the sheet will."""
        cut = self.cut(context)
        if cut is None or not np.isfinite([cut.near, cut.far]).all():
            return
        clips = context.document.clips
        centre = np.array(cut.origin) + (cut.near + cut.far) / 2 * np.array(cut.forward)
        name = unique_name(KINDS[cut.kind].capitalize(), (clip.name for clip in clips))
        edit(context, f"Clip {name.lower()}", clips=(*clips, Slab(vector(centre), cut.forward, cut.far - cut.near, name=name)))

    def ask(self, context: ToolContext) -> None:
        """Asks where the sheet is saved, and draws it."""
        if self.cut(context) is None:
            context.toast("Click the two ends of the section line first")
            return
        scale = f" 1-{self.sheet.scale}" if self.sheet.scale else ""
        name = f"{context.session.shown_scan.title.split('.')[0]} {KINDS[self.kind]}{scale}.pdf"
        context.files.save("sheets", f"Save the {KINDS[self.kind]}", name, FORMATS, lambda out: self.start(context, out))

    def start(self, context: ToolContext, out: "Path") -> None:
        """Draws and saves the sheet, on a thread."""
        cut, scene, document = self.cut(context), context.scene, context.document
        if cut is None or scene is None:
            context.toast("Click the two ends of the section line first")
            return
        scene = replace(scene, meta=context.session.facts)
        selection = Selection.in_sight(scene, document)
        work = sheet_work(out, selection, cut, self.sheet.request(), document.meshes,
                          self.sheet.measured(document.measurements))
        self.worker = Worker(work, f"Drawing the {KINDS[cut.kind]}", context.session.loads.wake)

    def follow(self, context: ToolContext) -> None:
        self._follow_preview(context)
        done = ended(self.worker, context, "The sheet was not drawn")
        if done is None:
            return
        self.worker = None
        if done.cancelled:
            context.toast("Drawing cancelled")
        elif done.error is None:
            out, boxes = done.result
            context.tell_saved(out)
            if boxes:
                context.toast(f"On the sheet, {boxes}")

    def _follow_preview(self, context: ToolContext) -> None:
        cut, scene, document = (self.cut(context) if self.preview.shown else None), context.scene, context.document
        if cut is None or scene is None:
            self.preview.follow(context, None, None)
            return
        scene = replace(scene, meta=context.session.facts)
        selection = Selection.in_sight(scene, document)
        measured, request = self.sheet.measured(document.measurements), self.sheet.request()
        work = preview_work(selection, cut, self.sheet, document.meshes, measured)
        hidden = selection.hidden, selection.hidden_classes, id(selection.marks)
        of = cut, request, document.clips, hidden, weakref.ref(context.scene), document.scans, document.meshes, measured
        self.preview.follow(context, of, work)

    def left(self, context: ToolContext) -> None:
        self.preview.shown = False

    @property
    def workers(self) -> "tuple[Worker | None, ...]":
        return (self.worker,)

    @property
    def unfinished(self) -> str:
        return "A sheet is being drawn." if self.worker is not None else ""

    def close(self) -> None:
        end(self.worker)
        self.preview.close()

    def panel(self, ui: Any, context: ToolContext) -> None:
        if context.scene is None:
            return
        half = ui.get_content_region_avail().x / 2
        for number, (kind, title) in enumerate(KINDS.items()):
            if number % 2:
                ui.same_line(half)
            if ui.radio_button(title, self.kind == kind):
                self.kind = kind
        unit = unit_of(context)
        if self.kind == "plan":
            ui.set_next_item_width(-1)
            low, high = self._heights(context)
            changed, height = slider_float("##height", self._height(context), low, high, f"height %.2f {unit}")
            self.height = height if changed and np.isfinite(height) else self.height  # "nan" may be typed
        elif self.kind == "elevation":
            ui.set_next_item_width(-1)
            changed, azimuth = slider_float("##azimuth", self.azimuth, 0.0, 360.0, "looking %.0f°")
            self.azimuth = azimuth if changed and np.isfinite(azimuth) else self.azimuth
            if ui.button("As the camera looks"):
                x, y, _ = upright_axes(context.document.up).T @ context.camera.forward
                self.azimuth = float(np.degrees(np.arctan2(x, y)) % 360)
        else:
            ui.text_wrapped(_HINTS[len(self.ends)])
        if self.kind != "elevation":
            ui.set_next_item_width(-1)
            now = self.thickness or self._usual_thickness(context)
            low, high = self._heights(context)
            least, most = (high - low) / 1e4, 10 * float(np.ptp(context.scene.bounds, axis=0).max())
            text = f"thickness %.3f {unit}"
            changed, thickness = ui.drag_float("##thickness", now, now / 100, least, most, text, CLAMP)
            self.thickness = thickness if changed and np.isfinite(thickness) else self.thickness
            if ui.button("Clip the view to it"):
                self.keep_slab(context)
        self._save(ui, context)
        self.preview.draw(ui, context)

    def _save(self, ui: Any, context: ToolContext) -> None:
        ui.separator()
        if self.worker is not None:
            ui.text_unformatted(self.worker.label or "Drawing…")
            ui.progress_bar(self.worker.fraction or 0.0)
            if ui.button("Cancel"):
                self.worker.cancel()
            return
        self.sheet.panel(ui)
        if ui.button("Preview"):
            self.preview.shown = not self.preview.shown
        ui.same_line()
        if ui.button("Save sheet…"):
            try:
                self.ask(context)
            except InputError as error:
                context.toast(str(error))
