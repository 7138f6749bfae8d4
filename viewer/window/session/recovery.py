"""Recovery: work that a process which is gone has left in an autosave, what it holds in words, and how it is opened again."""

import contextlib
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path

from ....model.common.files.temporary import sweep
from ...common.errors import InputError
from ...common.text import counted
from ...work.contents import contents
from ...work.document import Document
from ...work.project import read_project
from .autosave import UnsavedWork, autosave_folder, lock, read_unsaved


@dataclass(frozen=True)
class Recoverable:
    """file: the autosave.  unsaved: what it holds."""

    file: Path
    unsaved: UnsavedWork

    @property
    def when(self) -> str:
        """When it was written, local time."""
        return time.strftime("%d %b %Y, %H:%M", time.localtime(self.unsaved.time))

    @property
    def text(self) -> str:
        """What it holds, in words."""
        texts = contents(self.unsaved.document)
        if self.unsaved.begun is not None:
            texts.append(f"a measurement not ended, of {counted(len(self.unsaved.begun.points), 'point')}")
        return ", ".join(texts) or "changed settings of the picture"

    def belongs_to(self, document: Document, project: Path | None) -> bool:
        """Whether it was made of the scans, or in the project, that are open."""
        if self.unsaved.project and project is not None:
            return os.path.abspath(project) == self.unsaved.project
        mine = {os.path.abspath(scan.path) for scan in self.unsaved.document.scans}
        return bool(mine) and mine == {os.path.abspath(scan.path) for scan in document.scans}


@dataclass(frozen=True)
class Opening:
    """What is being opened.  project: its file; digest: of that file.  saved: what is on disk, None: ``document``.
    recovered: the autosave that it comes from."""

    document: Document
    project: Path | None = None
    digest: str = ""
    saved: Document | None = None
    recovered: Recoverable | None = None


def opening_of(found: Recoverable) -> Opening:
    """How unsaved work is opened: against what its project holds now, or against its scans without any work."""
    unsaved = found.unsaved
    if not unsaved.project:
        return Opening(unsaved.document, saved=Document(unsaved.document.scans), recovered=found)
    project = Path(unsaved.project)
    try:
        saved = read_project(project)
    except InputError:  # gone, or damaged: saving will write it again
        saved = Document(unsaved.document.scans)
    return Opening(unsaved.document, project, unsaved.digest, saved, found)


def recoverable() -> list[Recoverable]:
    """Work whose process is gone, the latest first.  What cannot be read is set aside, with a line in the log."""
    found = []
    with contextlib.suppress(OSError):
        sweep(autosave_folder())
        for file in sorted(autosave_folder().glob("[!.]*.json")):  # one that begins with a point is being written
            with contextlib.suppress(OSError):
                held = lock(file.with_suffix(".lock"))
                if held is None:
                    continue  # its window is open
                if (unsaved := read_unsaved(file)) is not None:
                    found.append(Recoverable(file, unsaved))
                else:  # saved meanwhile, or not readable
                    file.with_suffix(".lock").unlink(missing_ok=True)
                os.close(held)
    return sorted(found, key=lambda each: each.unsaved.time, reverse=True)


def renewed(found: Recoverable) -> Recoverable | None:
    """The same as it is on disk now; None where it is gone, or another window has taken it."""
    unsaved = read_unsaved(found.file)
    return None if unsaved is None else replace(found, unsaved=unsaved)
