"""Select: points by a lasso on the picture, a box, a side of a plane or what hangs together; and what is done with them.

What is selected is tinted and stays in the document: undone, saved and drawn by F12 like the rest.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ....common.text import counted
from ....grid.records.point_marks import file_keys
from ....picture.clip import Vector
from ....picture.colour_modes import CLASSES
from ....picture.point_sets import NO_POINTS, PointSet
from ....work.selecting import set_changes
from ....work.selecting.connected_region import connected_region
from ....work.selecting.select_points import (
    Selected,
    beside_plane,
    by_outline,
    combined,
    described,
    in_box,
    in_sight,
    not_covered,
)
from ...kit import icons
from ..editing import Pointing, edit, points_in_sight
from ..outline import Group
from ..tool import KeyEvent, PointerEvent, Tool, ToolContext
from .box_handles import BoxHandles
from .lasso_outline import LassoOutline
from .listed_sets import ListedSets
from .select_panel import SelectPanel
from .set_job import SetJob

if TYPE_CHECKING:
    from ....picture.camera import Camera
    from ...kit.overlay import OverlayCanvas
    from ...kit.worker import Worker

SHAPES = {
    "lasso": "draw a line around points with the left button held, or click its corners; Enter ends it",
    "box": "click a point to put a box around it, drag its faces, then Enter",
    "plane": "click three points of a plane, or one and Enter for a level one; its side is selected",
    "connected": "click a point: what hangs together with it is selected",
}
_HINTS = {"box": "Click a measured point", "connected": "Click a measured point"}


class Select(Tool):
    """shape: a key of SHAPES.  how: of viewer.work.selecting.select_points.HOW.  seen_only: a lasso takes what the picture
    shows, not what is behind it.  other_side: of a plane.  gap: file units that separate what does not hang together; None:
    from the spacing.  smooth: what is connected ends at edges."""

    name, label, icon, key = "select", "Select", icons.SELECT, "R"
    help = "select by lasso, box, plane, surface: classify, hide, export"
    cursor = "crosshair"
    takes_clicks = True

    def __init__(self) -> None:
        self.shape, self.how, self.other_side = "lasso", "new", False
        self.gap: float | None = None
        self.smooth, self.seen_only = True, False
        self.outline_drawn, self.box, self.job = LassoOutline(), BoxHandles(), SetJob()
        self.places: list[Vector] = []  # of a plane
        self.facts: Selected | None = None
        self.done = "", ("", "")  # the last step that left nothing selected: its label, and two lines about it
        self._pointing, self._panel, self._listed = Pointing(), SelectPanel(self, SHAPES), ListedSets(self)
        self._how = ""  # of the outline under way

    def choose_shape(self, shape: str) -> None:
        """Another way to select; what was begun is dropped."""
        self.shape, self.picks = shape, shape != "lasso"
        self.outline_drawn.drop()
        self.places = []

    # -- the pointer and the keys ------------------------------------------------------------------------------------

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        held = event.modifiers
        how = "add" if held.shift else "subtract" if held.control else self.how
        if self.shape == "lasso":
            return self._lasso(event, how, context)
        if self.shape == "box" and self.box.pointer(event, context):
            return True
        if event.kind != "release" or event.button != "left" or event.clicks != 1:
            return False
        picked = self._pointing.clicked(context, event.position)
        if picked is None:
            return False
        if self.shape == "box":
            self.box.put(context, picked.position)
        elif self.shape == "plane":
            self._how = self._how if self.places else how
            self.places.append(picked.position)
            if len(self.places) == 3:
                self.finish(context)
        else:
            self._connected(picked.position, how, context)
        return False

    def _lasso(self, event: PointerEvent, how: str, context: ToolContext) -> bool:
        if event.kind == "leave":
            self.outline_drawn.drop()
            return False
        if event.kind != "move" and event.button != "left":
            return False
        if event.kind == "press" and not self.outline_drawn:
            self._how = how
        if self.outline_drawn.take(event, context):
            self.finish(context)
        return event.kind == "press" or bool(event.button)

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.kind != "press" or event.modifiers.control:
            return False
        if event.key in ("ENTER", "KP_ENTER"):
            self.finish(context)
        elif event.key == "BACKSPACE" and (self.outline_drawn or self.places):
            self.outline_drawn.take_back()
            self.places = self.places[:-1]
        elif event.key == "ESCAPE" and (self.outline_drawn or self.places):
            self.choose_shape(self.shape)
        elif event.key == "ESCAPE" and context.document.selection:
            edit(context, "Select nothing", selection=NO_POINTS)
        elif event.key == "DELETE" and context.document.selection:
            self.delete(context)
        else:
            return False
        return True

    def finish(self, context: ToolContext) -> None:
        """Selects by what has been drawn or set."""
        scene, camera = context.scene, self.outline_drawn.camera
        if scene is None:
            return
        if self.shape == "lasso" and camera is not None and len(self.outline_drawn.corners) >= 3:
            corners = np.array(self.outline_drawn.corners)
            self.outline_drawn.drop()
            shown = self._shown(context) if self.seen_only else ()
            if shown is None:
                context.toast("The picture is not at rest: draw again in a moment")
                return

            def find() -> np.ndarray:
                hits = by_outline(scene, camera, corners)
                return not_covered(scene, *shown[:1], hits, *shown[1:]) if shown else hits

            self.start(context, find, self._how)
        elif self.shape == "box" and self.box.box is not None:
            box = self.box.box
            self.start(context, lambda: in_box(scene, box), self.how)
        elif self.shape == "plane" and len(self.places) in (1, 3):
            self._plane(context)

    @staticmethod
    def _shown(context: ToolContext) -> "tuple[Camera, np.ndarray, np.ndarray] | None":
        """The camera at the size of the picture shown, its depth and its mask; None where it does not show the present view."""
        frame, session = context.viewport.frame, context.session
        if frame is None or session.flight.moving or session.screen.needs_picture:
            return None
        depth, mask = (context.viewport.pixels.read(frame, name, wait=True) for name in ("depth", "mask"))
        if depth is None or mask is None:
            return None
        return context.camera.resized(depth.shape[1], depth.shape[0]), depth, mask

    def _plane(self, context: ToolContext) -> None:
        scene, places, up = context.scene, np.array(self.places), np.array(context.document.up)
        assert scene is not None
        self.places, place, normal = [], places[0], up
        if len(places) == 3:
            normal = np.cross(places[1] - place, places[2] - place)
            if not np.linalg.norm(normal) > 1e-9 * float(np.ptp(scene.bounds, axis=0).max()) ** 2:
                context.toast("These three points lie on a line: click others")
                return
            normal = normal / np.linalg.norm(normal)
            upright = abs(float(normal @ up)) < 0.05  # 3 degrees from upright: it has a near side, not an upper one
            towards = -context.camera.sight_of(place) if upright else up
            normal = normal * (1.0 if normal @ towards >= 0 else -1.0)
        normal = -normal if self.other_side else normal
        self.start(context, lambda: beside_plane(scene, place, normal), self._how)

    def _connected(self, place: Vector, how: str, context: ToolContext) -> None:
        sight, gap, smooth = points_in_sight(context), self.gap, self.smooth
        if sight is not None:
            self.start(context, lambda: connected_region(sight, np.array(place), gap, smooth=smooth), how, seen=True)

    # -- what becomes of it ------------------------------------------------------------------------------------------

    def start(self, context: ToolContext, find: Callable[[], np.ndarray], how: str, *, seen: bool = False) -> None:
        """Selects the points in sight among those that ``find`` gives, (N,) bool.  seen: they are in sight."""
        scene, sight, edits = context.scene, points_in_sight(context), context.document
        if scene is None or sight is None:
            return

        def work() -> Selected:
            hits = find()
            return combined(scene, edits, hits if seen else in_sight(sight, hits), how)

        self.job.start(context, "Selecting points", work, lambda made: self._selected(made, context))

    def _selected(self, made: Selected, context: ToolContext) -> None:
        self.facts = made
        if made.points == context.document.selection:
            context.toast("No further point lies there" if made.points else "No point in sight lies there")
        edit(context, f"Select {counted(made.points.count, 'point')}", selection=made.points)

    def change(self, context: ToolContext, label: str, make: Callable[[Any], dict[str, Any]],
               done: tuple[str, str] = ("", "")) -> None:
        """Changes sets of the document as one step, beside the window.  make: gives the changes from the files of the scene.
        done: what is said then, on two lines, until another step."""
        scene = context.scene

        def take(changes: dict[str, Any]) -> None:
            edit(context, label, **changes)
            if done[0]:
                self.done = label, done
                context.toast(f"{' '.join(done)}; Ctrl+Z undoes")

        if scene is not None:
            self.job.start(context, label, lambda: make(file_keys(scene)), take)

    def keep(self, context: ToolContext, name: str = "Region", *, shown: bool = True) -> None:
        """The selection becomes a region."""
        edit(context, f"Keep as {name}" if shown else "Hide the selection",
             **set_changes.kept_as_region(context.document, name, shown=shown))

    def delete(self, context: ToolContext) -> None:
        """The selected points are in no picture and no export; the outliner's eye shows them again."""
        document, points = context.document, counted(context.document.selection.count, "point")
        self.change(context, f"Delete {points}", lambda files: set_changes.deleted(document, files), (f"{points}:", "deleted"))

    def show_alone(self, context: ToolContext, points: PointSet) -> None:
        """Hides all other points."""
        document = context.document
        self.change(context, "Show nothing else", lambda files: set_changes.shown_alone(document, points, files))

    def classify(self, context: ToolContext, code: int | None) -> None:
        """Gives the selected points another class; None: that of their file."""
        document, points = context.document, counted(context.document.selection.count, "point")
        name = "as in the file" if code is None else f"{code} {CLASSES.get(code, ('user-defined',))[0]}"
        self.change(context, f"Classify {points}: {name}", lambda files: set_changes.classified(document, code, files),
                    (f"{points}: class now", name))

    def invert(self, context: ToolContext) -> None:
        """Selects what is in sight and was not selected."""
        scene, sight, edits = context.scene, points_in_sight(context), context.document
        if scene is None or sight is None:
            return

        def work() -> Selected:
            seen = combined(scene, edits, in_sight(sight, np.ones(scene.count, bool)), "new").points
            files = file_keys(scene)
            return described(scene, edits, set_changes.inverted(edits, seen.mask(files), files))

        self.job.start(context, "Inverting the selection", work, lambda made: self._selected(made, context))

    # -- the window --------------------------------------------------------------------------------------------------

    def follow(self, context: ToolContext) -> None:
        self.job.follow(context)
        self._listed.follow(context)
        camera = self.outline_drawn.camera
        if camera is not None and camera.key != context.camera.key:
            if self.outline_drawn:
                context.toast("The view moved: begin the outline again")
            self.outline_drawn.drop()
        selection, scene = context.document.selection, context.scene
        if self.facts is not None and self.facts.points != selection:
            self.facts = None
        if selection and self.facts is None and scene is not None and self.job.worker is None \
                and not context.session.shown_scan.preview and scene.records is not None:
            edits = context.document  # of an earlier step, or of a project that was opened
            self.job.start(context, "Measuring the selection", lambda: described(scene, edits, selection), self._describe)

    def _describe(self, made: Selected) -> None:
        self.facts = made

    def left(self, context: ToolContext) -> None:
        self.outline_drawn.drop()
        self.places = []

    def hint(self, context: ToolContext) -> str:
        if self.shape == "lasso":
            if not self.outline_drawn:
                return "" if context.document.selection else "Draw around points, or click corners"
            return "Enter ends, Backspace takes a corner back"
        if self.shape == "plane":
            return ("Click a point of the plane", "Two more, or Enter: level", "One more point")[len(self.places)]
        if self.shape == "box" and self.box.box is not None:
            return "Drag its faces; Enter selects"
        return _HINTS[self.shape]

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        if self.shape == "lasso":
            self.outline_drawn.draw(overlay, context.session.pointer)
            return
        hovered = context.session.work.under_pointer
        if hovered is not None:
            overlay.marker(hovered.position, "warn", 5.0, "ring")
        if self.shape == "box":
            self.box.draw(overlay)
        for place in self.places:
            overlay.marker(place, "warn", 5.0)

    def panel(self, ui: Any, context: ToolContext) -> None:
        self._panel.draw(ui, context)

    def outline(self, context: ToolContext) -> tuple[Group, ...]:
        return self._listed.groups(context)

    @property
    def workers(self) -> "tuple[Worker | None, ...]":
        return (self.job.worker, self._listed.worker)

    def close(self) -> None:
        self.job.close()
        self._listed.close()
