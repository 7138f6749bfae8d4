"""The work of one window: the document, its history, its project file, and what tools share.

A tool changes the document through :meth:`DocumentState.edit`; whoever draws reads ``document``.  No GL, no imgui.
"""

import contextlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...common.errors import InputError
from ...common.rigid_transform import Rows
from ...picture.camera import Camera
from ...picture.edits import Edits
from ...picture.point_sets import PointLevels
from ...picture.settings import Settings
from ...preprocess.scan_description import ScanDescription
from ...readers.meshes.mesh_formats import scans_and_meshes
from ...readers.photographs.posed_photograph import PosedPhotograph
from ...work.document import Document, ScanFile, moved
from ...work.history import History
from ...work.measuring.measurement import Begun
from ...work.moved_scans import ScanPlace, difference, place_of
from ...work.pictures.picture_legend import Legend
from ...work.places.pick import Picked
from ...work.project import (
    digest_of,
    moves_of,
    places_in,
    project_among,
    project_beside,
    read_project,
    relocated,
    scans_of,
    write_project,
)
from ...work.reference import with_reference
from .exact_points import ExactPoints
from .recovery import Opening, Recoverable, opening_of
from .two_dates import TwoDates

LARGEST_SHOT = 4
"""Times the sides of the window's picture that F12 saves at most."""


@dataclass
class ShownPhoto:
    """What the person chose: the photograph, how much of it is seen (0 to 1), and whether it is shown left of a line only."""

    photo: PosedPhotograph
    blend: float = 1.0
    split: bool = False
    split_at: float = 0.5


