"""Keeps the work of a window: saving, the question before unsaved work is left, autosave, and what crashed windows left.

Every way to leave the work that is open goes through :meth:`ProjectFlow.leave`; and a scene that would replace it is only
accepted through :meth:`ProjectFlow.may_replace`, also where the work was changed while the scene was loading.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import numpy as np

from ...common.errors import PointglassError
from ...common.paths import assets_dir
from ...common.text import counted, printable
from ...work.document import Document
from ...work.history import History
from ...work.measuring.measurement import Begun
from ...work.project import SUFFIX, digest_of
from ..file_dialog.file_dialogs import FileDialogs
from ..kit.notices import Answer, Message, ToastSubject
from .autosave import Autosave, UnsavedWork, discard, lock
from .loading import Loaded
from .recent import remember
from .recovery import Recoverable, recoverable, renewed
from .session import Session

_KIND = {"Projects": (SUFFIX,)}
READING_S = 30.0
"""Seconds that saving waits, while the window goes on, for points that are being read from their files.  Text is read slowest:
it takes 0.9 s of a processor a million points (three coordinates and a colour), so 30 s reach 30 million points."""
_LAST_READING_S = 2.0  # that a closing window waits for them

_Content = tuple[Document, Begun | None]


@dataclass(frozen=True)
class _Saving:
    """A project that is saved once its points have been read.  history: of the work that is meant.  until: of monotonic().
    there: digest of the file that may be replaced, "" where there was none."""

    path: Path
    then: Callable[[], object]
    history: History[Document]
    until: float
    there: str


class ProjectFlow:
    """offers: unsaved work of windows that are gone, which nobody has restored or discarded.
    answering: whether a click is not answered yet, which may change the document."""

    def __init__(self, session: Session, files: FileDialogs, wake: Callable[[], None],
                 answering: Callable[[], bool] = lambda: False):
        self._session, self._files, self._answering = session, files, answering
        self.autosave = Autosave(wake)
        self.offers: list[Recoverable] = []
        self._offered: set[Path] = set()
        self._given_up: _Content | None = None  # what the person agreed to lose for a scene that is being opened
        self._closed_with: _Content | None = None  # saved or given up, when the person closed the window
        self._saving: _Saving | None = None
        self._problem = ""
        self._asked: Message | None = None  # whether the work is saved before it is left
        self._left_off: _Content | None = None
        self.look_for_offers()

    # -- what is saved and what is not -------------------------------------------------------------------------------

    @property
    def _shown(self) -> tuple:
        chosen = self._session.view_settings
        return chosen.shown_settings, chosen.background

    @property
    def changed(self) -> bool:
        """Whether there is work that is not saved."""
        return self._session.work.changed(*self._shown)

    @property
    def _content(self) -> _Content:
        """All that a person may lose: what counts as work, and the measurement that is not ended."""
        return self._session.work.content(*self._shown), self._session.work.begun

    @property
    def at_stake(self) -> bool:
        """Whether leaving loses something: work that is not saved, or a measurement that is not ended."""
        return self.changed or self._session.work.begun is not None

    @property
    def name(self) -> str:
        """Of the project, else of the scan."""
        project = self._session.work.project
        return printable(project.name if project is not None else self._session.shown_scan.title)

    @property
    def title(self) -> str:
        """Of the window."""
        return f"{'• ' if self.changed else ''}{self.name} · pointglass" if self._session.scene is not None else "pointglass"

    def follow(self) -> None:
        """Called in every turn of the loop, before a picture is made: hands what is not saved to the autosave."""
        session, work = self._session, self._session.work
        if (found := work.recovered) is not None:
            work.recovered = None
            self._take_over(found)
            self._left_off = None
        self._take_places()
        content = self._content
        if not self.at_stake:
            self._left_off = None
            self.autosave.follow(None)
        elif self._left_off is None or any(a is not b for a, b in zip(self._left_off, content)):
            project = os.path.abspath(work.project) if work.project is not None else ""
            document = work.as_saved(session.camera, *self._shown)
            self._left_off = content
            self.autosave.follow(UnsavedWork(document, project, work.digest, self.name, begun=work.begun))
        self._offer()
        if self.autosave.problem != self._problem:
            self._problem = self.autosave.problem
            if self._problem:
                session.notices.toast(self._problem)

    def close(self) -> None:
        """The window closes.  Work that is neither saved nor given up stays in the autosave, for the next start."""
        keep = self.at_stake and self._closed_with != self._content
        if keep:
            self._session.work.exact_points.wait(_LAST_READING_S)
            self.follow()
        self.autosave.close(keep=keep)

    # -- saving ------------------------------------------------------------------------------------------------------

    def save(self, then: Callable[[], object] = lambda: None) -> None:
        """Saves the project in its file; a new one beside its scan, or where the person says if that is not possible."""
        work, message = self._session.work, self._session.notices.message
        if message is not None and message is self._asked:  # Ctrl+S answers whether to save, and what was asked goes on
            self._session.notices.answer(0)
        elif self._session.scene is None:
            self._session.notices.toast("Nothing to save yet: open a scan first", subject=ToastSubject.NOTHING_OPEN)
        elif work.project is None:
            path = work.project_path
            usual = path is not None and not path.exists() and os.access(path.parent, os.W_OK)
            if path is None or not usual or path.absolute().is_relative_to(assets_dir()):
                self.save_as(then)
            else:
                self._write(path, then)
        elif work.changed_on_disk:
            self._ask_to_replace(work.project, "it was opened or saved here", then)
        else:
            self._write(work.project, then)

    def _ask_to_replace(self, path: Path, since: str, then: Callable[[], object]) -> None:
        """since: when the file was last known, in words."""
        self._session.notices.ask(
            "Replace the project?", f"Another window or program has written {path} since {since}. "
            "Replace loses what it wrote.", (
                Answer("Save as…", lambda: self.save_as(then)), Answer("Replace", lambda: self._write(path, then)),
                Answer("Cancel")))  # fmt: skip

    def save_as(self, then: Callable[[], object] = lambda: None) -> None:
        """Asks for a file, and saves the project in it."""
        if self._session.scene is None:
            return self.save(then)
        path = self._session.work.project_path
        name = path.name if path is not None else f"project{SUFFIX}"
        self._files.save("projects", "Save the project", name, _KIND, lambda chosen: self._write(chosen, then))

    def _write(self, path: Path, then: Callable[[], object]) -> None:
        """Saves; where points are still being read from their files, or a click is not answered yet, once that is done."""
        work, self._saving = self._session.work, None
        if work.exact_points.busy or self._answering():
            what = "the points have been read from their file" if work.exact_points.busy else "what was clicked is measured"
            self._saving = _Saving(path, then, work.history, monotonic() + READING_S, digest_of(path))
            self._session.notices.toast(f"Saving once {what}…")
        else:
            self._write_now(path, then)

    def _take_places(self) -> None:
        """Takes exact places of points that have come, and saves what waited for them."""
        work, before = self._session.work, self._content
        work.exact_points.poll()
        if self._given_up == before:
            self._given_up = self._content
        if self._closed_with == before:
            self._closed_with = self._content
        waiting = self._saving
        if waiting is not None and (not (work.exact_points.busy or self._answering()) or monotonic() >= waiting.until):
            self._saving = None
            if waiting.history is not work.history:
                return
            if digest_of(waiting.path) in ("", waiting.there):
                self._write_now(waiting.path, waiting.then)
            else:  # another window has saved in the same file meanwhile
                self._ask_to_replace(waiting.path, "saving it began", waiting.then)

    def _write_now(self, path: Path, then: Callable[[], object]) -> None:
        session = self._session
        try:
            session.work.save_project(path, session.camera, *self._shown)
        except PointglassError as error:
            session.notices.ask("The project was not saved", str(error), (
                Answer("Save as…", lambda: self.save_as(then)), Answer("Cancel")))  # fmt: skip
        else:
            later = "; points are still being read from their file: save again then" if session.work.exact_points.busy else ""
            session.notices.toast(f"Saved {path}{later}")
            then()

    def remember(self, picture: np.ndarray | None) -> None:
        """Puts what is open among the recent scans: the project, or the scans.  picture: as for session.recent."""
        session, shown, project = self._session, self._session.shown_scan, self._session.work.project
        if session.scene is not None and shown.paths and (not shown.preview or session.loads.reading.on):
            paths = list(shown.paths) if project is None else [project]
            remember(paths, self.name, session.scene.count, picture, session.work.as_saved(session.camera, *self._shown).view)

    # -- leaving -----------------------------------------------------------------------------------------------------

    def leave(self, then: Callable[[], object]) -> None:
        """Calls ``then``, which leaves the work that is open: closes the window or the scan, or opens something else.  Asks
        first where work is not saved, and where a measurement is not ended, which no project keeps."""
        content, begun, answering = self._content, self._session.work.begun, self._answering()
        if not ((lost := self._session.work.lost_outside) or self.at_stake or answering) or self._session.scene is None:
            then()
            return

        def give_up(agreed: _Content = content) -> None:
            self._given_up, self._saving = agreed, None
            then()

        def saved() -> None:  # what is not ended is not asked about again where the question has named it
            named = begun is not None and begun == self._session.work.begun and not (self.changed or self._answering())
            return give_up(self._content) if named else self.leave(then)

        self._session.let_go()
        ask = self._session.notices.ask
        if self.changed or lost:
            more = f", and a measurement of {begun.kind} that is not ended; Save keeps the rest" if begun is not None else ""
            what = f"Save {'' if lost else 'the changes to '}{self.name}?"
            ask(what, f"Discard loses {lost or 'everything since the last save'}{more}.", (
                Answer("Save", lambda: self.save(saved)), Answer("Discard", give_up), Answer("Cancel")))
            self._asked = self._session.notices.message
        elif answering or begun is not None:
            what = "What was clicked last is being measured. Leaving loses it." if answering or begun is None else (
                f"{begun.kind.capitalize()}: {counted(len(begun.points), 'point')} set. Leaving loses them; "
                "a project keeps what is ended.")  # fmt: skip
            ask("Give up the measurement that is not ended?", what, (Answer("Go on"), Answer("Give up", give_up)))

    def end(self, unfinished: list[str], then: Callable[[], object]) -> None:
        """Ends the window by ``then``, as :meth:`leave` does; asks first where something is ``unfinished``, in sentences."""
        def close() -> None:
            self._closed_with = self._content  # saved, or given up before
            then()

        if unfinished:
            self._session.notices.ask("Close the window?", f"{' '.join(unfinished)} Closing loses it.", (
                Answer("Go on"), Answer("Close", lambda: self.leave(close))))  # fmt: skip
        else:
            self.leave(close)

    def may_replace(self, loaded: Loaded) -> bool:
        """Whether a scene may be accepted now: it leaves the work as it is, or that is saved or given up."""
        session = self._session
        if session.keeps_work(loaded) or not (self.at_stake or self._answering()):
            return True
        return self._given_up == self._content

    # -- recovery ----------------------------------------------------------------------------------------------------

    def look_for_offers(self) -> None:
        """Looks again for unsaved work of windows that are gone."""
        self.offers = recoverable()

    def _offer(self) -> None:
        """Offers the unsaved work that belongs to what is open, once."""
        session, work = self._session, self._session.work
        if session.scene is None or session.loads.current is not None or session.notices.message is not None:
            return
        for found in self.offers:
            if found.file in self._offered or not found.belongs_to(work.document, work.project):
                continue
            self._offered.add(found.file)
            session.notices.ask(
                f"Restore unsaved work of {found.unsaved.title}?",
                f"{found.when}: {found.text}. The window ended before it was saved.", (
                    Answer("Restore", lambda found=found: self.leave(lambda: self.restore(found))),
                    Answer("Later"), Answer("Discard", lambda found=found: self.ask_to_discard(found))))  # fmt: skip
            return

    def restore(self, found: Recoverable) -> None:
        """Opens the scans of unsaved work with it; it counts as changed."""
        now = renewed(found)
        if now is None:
            self._session.notices.toast("Another window has restored or discarded it")
            self.look_for_offers()
            return
        self._session.open([], recovered=now)

    def ask_to_discard(self, found: Recoverable) -> None:
        """Removes unsaved work where the person confirms it."""
        self._session.notices.ask(f"Discard the unsaved work of {found.unsaved.title}?", f"{found.when}: {found.text}.", (
            Answer("Keep"), Answer("Discard", lambda: self.discard(found))))  # fmt: skip

    def discard(self, found: Recoverable) -> None:
        """Removes unsaved work."""
        held = lock(found.file.with_suffix(".lock"))
        if held is not None:
            discard(found.file)
            os.close(held)
        self.look_for_offers()

    def _take_over(self, found: Recoverable) -> None:
        """The work is shown: its autosave is this window's own from now on."""
        try:
            held = lock(found.file.with_suffix(".lock"))
        except OSError:
            held = None
        if held is not None:
            self.autosave.adopt(found.file, held, found.unsaved)
        self.offers = [other for other in self.offers if other.file != found.file]
