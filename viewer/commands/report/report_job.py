"""Makes a report: the file of a project's notes, viewpoints and measurements, by the ending of its name.

The command line and the window make the same file with it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ...common.errors import InputError
from ...common.files import png_bytes
from ...common.fonts import boxes_line
from ...common.progress import progress
from ...common.text import counted, table_bytes
from ...work.measuring.measure_text import labels_of, unit_name
from ...work.notes.attached_picture import attached_bytes
from ...work.notes.note_bcf import Topic, bcf_bytes
from ...work.notes.note_table import csv_text
from ...work.notes.shared_pictures import check_shared
from ..section.sheet import drawn_texts, write_figures, write_whole
from .pages import DPI
from .report_pdf import Wording, picture_count, report_pages
from .view_pictures import ViewPictures, as_reported, released, renderer_for, view_of

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...work.document import Document
    from ...work.notes.annotation import Annotation
    from ...work.viewpoint import Viewpoint

ENDINGS = {"PDF report": (".pdf",), "BCF issues": (".bcf", ".bcfzip"), "CSV table": (".csv",)}
"""Each kind of file as a person reads it, and the endings of its names."""
KNOWN = tuple(ending for endings in ENDINGS.values() for ending in endings)


@dataclass(frozen=True)
class ReportJob:
    """All that a report is made of.

    scene: with the unit and the reference system that the document assigns.  out: the file; its ending is one of KNOWN.
    project: the project's file, None for work that is not saved.  views: viewpoints that a PDF shows.  note: is told, in a
    line, what the file does not hold, or cannot show.
    """

    scene: "Scene"
    document: "Document"
    project: Path | None
    out: Path
    views: "Sequence[Viewpoint]"
    wording: Wording
    note: Callable[[str], object]

    def write(self) -> str:
        """Makes the file.  Returns what was written, in words.  Raises PointglassError; then an older file is as it was."""
        ending, document = self.out.suffix.lower(), as_reported(self.document)
        notes, unit = document.annotations, unit_name(self.scene.meta.metres_per_unit)
        if ending in ENDINGS["CSV table"]:
            write_whole(self.out, lambda beside: beside.write_bytes(table_bytes(csv_text(notes, unit))))
            return counted(len(notes), "note")
        document = self._with_shared_pictures(document)
        renderer = renderer_for(self.scene, document)
        try:
            pictures = ViewPictures(renderer, document)
            if ending in ENDINGS["BCF issues"]:
                self._write_bcf(document, pictures, unit)
                labels = labels_of(document.measurements, unit)
                self._note_boxes([*labels, *(note.title(number) for number, note in enumerate(notes))])
                return counted(len(notes), "note")
            with progress(picture_count(document, self.views), "drawing the report", "picture") as meter:
                figures = report_pages(self.scene, document, self.views, self.wording, pictures.picture, self.note,
                                       lambda: meter.update(1), pictures.changes)
        finally:
            released(renderer)
        write_figures(self.out, [(figure, DPI) for figure in figures])
        self._note_boxes(drawn_texts(figures))
        return counted(len(figures), "page")

    def _note_boxes(self, texts: Sequence[str]) -> None:
        if boxes := boxes_line(texts):
            self.note(boxes)

    def _with_shared_pictures(self, document: "Document") -> "Document":
        """Without the attached pictures that are no part of what is sent; a line names each."""
        notes = []
        for note in document.annotations:
            try:
                if note.picture:
                    check_shared(note.picture, self.project)
            except InputError as error:
                self.note(str(error))
                note = replace(note, picture="")
            notes.append(note)
        return replace(document, annotations=tuple(notes))

    def _write_bcf(self, document: "Document", pictures: ViewPictures, unit: str) -> None:
        topics = []
        with progress(len(document.annotations), "drawing the notes", "picture") as meter:
            for number, note in enumerate(document.annotations):
                view = view_of(note, document)
                snapshot = png_bytes(pictures.picture(view, (note,), (number,))) if view is not None else None
                topics.append(Topic(note, number, view, snapshot, self._attached(note)))
                meter.update(1)
        metres = self.scene.meta.metres_per_unit
        data = bcf_bytes(topics, metres_per_unit=metres, unit=unit, author=self.wording.author or "pointglass",
                         now=datetime.now(UTC).replace(microsecond=0))
        write_whole(self.out, lambda beside: beside.write_bytes(data))

    def _attached(self, note: "Annotation") -> bytes | None:
        if not note.picture:
            return None
        try:
            return attached_bytes(note.picture)
        except InputError as error:
            self.note(str(error))
            return None


def check_ending(out: Path) -> None:
    """Raises InputError where no report is written under such a name."""
    if out.suffix.lower() not in KNOWN:
        raise InputError(f"{out.suffix or 'no ending'} is not written", option="--out", value=out,
                         remedy=f"use {', '.join(KNOWN[:-1])} or {KNOWN[-1]}")
