"""Regions and classes as the outliner lists them: an eye, a name, a number of points, a menu."""

import weakref
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....common.text import count_text, counted
from ....grid.records.point_marks import marks_of, unknown_sets
from ....picture.colour_modes import CLASSES, category_colours
from ....picture.regions import Region
from ....work.document import replaced, without
from ....work.selecting.set_changes import class_counts
from ...kit import icons
from ...kit.worker import Worker
from ..editing import edit, end, ended, points_in_sight
from ..outline import Group, Row
from ..tool import ToolContext

if TYPE_CHECKING:
    from ....grid.scene import Scene

_FEW = 6
"""Classes that are listed without a click: with more, work and jobs below them would need scrolling at 1280 x 720."""
_COLOURS = category_colours("class")


def class_name(code: int) -> str:
    """Number and name of a class."""
    return f"{code} {CLASSES.get(code, ('user-defined',))[0]}"


def thousands(count: int) -> str:
    """A number of points with thin spaces."""
    return f"{count:,}".replace(",", "\u2009")


class ListedSets:
    """counts: present class -> number of points; those of the moment before while they are counted.  worker: that counts."""

    def __init__(self, tool: Any):
        """tool: the Select tool, which lists them."""
        self._tool = tool
        self.counts: dict[int, int] = {}
        self.worker: Worker | None = None
        self._of: tuple[weakref.ref[Scene] | None, object] = None, ()
        self._counting: tuple[weakref.ref[Scene] | None, object] = None, ()

    def follow(self, context: ToolContext) -> None:
        """Counts the classes again where points have been classified."""
        scene, changes = context.scene, context.document.reclassified
        done = ended(self.worker, context, "The classes could not be counted")
        if done is not None:
            self.worker = None
            if done.error is None and not done.cancelled:
                self.counts = done.result
            self._of = self._counting
        if scene is None or self.worker is not None:
            return
        if self._of[0] is not None and self._of[0]() is scene and self._of[1] == changes:
            return
        if self._of[0] is None or self._of[0]() is not scene:
            self.counts = dict(scene.attributes.classes)
            if not context.session.shown_scan.preview and (lost := unknown_sets(scene, context.document)):
                context.session.notices.say_also("Some points of this project are not there", *lost)
        edits = context.document
        self._counting = weakref.ref(scene), changes
        if changes:
            self.worker = Worker(lambda: class_counts(scene, marks_of(scene, edits)), "Counting classes", context.wake)
        else:
            self.counts, self._of = dict(scene.attributes.classes), self._counting

    def close(self) -> None:
        end(self.worker)

    def groups(self, context: ToolContext) -> tuple[Group, ...]:
        """Regions, then classes where points have them."""
        return self._regions(context), self._classes(context)

    def _regions(self, context: ToolContext) -> Group:
        regions, tool = context.document.regions, self._tool

        def store(label: str, number: int, gesture: object = None, **fields: object) -> None:
            changed = replace(regions[number], **fields)  # type: ignore[arg-type]
            edit(context, label, gesture, regions=replaced(regions, number, changed))

        def row(number: int) -> Row:
            region: Region = regions[number]
            about = f"{region.name}: {counted(region.points.count, 'point')}.  A click selects them"
            return Row(region.name, about=about, shown=region.shown, aside=count_text(region.points.count))

        def select(number: int) -> None:
            tool.wanted = True
            edit(context, f"Select {regions[number].name}", selection=regions[number].points)

        return Group(
            "Regions", icons.REGION, len(regions), row, select,
            show=lambda number, on: store(f"{'Show' if on else 'Hide'} {regions[number].name}", number, shown=on),
            rename=lambda number, name: store("Rename region", number, ("region", number), name=name),
            commands={
                "Select its points": select,
                "Show nothing else": lambda number: tool.show_alone(context, regions[number].points),
                "Export its points…": lambda number: context.saves.points.ask(regions[number].points, regions[number].name),
                "Remove (its points stay)": lambda number: edit(context, f"Remove {regions[number].name}",
                                                                regions=without(regions, number)),
            })  # fmt: skip

    def _classes(self, context: ToolContext) -> Group:
        codes, hidden, tool = sorted(self.counts), context.document.hidden_classes, self._tool

        def hide(label: str, numbers: set[int]) -> None:
            edit(context, label, hidden_classes=tuple(sorted(numbers)))

        def show(number: int, on: bool) -> None:
            code = codes[number]
            hide(f"{'Show' if on else 'Hide'} class {code}", set(hidden) - {code} if on else {*hidden, code})

        def row(number: int) -> Row:
            code = codes[number]
            about = f"{class_name(code)}: {counted(self.counts[code], 'point')}.  A click selects those in sight"
            return Row(class_name(code), about=about, shown=code not in hidden, aside=count_text(self.counts[code]),
                       colour=tuple(int(level) for level in _COLOURS[code]))  # type: ignore[arg-type]

        def select(number: int) -> None:
            sight, code = points_in_sight(context), codes[number]
            if sight is not None:
                tool.wanted = True
                tool.start(context, lambda: np.asarray(sight.classes_of(slice(None))) == code, "new")

        return Group(
            "Classes", icons.CLASS, len(codes) if len(codes) > 1 or hidden else 0, row, select, show=show,
            commands={
                "Select its points": select,
                "Show this class only": lambda number: hide(f"Show class {codes[number]} only", set(codes) - {codes[number]}),
                "Show all classes": lambda _: hide("Show all classes", set()),
            }, opened=len(codes) <= _FEW)  # fmt: skip