class DocumentState:
    """history: of the document.  project: the file it was read from or saved to, else None.
    shot_scale: times the sides of the picture that F12 saves.  shot_measured: whether measurements are drawn over it.
    shot_noted: whether notes are.  shot_legend: whether the legend of recoloured points and the scale
    bar of an orthographic view are.
    tint: whether pixels are coloured by provenance.  tint_rows: colour and text of each row of its legend.
    photo: the photograph shown over the view.
    under_pointer: the measured point under the pointer, None where there is none or something moves.
    exact_points: picked points of the work whose values are being read from their files.
    arriving_meshes: mesh files that are to be read and laid beside the scan once it is there.
    begun: the measurement that is not ended yet, None where there is none.
    reference_problem: why the assigned reference system cannot be used, None where it can.
    set_aside: numbers of stations that a tool does not draw for the moment; changes: levels of points that a comparison shows,
    and change_legend what they mean; dates: the two files at the sides of the handle, None: both sides show the same points; no
    part of the document.
    located: path of a scan in a project -> where a person said it is, None: left out.
    digest: of the project's file as it was read or written here.  recovered: where the document was read from, if that was an
    autosave, until somebody takes it over."""

    def __init__(self) -> None:
        self.history = History(Document())
        self.project: Path | None = None
        self.tint = False
        self.tint_rows: list[tuple[tuple[int, int, int], str]] = []
        self.under_pointer: Picked | None = None
        self.arriving_meshes: list[Path] = []
        self.exact_points = ExactPoints()
        self.begun: Begun | None = None
        self.photo: ShownPhoto | None = None
        self.shot_scale = 1
        self.shot_measured = False
        self.shot_noted = False
        self.shot_legend = False
        self.reference_problem: str | None = None
        self.set_aside: tuple[int, ...] = ()
        self.changes: PointLevels | None = None
        self.change_legend: Legend | None = None
        self.dates: TwoDates | None = None
        self.located: dict[str, str | None] = {}
        self.digest = ""
        self.recovered: Recoverable | None = None
        self._facts: tuple[ScanDescription, tuple[ScanFile, ...], ScanDescription] | None = None
        self._next = Opening(Document())
        self._saved = Document()
        self._content: tuple[tuple, Document] | None = None
        self._places: dict[str, ScanPlace] = {}  # of the scans as loaded, by absolute path; else as in the project's file

    @property
    def document(self) -> Document:
        """The present state."""
        return self.history.current

    @property
    def shown_edits(self) -> Edits:
        """What changes pictures: the document's edits, without the stations that are set aside."""
        edits = self.document.edits
        if self.changes is not None:
            edits = replace(edits, changes=self.changes)
        elif edits.comparison is not None:  # it is being made
            edits = replace(edits, comparison=None)
        if not self.set_aside:
            return edits
        return replace(edits, hidden_stations=tuple(sorted({*edits.hidden_stations, *self.set_aside})))

    def facts(self, meta: ScanDescription) -> ScanDescription:
        """``Scene.meta`` with the unit and the reference system that the document assigns; ``meta`` where they cannot be used,
        and :attr:`reference_problem` says why."""
        scans = self.document.scans
        if self._facts is None or self._facts[0] is not meta or self._facts[1] != scans:
            self.reference_problem = None
            try:
                found = with_reference(meta, scans)
            except InputError as error:
                found, self.reference_problem = meta, str(error)
            self._facts = meta, scans, found
        return self._facts[2]

    def edit(self, label: str, gesture: object = None, **changes: object) -> None:
        """Changes fields of the document as one step that can be undone.  The session draws a new picture where its
        description differs (Session.spec).  label, gesture: as in History.do."""
        self.history.do(label, replace(self.document, **changes), gesture)  # type: ignore[arg-type]

    def undo(self) -> str | None:
        """Takes the last step back.  Returns its label, None where there is none."""
        return self.history.undo()

    def redo(self) -> str | None:
        """Does the step again that was undone last; returns as :meth:`undo`."""
        return self.history.redo()

    @property
    def opens_other(self) -> bool:
        """Whether what is being opened has a document of its own: a project or an autosave."""
        return self._next.project is not None or self._next.recovered is not None

    def opening_moves(self) -> dict[str, Rows]:
        """The transformations of the scans of what :meth:`begin` began."""
        return moves_of(self._next.document.scans)

    def begin(self, paths: Sequence[Path], recovered: "Recoverable | None" = None) -> list[Path]:
        """Scans, or one project, are to be opened, or the scans of an autosave.  Returns the scans to read: of a project those
        that are visible.

        Raises InputError where a project is damaged, holds no visible scan, or is not alone, and for meshes without a scan;
        MissingScans where scans are not
        there and nobody has located them.
        """
        self.arriving_meshes = []
        if recovered is not None:
            opening = opening_of(recovered)
            document, scans = self._located(opening.project or recovered.file, opening.document)
            self._next = replace(opening, document=document)
            return scans
        project = project_among(paths)
        if project is None:
            files, self.arriving_meshes = scans_and_meshes(paths)
            self._next = Opening(Document(tuple(ScanFile(str(path)) for path in files)))
            return files
        digest, saved = digest_of(project), read_project(project)
        document, scans = self._located(project, saved)
        self._next = Opening(document, project, digest, saved)
        return scans

    def _located(self, project: Path, saved: Document) -> tuple[Document, list[Path]]:
        """The document with its scans where a person located them, and those to read.  One that was left out, because it was
        not there, stays in the document: it is asked for again, or shown when it is back.  Raises as :meth:`begin`."""
        there = {path: now for path, now in self.located.items() if now is not None}
        away = {path: None for path in self.located if path not in there and not os.path.exists(path)}
        return relocated(saved, there), scans_of(project, relocated(saved, there | away))

    def accept(self) -> Document:
        """What :meth:`begin` began is shown now.  Returns its document."""
        opened, self._next = self._next, Opening(Document())
        self.project, self.digest, self.recovered = opened.project, opened.digest, opened.recovered
        self._note_places(opened.project)
        self.begun = opened.recovered.unsaved.begun if opened.recovered is not None else None
        self.changes = self.change_legend = self.dates = None
        self.exact_points = ExactPoints()  # points that are still being read are of the former work
        saved = opened.document if opened.saved is None else opened.saved
        self.history, self.under_pointer, self._saved = History(saved), None, replace(saved, view=None)
        self.history.do("Restore unsaved work", opened.document)
        return self.document

    def _note_places(self, project: Path | None) -> None:
        """Keeps what a project file records of its scans, for saving while one is not there."""
        with contextlib.suppress(InputError):  # an autosave whose project is gone
            found = places_in(project) if project is not None else {}
            self._places = {os.path.abspath(path): place for path, place in found.items()}

    def note_loaded(self, paths: Sequence[Path]) -> list[str]:
        """Scans have been loaded: keeps their sizes and checksums.  Returns, in words, which of them are other files than those
        that the project was saved with, or that were loaded before."""
        replaced = []
        for whole in map(os.path.abspath, paths):
            found, known = place_of(whole, Path(whole)), self._places.get(whole)
            if known is not None and found.ends and (why := difference(Path(whole), whole, known)):
                replaced.append(f"{Path(whole).name}: {why}")
            if found.ends or known is None:
                self._places[whole] = found
        return replaced

    def leave(self) -> None:
        """No scan is open any more."""
        self._next = Opening(Document())
        self.accept()

    def content(self, settings: Settings, background: str) -> Document:
        """What counts as work: the document without the place of the camera.  Of a project also how it is looked at; a scan
        that is only looked at has nothing to be saved."""
        key = self.document, settings, background, self.project
        if self._content is None or any(a is not b for a, b in zip(self._content[0], key)):
            document = replace(self.document, view=None)
            if self.project is not None:
                document = replace(document, settings=settings, background=background)
            self._content = key, document
        return self._content[1]

    def changed(self, settings: Settings, background: str) -> bool:
        """Whether there is work that is not saved: what would be saved now is not what was opened or saved last."""
        return self.content(settings, background) != self._saved

    @property
    def project_path(self) -> Path | None:
        """Where the project is saved: its file, else beside the first scan; None where no scan is open."""
        if self.project is not None or not self.document.scans:
            return self.project
        return project_beside(self.document)

    def as_saved(self, camera: Camera, settings: Settings, background: str) -> Document:
        """The document with what the window shows now."""
        return replace(moved(self.document, camera), settings=settings, background=background)

    @property
    def lost_outside(self) -> str:
        """What closing would lose, in words, because the project's file has been deleted or written by another program since it
        was read or written here; "" where it holds what was saved."""
        if self.project is not None and not self.project.exists():
            return "all of it: its file is not there any more"
        return "what was saved here: another window or program has written its file since" if self.changed_on_disk else ""

    @property
    def changed_on_disk(self) -> bool:
        """Whether another program has written the project's file since it was read or written here."""
        return self.project is not None and digest_of(self.project) not in ("", self.digest)

    def save_project(self, path: Path, camera: Camera, settings: Settings, background: str) -> None:
        """Writes the document with what the window shows now.  Raises InputError naming the file."""
        document = self.as_saved(camera, settings, background)
        write_project(path, document, self._places)
        self._note_places(path)
        self.history.replace(document)
        self.project, self.digest, self._saved = path, digest_of(path), replace(document, view=None)
