"""Notes: a click on a measured point writes one there; its text, status, link and picture are edited in the panel.

A click on a marker chooses that note.  All of it is in the document: undone, saved and exported with it.
"""

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....work.document import replaced, without
from ....work.notes.annotation import STATUSES, Annotation
from ....work.places.pick import Picked
from ....work.viewpoint import Viewpoint
from ...kit import icons
from ...kit.theme import fitted
from ...kit.widgets import tooltip_beside
from ..editing import RADIUS, Pointing, edit
from ..outline import Group, Row
from ..tool import KeyEvent, PointerEvent, Tool, ToolContext
from .note_export import NoteExport
from .note_fields import NoteFields, swatch
from .note_markers import SIZE, note_at

if TYPE_CHECKING:
    from ....work.document import Document
    from ...kit.overlay import OverlayCanvas
    from ...kit.worker import Worker


class Notes(Tool):
    """chosen: number of the note that the panel edits, None for none."""

    name, label, icon, key = "notes", "Notes", icons.NOTE, "L"
    help = "notes at measured points: text, status, link, picture; report"
    cursor = "crosshair"
    takes_clicks = picks = writes = True

    def __init__(self) -> None:
        self._pointing = Pointing(meshes=True)
        self.chosen: int | None = None
        self._fields = NoteFields()
        self._export = NoteExport()

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.button != "left" or event.clicks != 1:
            return False
        if (found := note_at(context, event.position, context.pixels(RADIUS))) is not None:
            self.chosen = found
            return False
        picked = self._pointing.clicked(context, event.position)
        if picked is None:
            return False
        taken = context.session.work.exact_points.of(context, picked, lambda exact: self._arrived(picked, exact, context))
        if taken.note is not None:
            context.toast(taken.note)
        made = datetime.now(UTC).isoformat().replace("+00:00", "Z")
        notes = context.document.annotations
        note = Annotation("", taken.position, view=Viewpoint.of(context.camera, ""), made=made, scan=picked.station)
        edit(context, "Write a note", annotations=(*notes, note))
        self.choose(len(notes), typing=True)
        return False

    @property
    def text_coming(self) -> bool:
        return self._fields.asks

    def _arrived(self, picked: Picked, exact: Picked, context: ToolContext) -> None:
        """The place in the file of a picked point is there, as in Measure."""
        if exact.note is not None:
            context.toast(exact.note)

        def corrected(document: "Document") -> "Document":
            made = tuple(replace(note, position=exact.position) if note.position == picked.position else note
                         for note in document.annotations)
            return replace(document, annotations=made) if made != document.annotations else document

        context.session.work.history.revise(corrected)

    def choose(self, number: int | None, *, typing: bool = False) -> None:
        """Shows a note in the panel.  typing: its text takes the keys."""
        self.chosen = number
        if typing:
            self._fields.type()

    def follow(self, context: ToolContext) -> None:
        notes = context.document.annotations
        if self.chosen is not None and self.chosen >= len(notes):  # undone, or of a document that was left
            self.chosen = None
        self._fields.follow(context, notes[self.chosen] if self.chosen is not None else None)
        self._export.follow(context)

    def left(self, context: ToolContext) -> None:
        self._fields.viewer.close_picture()

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.kind != "press" or event.modifiers.control:
            return False
        if event.key == "ESCAPE" and self._fields.viewer.viewed is not None:
            self._fields.viewer.close_picture()
        elif event.key == "ESCAPE" and self.chosen is not None:
            self.choose(None)
        elif event.key == "DELETE" and self.chosen is not None:
            self.delete(context, self.chosen)
        else:
            return False
        return True

    def delete(self, context: ToolContext, number: int) -> None:
        """Takes a note away."""
        notes = context.document.annotations
        edit(context, f"Delete {notes[number].title(number)}", annotations=without(notes, number))
        self.choose(None)

    def change(self, context: ToolContext, number: int, label: str, gesture: object = None, **changes: Any) -> None:
        """Changes fields of a note as one step.  label, gesture: as in History.do."""
        notes = context.document.annotations
        edit(context, label, gesture, annotations=replaced(notes, number, replace(notes[number], **changes)))

    def fly_to(self, context: ToolContext, number: int) -> None:
        """Flies to where a note was written."""
        note, flight = context.document.annotations[number], context.session.flight
        if note.view is None:
            return
        camera = note.view.camera(2, 2)
        flight.show(camera, glide=True)
        context.renew_picture()

    def hint(self, context: ToolContext) -> str:
        return "Click a measured point" if not context.document.annotations else ""

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        hovered, notes = context.session.work.under_pointer, context.document.annotations
        if hovered is not None:
            overlay.marker(hovered.position, "warn", 5.0, "ring")
        if self.chosen is not None and self.chosen < len(notes):
            overlay.marker(notes[self.chosen].position, "text", SIZE + 4.0, "square")

    def outline(self, context: ToolContext) -> tuple[Group]:
        notes = context.document.annotations

        def row(number: int) -> Row:
            note = notes[number]
            return Row(note.title(number), STATUSES[note.status].name, note.beginning, chosen=number == self.chosen)

        def click(number: int) -> None:
            self.wanted = True
            self.choose(number)

        def mark(key: str, number: int) -> None:
            self.change(context, number, "Status of a note", status=key)

        return (Group("Notes", icons.NOTE, len(notes), row, click, commands={
            "Fly to it": lambda number: self.fly_to(context, number),
            **{f"Mark as {status.name.lower()}": partial(mark, key) for key, status in STATUSES.items()},
            "Copy its text": lambda number: context.clipboard.write(notes[number].text),
            "Delete": lambda number: self.delete(context, number),
        }),)  # fmt: skip

    def panel(self, ui: Any, context: ToolContext) -> None:
        notes = context.document.annotations
        if not notes:
            ui.text_wrapped("Click a measured point to write a note there. Notes are saved with the project, and exported as a "
                            "report (PDF), as issues (BCF) or as a table (CSV).")
            return
        ui.text_wrapped("Click a measured point for a new note, or a marker to edit one.")
        for number, note in enumerate(notes):
            ui.push_id(number)
            swatch(ui, context, note)
            ui.dummy((0.6 * ui.get_text_line_height(), 0))
            ui.same_line()
            if ui.selectable(fitted(note.title(number), ui.get_content_region_avail().x), number == self.chosen)[0]:
                self.choose(None if number == self.chosen else number)
            if ui.is_item_hovered() and note.text:
                tooltip_beside(ui, note.beginning)
            ui.pop_id()
        if self.chosen is not None and self.chosen < len(notes):
            ui.separator()
            self._fields.draw(ui, context, self, self.chosen)
        ui.separator()
        self._export.draw(ui, context)
        self._fields.viewer.draw(ui, context)

    @property
    def workers(self) -> "tuple[Worker | None, ...]":
        return (self._export.worker,)

    @property
    def unfinished(self) -> str:
        return self._export.unfinished

    def close(self) -> None:
        self._fields.close()
        self._export.close()

    def export(self, context: ToolContext, path: Path) -> None:
        """Writes the report, issues or table to ``path``."""
        self._export.start(context, path)
