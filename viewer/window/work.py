"""The work of one window: the document, its history, its project file, and what tools share.

A tool changes the document through :meth:`Work.edit`; whoever draws reads ``document``.  No GL, no imgui.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from viewer.camera import Camera
from viewer.errors import InputError
from viewer.render.edits import Edits
from viewer.settings import Settings
from viewer.tools.document import Document, ScanFile, moved
from viewer.tools.history import History
from viewer.tools.pick import Picked
from viewer.tools.project import is_project, read_project, write_project

_DRAWN_ANEW = ("scans", "clips", "look")
"""Fields of the document that decide what the renderer draws."""


class Work:
    """history: of the document.  project: the file it was read from or saved to, else None.  tint: whether pixels are coloured
    by provenance.  under_pointer: the measured point under the pointer, None where there is none or something moves."""

    def __init__(self) -> None:
        self.history = History(Document())
        self.project: Path | None = None
        self.tint = False
        self.under_pointer: Picked | None = None
        self._next: tuple[Document, Path | None] = Document(), None  # what is being opened

    @property
    def document(self) -> Document:
        """The present state."""
        return self.history.current

    @property
    def edits(self) -> Edits:
        """What the document does to the points that are drawn."""
        document = self.document
        hidden = frozenset(number for scan in document.scans for number in scan.hidden_stations)
        return Edits(document.clips, hidden, document.look, document.up)

    def edit(self, label: str, gesture: object = None, **changes: object) -> bool:
        """Changes fields of the document as one step that can be undone.  Returns whether a new picture is needed.

        label, gesture: as in History.do.
        """
        before = self.document
        self.history.do(label, replace(before, **changes), gesture)  # type: ignore[arg-type]
        return self._drawn_anew(before)

    def undo(self) -> tuple[str | None, bool]:
        """Takes the last step back.  Returns its label, None where there is none, and whether a new picture is needed."""
        before = self.document
        return self.history.undo(), self._drawn_anew(before)

    def redo(self) -> tuple[str | None, bool]:
        """Does the step again that was undone last; returns as :meth:`undo`."""
        before = self.document
        return self.history.redo(), self._drawn_anew(before)

    def _drawn_anew(self, before: Document) -> bool:
        return any(getattr(before, name) != getattr(self.document, name) for name in _DRAWN_ANEW)

    @property
    def opens_project(self) -> bool:
        """Whether what is being opened is a project."""
        return self._next[1] is not None

    def begin(self, paths: Sequence[Path]) -> list[Path]:
        """Scans, or one project, are to be opened.  Returns the scans to read: of a project those that are visible.

        Raises InputError where a project is damaged, holds no visible scan, or is not alone.
        """
        projects = [path for path in paths if is_project(path)]
        if not projects:
            self._next = Document(tuple(ScanFile(str(path)) for path in paths)), None
            return list(paths)
        if len(paths) > 1:
            raise InputError(f"{projects[0]}: a project is opened by itself, not together with other files")
        document = read_project(projects[0])
        scans = [Path(scan.path) for scan in document.scans if scan.visible]
        if not scans:
            raise InputError(f"{projects[0]}: no scan of this project is visible; nothing to open")
        for scan in scans:
            if not scan.exists():
                raise InputError(f"{projects[0]}: its scan {scan} is not there; move it back or change the path in the project")
        self._next = document, projects[0]
        return scans

    def accept(self) -> Document:
        """What :meth:`begin` began is shown now.  Returns its document."""
        document, self.project = self._next
        self.history, self.under_pointer, self._next = History(document), None, (Document(), None)
        return document

    def save_project(self, path: Path, camera: Camera, settings: Settings, background: str) -> None:
        """Writes the document with what the window shows now.  Raises InputError naming the file."""
        document = replace(moved(self.document, camera), settings=settings, background=background)
        write_project(path, document)
        self.history.replace(document)
        self.history.saved()
        self.project = path
