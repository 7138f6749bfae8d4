"""Autosave: work that is not saved lies in the state folder a second after every change, whatever happens to the process.

``autosave/TOKEN.json`` in the state folder holds one :class:`UnsavedWork`; it is written by a thread, to disk and in one step,
and removed when the work is saved or discarded.  ``TOKEN.lock`` beside it is locked while its process lives; the system
releases the lock in whatever way the process ends, so a file whose lock is free is offered by the next start
(viewer.window.session.recovery).
"""

import contextlib
import json
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from ....model.common.files.atomic_write import write_atomic
from ....model.common.files.state_folder import state_dir
from ....model.common.system import lock_file, remove_lock_file
from ...common.errors import InputError
from ...common.state_files import read_state
from ...picture.json_values import from_json, to_json
from ...readers.remote.address import whole_path
from ...work.document import Document
from ...work.measuring.measurement import Begun
from ...work.project import document_from_json, with_paths, write_durably

FOLDER = "autosave"
VERSION = 1
LARGEST = 64 << 20
"""Bytes, as of a project file."""
PAUSE_S = 1.0
"""Seconds between two writes; with the time of writing it bounds what a killed process loses."""
RETRY_S = 5.0
"""Seconds until a write that failed is tried again, and between two looks whether what was written is still there."""
_END_S = 10.0  # that a closing window waits for the last write
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class UnsavedWork:
    """document: with absolute paths.  project: the file that it belongs to, "" for none yet; digest: of that file as this
    work knows it (viewer.work.project.digest_of).  title: of the scan or project.  time: seconds since 1970.
    begun: the measurement that is not ended yet."""

    document: Document
    project: str = ""
    digest: str = ""
    title: str = ""
    time: float = field(default=0.0, compare=False)
    begun: Begun | None = None

    def text(self) -> str:
        """The JSON that the autosave file holds."""
        document = with_paths(self.document, whole_path)
        return json.dumps({"pointglass_autosave": VERSION, "title": self.title, "time": self.time, "project": self.project,
                           "digest": self.digest, "document": to_json(document), "begun": to_json(self.begun)},
                          allow_nan=False)


def read_unsaved(path: Path) -> UnsavedWork | None:
    """The work in an autosave file; None where it is gone.  One that cannot be read is set aside (common.state_files)."""

    def parse(data) -> UnsavedWork:
        if data["pointglass_autosave"] != VERSION:
            raise InputError("made by another version of pointglass")
        texts = [data[name] for name in ("project", "digest", "title")]
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("its project, digest or title is no text")
        begun = from_json(Begun | None, data.get("begun"), "begun")
        return UnsavedWork(document_from_json(data["document"]), *texts, time=float(data["time"]), begun=begun)

    return read_state(path, parse, None, most=LARGEST)


def lock(path: Path) -> int | None:
    """Locks a file until the returned descriptor is closed, or the process ends.  None where another process holds it.
    Raises OSError."""
    try:
        return lock_file(path)
    except BlockingIOError:
        return None


def autosave_folder() -> Path:
    """Where autosaves lie.  Not created here."""
    return state_dir() / FOLDER


class Autosave:
    """Keeps one piece of work on disk.  problem: why it could not be written the last time, "" where it was.

    wake: called on the thread when ``problem`` has changed.
    """

    def __init__(self, wake: Callable[[], None] = lambda: None):
        self._wake = wake
        self._news = threading.Condition()
        self._files = threading.Lock()  # held while files are written or removed; never by follow
        self._wanted: UnsavedWork | None = None
        self._kept: UnsavedWork | None = None  # what is on disk
        self._ended = False
        self._file: Path | None = None
        self._lock: int | None = None
        self._thread: threading.Thread | None = None
        self.problem = ""

    def follow(self, work: UnsavedWork | None) -> None:
        """What is to be on disk now; None: nothing, the work is saved or discarded.  Returns at once."""
        with self._news:
            if work == self._wanted:
                return
            self._wanted = work
            self._notify()

    def _notify(self) -> None:
        """Tells the thread that there is something to do; starts it.  Called with ``_news`` held."""
        self._news.notify_all()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="pointglass autosave", daemon=True)
            self._thread.start()

    def adopt(self, file: Path, held: int, unsaved: UnsavedWork) -> None:
        """Goes on with a file that another process left.  held: its lock.  unsaved: what it holds; it goes when that is saved,
        also where it could not be written again meanwhile.  The file this one wrote is removed."""
        with self._files:
            self._remove()
            with self._news:
                self._file, self._lock, self._kept, self._wanted = file, held, unsaved, unsaved
                self._notify()

    def close(self, *, keep: bool) -> None:
        """Ends the thread.  keep: what is not saved stays on disk, written completely; else it is removed."""
        with self._news:
            if not keep:
                self._wanted = None
            self._ended = True
            self._news.notify_all()
        if self._thread is not None:
            self._thread.join(_END_S)
        elif not keep:
            self._remove()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _run(self) -> None:
        while True:
            with self._news:
                while self._wanted == self._kept and not self._ended:
                    self._news.wait(RETRY_S if self._kept is not None else None)
                    if self._kept is not None and not self._is_there():
                        self._kept = None
                wanted, ended = self._wanted, self._ended
                if wanted == self._kept:
                    return
            done = self._bring(wanted)
            with self._news:
                if ended and not done:
                    return
                if not self._ended:
                    self._news.wait_for(lambda: self._ended, PAUSE_S if done else RETRY_S)

    def _bring(self, work: UnsavedWork | None) -> bool:
        """Writes or removes the file.  Returns whether that succeeded."""
        problem = ""
        with self._files:
            try:
                if work is None:
                    self._remove()
                else:
                    self._write(work)
                self._kept = work
            except OSError as error:
                problem = f"Changes cannot be autosaved in {autosave_folder()} ({error.strerror or error})"
        if problem != self.problem:
            self.problem = problem
            if problem:
                _log.warning(problem)
            self._wake()
        return not problem

    def _write(self, work: UnsavedWork) -> None:
        text = replace(work, time=time.time()).text()
        folder = autosave_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if self._file is None or not self._is_locked():
            file = folder / f"{secrets.token_hex(8)}.json"
            held, self._lock = self._lock, lock(file.with_suffix(".lock"))
            self._file = file
            if held is not None:  # the folder was moved away, or emptied: what is left there is offered by the next start
                os.close(held)
        write_atomic(self._file, lambda beside: write_durably(beside, text))

    def _is_there(self) -> bool:
        """Whether the file and its lock are where this window has put them; another program may have moved their folder."""
        return self._file is not None and self._file.exists() and self._is_locked()

    def _is_locked(self) -> bool:
        """Whether the lock that this window holds is the file beside the autosave."""
        if self._file is None or self._lock is None:
            return self._lock is None  # where files cannot be locked there is nothing to compare
        try:
            return os.path.samestat(os.fstat(self._lock), self._file.with_suffix(".lock").stat())
        except OSError:
            return False

    def _remove(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.unlink(missing_ok=True)
            if self._lock is not None:
                held, self._lock = self._lock, None
                remove_lock_file(file.with_suffix(".lock"), held)


def discard(file: Path) -> None:
    """Removes an autosave and its lock."""
    for path in (file, file.with_suffix(".lock")):
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
