"""The volume inside a polygon and the profile along a line, found on a thread when their last point is set; and their choices:
the base from which a volume is measured, the width of the strip of a profile."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....picture.clip import vector
from ....work.fits.measured import InBox, in_scene
from ....work.measuring.height_grid import MOST, measured_volume, volume_between
from ....work.measuring.measurement import MeasuredPoint
from ....work.measuring.profile import WIDTH, Profile, measured_profile
from ....work.measuring.volume import Volume
from ....work.scan_files import files_of
from ....work.selection import Selection
from ...kit.number_field import number_input
from ...kit.widgets import tooltip_beside
from ...kit.worker import Worker
from ...session.two_dates import dates_of
from ..editing import drawn_points, unit_of

if TYPE_CHECKING:
    from ..tool import ToolContext

FITTED, MEAN, TYPED = "through its corners", "level, at their mean height", "level, at a height"
DATES = "between two dates"
BASES = {FITTED: "the plane nearest to the corners", MEAN: "level, as high as the corners are in the mean",
         TYPED: "level, at a height that is typed, taken as exact",
         DATES: "cut is what the scan after lacks of the scan before, fill is what it has more; they are those of the tool "
                "Compare, else the first two that are open"}  # fmt: skip
"""The bases from which volumes are measured, and what each is."""


class Volumes:
    """base: of the next volume, a key of BASES.  height: of TYPED, along the up axis, file units; None: of the first corner.
    width: of the strip of a profile, file units; None: from the spacing of the points.
    worker: of the volume that is being found.  points: of its polygon."""

    def __init__(self) -> None:
        self.base = FITTED
        self.height: float | None = None
        self.width: float | None = None
        self.kind = ""
        self.worker: Worker | None = None
        self.points: tuple[MeasuredPoint, ...] = ()

    def start(self, context: "ToolContext", kind: str, points: tuple[MeasuredPoint, ...]) -> bool:
        """Finds the volume of the drawn points inside a polygon, or their profile; what is being found already is given up.
        False where there are no two dates for a volume between them, which a line says."""
        self.stop()
        scene, kept, up = context.scene, drawn_points(context), np.array(context.document.up)
        assert scene is not None
        corners = np.array([point.position for point in points])
        place = corners[0]
        noise, spacing = np.array([point.noise for point in points]), float(np.median([point.spacing for point in points]))
        level = {FITTED: None, MEAN: "level"}.get(self.base, (float(place @ up) if self.height is None else self.height))
        if isinstance(level, float):
            level -= float(place @ up)

        width, two = self.width, self._two(context, place) if kind == "volume" and self.base == DATES else None
        if kind == "volume" and self.base == DATES and two is None:
            context.toast("A volume between two dates needs two scans that are open together")
            return False

        def work() -> Volume | Profile:
            if kind == "profile":
                made = measured_profile(in_scene(scene, place, kept, MOST), corners - place, spacing, up, width)
                return replace(made, heights=tuple(float(height + place @ up) for height in made.heights))
            if two is not None:
                (one, other), registration, names = two
                between = volume_between(one, other, corners - place, spacing, up, registration, scene.step)
                return replace(between, place=vector(place + between.place), dates=names)
            found = measured_volume(in_scene(scene, place, kept, MOST), corners - place, noise, spacing, up, level, scene.step)
            return replace(found, place=vector(place + found.place))

        self.kind, self.points = kind, points
        self.worker = Worker(work, f"Measuring the {kind}", context.wake)
        return True

    def _two(self, context: "ToolContext", place: np.ndarray) -> "tuple[list[InBox], float, tuple[str, str]] | None":
        """The points of both dates around a place, how unsure their registration is, and their names; None where there are no
        two."""
        scene, session = context.scene, context.session
        assert scene is not None
        parts = files_of(scene)
        if len(parts) < 2 or not all(part.apart for part in parts):
            return None
        comparison = context.document.comparison
        dates = session.work.dates or dates_of(parts, 0, 1)
        clouds = [in_scene(scene, place, Selection.in_sight(scene, replace(edits, changes=None)).keeps, MOST)
                  for edits in dates.edits(session.work.shown_edits)]
        return clouds, 0.0 if comparison is None else comparison.registration, dates.names

    def stop(self) -> None:
        """Gives up what is being found."""
        if self.worker is not None:
            self.worker.cancel()
        self.worker, self.points = None, ()

    def moved(self, at_place: Callable[[list[MeasuredPoint]], list[MeasuredPoint]]) -> None:
        """Gives points their place in the file, which has been read meanwhile."""
        self.points = tuple(at_place(list(self.points)))

    def taken(self, context: "ToolContext") -> tuple[str, tuple[MeasuredPoint, ...], Volume | Profile | None] | None:
        """The kind, the points and what was found, once; None instead where nothing can be found, which a message says."""
        if self.worker is None or not self.worker.finished:
            return None
        worker, points = self.worker, self.points
        self.worker, self.points = None, ()
        if worker.error is not None:
            line = str(worker.error)
            context.toast(line[:1].upper() + line[1:])
            return self.kind, points, None
        return None if worker.cancelled else (self.kind, points, worker.result)

    def panel(self, ui: Any, context: "ToolContext", kind: str) -> None:
        """The base of the next volume, or the width of the next profile's strip."""
        if kind == "profile":
            ui.set_next_item_width(-1)
            usual = WIDTH * (context.scene.spacing if context.scene is not None else 0.0)
            changed, width = number_input(ui, "##width", self.width or usual, f"strip %.3f {unit_of(context)} wide")
            if changed:
                self.width = width if width > 0 else None
            if ui.is_item_hovered():
                tooltip_beside(ui, "Width of the strip along the line whose points are taken; 0: from the points' spacing")
            return
        ui.set_next_item_width(-1)
        if ui.begin_combo("##base", f"Base {self.base}"):
            for name, what in BASES.items():
                if ui.selectable(name, self.base == name)[0]:
                    self.base = name
                if ui.is_item_hovered():
                    tooltip_beside(ui, what)
            ui.end_combo()
        if self.base == TYPED:
            ui.set_next_item_width(-1)
            changed, height = number_input(ui, "##height", self.height or 0.0, f"%.3f {unit_of(context)}")
            self.height = height if changed else self.height
            if ui.is_item_hovered():
                tooltip_beside(ui, "Height of the base along the up axis; until one is typed, that of the first corner")
