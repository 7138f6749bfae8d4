"""Measure: distances, heights, angles and areas between measured points and fitted planes; the plane, pipe or circle at one.

Points snap to measured points only.  A stored measurement is drawn by the overlay whichever tool is selected; all of it is
in the document, so it is undone, saved and exported with it.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ....common.errors import InputError
from ....work.document import unique_name
from ....work.measuring.measure_files import ENDINGS
from ....work.measuring.measure_text import silhouette_text
from ....work.measuring.measurement import KINDS, Begun, MeasuredPoint, Measurement
from ....work.meshes.pick_mesh import ON_MODEL
from ....work.places.pick import Picked
from ...kit import icons
from ...kit.widgets import tooltip_beside
from ..editing import Pointing, edit, measured_point, step
from ..outline import Group
from ..tool import KeyEvent, PointerEvent, Tool, ToolContext
from .begun_points import GivenUp, goes_over, left_text
from .drawing import COMPUTED, draw_begun
from .fitting import Fitting
from .listed_measurements import draw_list, measurement_group
from .measurement_export import MeasurementExport
from .volumes import Volumes

if TYPE_CHECKING:
    from ....work.document import Document
    from ....work.history import History
    from ....work.measuring.profile import Profile
    from ....work.measuring.volume import Volume
    from ...kit.overlay import OverlayCanvas
    from ...kit.worker import Worker


class Measure(Tool):
    """Sets points by clicks; Enter or a double click ends a polyline or an area, Backspace takes the last point back.

    What is not ended stays while another tool is selected, and goes on when this one is again, which says so."""

    name, label, icon, key = "measure", "Measure", icons.MEASURE, "T"
    help = "measure points, planes, pipes, volumes, profiles"
    cursor = "crosshair"
    takes_clicks = picks = True

    def __init__(self) -> None:
        self._pointing = Pointing(meshes=True)
        self.kind = "distance"
        self.points: list[MeasuredPoint] = []
        self._last: Picked | None = None  # of the points that are set, with the grid's place
        self._left: list[MeasuredPoint] = []  # were there when the tool was selected
        self._given_up: GivenUp | None = None
        self._fitting, self._volumes = Fitting(), Volumes()
        self._history: History[Document] | None = None  # of the work that the points belong to
        self.export = MeasurementExport()

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.clicks == 0:
            return False
        if event.button == "right":
            self._drop_last()
            return False
        if event.button != "left":
            return False
        if event.clicks == 2:  # its first click has set the last point
            self._finish(context)
            return False
        picked = self._pointing.clicked(context, event.position)
        if picked is None:
            return False
        taken = context.session.work.exact_points.of(context, picked, lambda exact: self._arrived(picked, exact, context))
        before = [*self.points, *self._fitting.points]
        if before and before[-1].position in (picked.position, taken.position):
            context.toast("This is the point that was set before: click another one")
            return False
        if taken.note is not None:
            context.toast(taken.note)
        point, self._given_up = measured_point(context, taken), None
        if self._fitting.points or KINDS[self.kind].surface(len(self.points)) is not None:
            self.answering = self._fitting.add(context, self.kind, point)
        else:
            self._last = picked
            self._set(point, context)
        return False

    def selected(self, context: ToolContext) -> None:
        self._left, self._given_up = list(self.points), None

    def _set(self, point: MeasuredPoint, context: ToolContext) -> None:
        self.points.append(point)
        if len(self.points) == KINDS[self.kind].most:
            self._finish(context)

    def _arrived(self, picked: Picked, exact: Picked, context: ToolContext) -> None:
        """The place in the file of a picked point is there: also where its measurement has been ended, or undone, meanwhile.
        Where the file cannot be read, ``exact`` has the grid's place, nothing changes, and a message says why."""
        if exact.note is not None:
            context.toast(exact.note)

        def at_place(points: Iterable[MeasuredPoint]) -> list[MeasuredPoint]:
            return [replace(point, position=exact.position) if point.position == picked.position else point for point in points]

        def corrected(document: "Document") -> "Document":
            made = tuple(replace(item, points=tuple(at_place(item.points))) for item in document.measurements)
            return replace(document, measurements=made) if made != document.measurements else document

        self.points, self._left = at_place(self.points), at_place(self._left)
        if (lost := self._given_up) is not None:
            self._given_up = replace(lost, points=at_place(lost.points), waiting=at_place(lost.waiting))
        self._fitting.moved(at_place)
        self._volumes.moved(at_place)
        context.session.work.history.revise(corrected)

    def follow(self, context: ToolContext) -> None:
        """Keeps the points that are set among the work of the window, and takes those that an autosave has kept."""
        work = context.session.work
        if work.history is not self._history:
            if self._history is not None:
                self._fitting.stop()
                self._volumes.stop()
            self._history, begun = work.history, work.begun
            if self.export:  # its points are no longer read
                self.export.end()
                context.toast("The measurements were not exported: their scan was left")
            self.points = list(begun.points) if begun is not None else []
            if begun is not None:
                self.kind, self.wanted, self._left = begun.kind, True, list(self.points)
        begun = Begun(self.kind, tuple(self.points)) if self.points else None
        if begun != work.begun:
            work.begun = begun
        self._take_fitted(context)
        self.answering = bool(self._fitting.points or self._volumes.points)

    def _take_fitted(self, context: ToolContext) -> None:
        """Surfaces of clicks have been found, or the volume of a polygon."""
        if (measured := self._volumes.taken(context)) is not None:
            kind, points, result = measured
            if result is not None:
                self._add(kind, points, context, **{kind: result})
            elif kind == self.kind == "volume" and not self.points:
                self.points = list(points)  # its last corner can be taken back
        while (found := self._fitting.taken(context, len(self.points))) is not None:
            kind, point = found
            if KINDS[kind].most == 1:
                self._add(kind, (point,), context)
            elif kind == self.kind:
                self._set(point, context)

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.key == "ESCAPE" and event.kind == "press" and (self._fitting.points or self._volumes.points):
            self._fitting.stop()
            self._volumes.stop()
            return True
        undoes = event.key == "Z" and event.modifiers.control and not event.modifiers.shift
        if undoes and event.kind == "press" and self._bring_back(context):
            return True
        if event.kind == "release" or not (self.points or self._fitting.points):
            return False
        if event.key in ("ENTER", "KP_ENTER"):
            self._finish(context)
        elif event.key in ("BACKSPACE", "DELETE"):
            self._drop_last()
        elif event.key == "ESCAPE":
            self.points.clear()
        elif undoes:
            self._drop_last()
        else:
            return False
        return True

    def _change_kind(self, kind: str, context: ToolContext) -> None:
        """Measures another kind from now on; points that do not belong to it are given up, and can be brought back."""
        fitting = [] if KINDS[self.kind].most == 1 else self._fitting.of(self.kind)
        if fitting or not goes_over(self.points, kind):
            history = context.session.work.history
            self._given_up = GivenUp(self.kind, self.points, fitting, history, history.undo_label)
            context.toast(self._given_up.text)
            self.points = []
            self._fitting.drop(self.kind)
        self.kind = kind

    def _bring_back(self, context: ToolContext) -> bool:
        """Brings back what another kind has given up, where that was the last thing done.  Returns whether."""
        lost, self._given_up = self._given_up, None
        if lost is None or self.points or self._fitting.points or not lost.is_last(context.session.work.history):
            return False
        self.kind, self.points = lost.kind, lost.points
        for point in lost.waiting:
            self._fitting.add(context, self.kind, point)
        return True

    def _drop_last(self) -> None:
        if self._fitting.points:
            self._fitting.drop_last()
        elif self.points:
            self.points.pop()
            self._last = None

    def _finish(self, context: ToolContext) -> None:
        kind = KINDS[self.kind]
        if len(self.points) < kind.fewest:
            if kind.most is None and self.points:
                context.toast(f"{kind.name}: {kind.fewest} points at least")
            return
        points, self.points = tuple(self.points), []
        if self.kind in COMPUTED:
            self.answering = self._volumes.start(context, self.kind, points)
            self.points = [] if self.answering else list(points)
        else:
            self._add(self.kind, points, context)

    def _add(self, kind: str, points: tuple[MeasuredPoint, ...], context: ToolContext, **found: "Volume | Profile") -> None:
        document = context.document
        name = unique_name(KINDS[kind].name, (item.name for item in document.measurements))
        try:
            made = Measurement(kind, points, name, document.up, **found)  # type: ignore[reportArgumentType]
        except InputError as error:  # of planes that have no corner
            context.toast(str(error))
            return
        edit(context, f"Measure {name.lower()}", measurements=(*document.measurements, made))
        if about := silhouette_text(made):
            context.toast(f"{about[:1].upper()}{about[1:]}")

    @property
    def _left_over(self) -> str:
        """What is said of points that were all set before the tool was selected; "" otherwise."""
        return left_text(Begun(self.kind, tuple(self.points))) if self.points and self.points == self._left else ""

    def hint(self, context: ToolContext) -> str:
        kind = KINDS[self.kind]
        placed = len(self.points) + (len(self._fitting.of(self.kind)) if kind.most != 1 else 0)
        click = f"Click {kind.click(placed)}"
        if left := self._left_over:
            return left
        if self._volumes.points:
            return f"Measuring the {self._volumes.kind}…  ·  Esc gives up"
        if self._fitting.points:
            more = f"  ·  {click}" if 0 < placed < (kind.most or 0) else ""
            return f"Fitting…{more}  ·  Esc gives up"
        if not placed:
            known = not kind.surfaces or any(item.kind == self.kind for item in context.document.measurements)
            return "" if known and context.document.measurements else click
        if self.points and self.points[-1].beyond is not None and self.kind != "volume":
            click = f"On a silhouette: less exact{'; Pipe fits the diameter' if self.kind == 'distance' else ''}  ·  {click}"
        ends = "  ·  Enter ends" if kind.most is None and placed >= kind.fewest else ""
        return f"{click}{ends}  ·  Backspace takes one back  ·  Esc gives up"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        hovered = context.session.work.under_pointer
        points, kind = list(self.points), KINDS[self.kind]
        for waiting in self._fitting.points:
            overlay.marker(waiting.position, "warn", 4.0)
        if hovered is not None:
            overlay.marker(hovered.position, "warn", 5.0, "ring")
            if kind.surface(len(points)) is None and not self._is_last(hovered):
                points.append(MeasuredPoint(hovered.position))
        if self.points:
            draw_begun(overlay, self.kind, points, context)

    def _is_last(self, picked: Picked) -> bool:
        """Whether it is the point that was set last, whose place in the file may have been read meanwhile."""
        if not self.points or picked.position == self.points[-1].position:
            return bool(self.points)
        return self._last is not None and self._last.index == picked.index != ON_MODEL

    def outline(self, context: ToolContext) -> tuple[Group]:
        return (measurement_group(self, context),)

    def panel(self, ui: Any, context: ToolContext) -> None:
        ui.set_next_item_width(-1)
        if ui.begin_combo("##kind", KINDS[self.kind].name, ui.ComboFlags_.height_largest):  # all kinds, without scrolling
            for name, kind in KINDS.items():
                if ui.selectable(kind.name, self.kind == name)[0] and name != self.kind:
                    self._change_kind(name, context)
                if ui.is_item_hovered():
                    tooltip_beside(ui, kind.what)
            ui.end_combo()
        if left := self._left_over:
            ui.text_wrapped(left)
        if self.kind in COMPUTED:
            self._volumes.panel(ui, context, self.kind)
        history = context.session.work.history
        ui.begin_disabled(history.undo_label is None and self._given_up is None)
        if ui.button("Undo") and not self._bring_back(context):
            step(context, redo=False)
        ui.end_disabled()
        ui.same_line()
        ui.begin_disabled(history.redo_label is None)
        if ui.button("Redo"):
            step(context, redo=True)
        ui.end_disabled()
        self._list(ui, context)

    def _list(self, ui: Any, context: ToolContext) -> None:
        found = context.document.measurements
        if not found:
            ui.text_wrapped("Click measured points. Values carry their uncertainty (95 %), from point spacing and range noise.")
            return
        draw_list(ui, context)
        ui.separator()
        if ui.button("Export…"):
            context.files.save("measurements", "Export the measurements", "measurements.csv", ENDINGS,
                               lambda path: self.export.start(context, path))
        if ui.is_item_hovered():
            tooltip_beside(ui, f"As {', '.join(ENDINGS)}")

    @property
    def workers(self) -> "list[Worker | None]":
        return [self._volumes.worker]

    @property
    def unfinished(self) -> str:
        return "Measurements are exported when their points have been read." if self.export else ""

    def close(self) -> None:
        self._volumes.stop()
        self.export.end()
