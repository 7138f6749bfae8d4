"""Passers-by: the row of the Stations tool that shows, dims or hides points which another station saw through.

They are looked for once for each scan, on a thread, when they are first to be dimmed or hidden.  The scene with the marks then
takes the place of the one without, and the other way round.  What the document asks for is followed, so that undo, redo and a
project that is opened do the same as a choice in the list.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ....common.text import counted
from ....picture.edits import GHOSTS
from ....work.ghosts import with_ghosts
from ...kit.widgets import tooltip_beside
from ...kit.worker import BESIDE, Worker
from ..editing import edit, end, ended
from ..tool import ToolContext

if TYPE_CHECKING:
    from ....grid.scene import Scene

EXPLAINED = "people and things that one station measured and another one looked through; nothing is deleted"


class GhostsPanel:
    """found: number of ghosts of the scan shown; None before they were looked for."""

    def __init__(self) -> None:
        self._plain: Scene | None = None
        self._marked: Scene | None = None
        self.search: Worker | None = None

    @property
    def found(self) -> int | None:
        marks = self._marked.marked if self._marked is not None else None
        return None if marks is None else len(marks.numbers)

    def follow(self, context: ToolContext) -> None:
        """Called in every turn of the loop: begins a search, takes its result, shows the scene with or without marks."""
        scene = context.scene
        if scene is not self._plain and scene is not self._marked:
            self._forget(scene)
        if scene is None or context.session.shown_scan.preview or context.session.loads.current is not None:
            return
        if (done := ended(self.search, context, "Passers-by cannot be told")) is not None:
            self.search = None
            if done.result is None or done.cancelled:
                context.session.work.edit("Passers-by shown", ghosts="shown")
                return
            self._marked = done.result
            context.toast(f"{counted(self.found or 0, 'point')} of passers-by found" if self.found else "No passers-by found")
        wanted = context.document.ghosts != "shown"
        if wanted and scene.marked is None:
            if self._marked is not None:
                context.session.show_variant(self._marked)
            elif self.search is None:
                self.search = Worker(lambda: with_ghosts(scene), "Looking for passers-by", context.session.loads.wake,
                                     niceness=BESIDE)
        elif not wanted and scene is self._marked and self._plain is not None:
            context.session.show_variant(self._plain)

    def draw(self, ui: Any, context: ToolContext) -> None:
        """The row: a list of three, disabled with the reason where passers-by cannot be told."""
        scene = context.scene
        if scene is None:
            return
        known = int(np.isfinite(scene.station_places).all(axis=1).sum())
        ui.text_unformatted("passers-by")
        ui.begin_disabled(known < 2 or self.search is not None)
        ui.set_next_item_width(-1)
        if ui.begin_combo("##ghosts", context.document.ghosts):
            for name in GHOSTS:
                if ui.selectable(name, name == context.document.ghosts)[0] and name != context.document.ghosts:
                    edit(context, f"Passers-by {name}", ghosts=name)
            ui.end_combo()
        ui.end_disabled()
        if ui.is_item_hovered(ui.HoveredFlags_.allow_when_disabled):
            tooltip_beside(ui, EXPLAINED)
        if known < 2:
            ui.text_wrapped("Two stations with known positions are needed to tell passers-by.")
        elif self.search is not None:
            share = self.search.fraction
            ui.text_wrapped(f"Looking for passers-by… {share:.0%}" if share is not None else "Looking for passers-by…")
        elif self.found is not None:
            ui.text_wrapped(f"{counted(self.found, 'point')} of passers-by" if self.found else "No passers-by found")

    def close(self) -> None:
        """Ends a search."""
        end(self.search)

    def _forget(self, scene: "Scene | None") -> None:
        if self.search is not None:
            self.search.cancel()
        self._plain, self._marked, self.search = scene, None, None
