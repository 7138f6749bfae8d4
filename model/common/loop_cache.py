"""Where compiled loops are kept, and the line that says that they are being compiled.  Imports no numba.

numba keeps machine code in ``__pycache__`` beside a module.  An installation may be read-only (a system-wide Python, a
container run by another user); the loops are then kept in the user's cache folder.  The files are pickles, so that a folder
which another user could write to is not used.
"""

import logging
import os
import stat
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from time import perf_counter

from .system import only_own, user_number

_log = logging.getLogger(__name__)
_QUIET_SECONDS = 2.0
"""Seconds of compiling after which the line is shown: single loops of a tool that was not used before compile faster."""


@cache
def writable(folder: Path) -> bool:
    """Whether files can be made in ``folder``, which is created where it is missing."""
    import tempfile

    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@cache
def user_folder() -> Path | None:
    """The user's folder of compiled loops, created for this user alone; None where none can be written.

    In POINTGLASS_CACHE if set, else the user's cache folder, else the folder for temporary files.
    """
    import tempfile

    if configured := os.environ.get("POINTGLASS_CACHE"):
        home = Path(configured).expanduser()
    else:
        from platformdirs import user_cache_path

        home = user_cache_path("pointglass", appauthor=False)
    name = f"loops-{user_number()}"
    temporary = Path(tempfile.gettempdir()) / f"pointglass-{name}"
    return next((folder for folder in (home / name, temporary) if _made(folder)), None)


def _made(folder: Path) -> bool:
    """Creates a folder that only this user can write to.  Returns whether it is one."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    return only_own(found) and stat.S_ISDIR(found.st_mode) and writable(folder)


def kept_in(package: Path) -> Path | None:
    """Folder in which the loops of a module in folder ``package`` are kept; None: nowhere, each process compiles them again."""
    beside = package / "__pycache__"
    return beside if writable(beside) else user_folder()


class CompilingNotice:
    """Calls ``tell`` with one line, once in a process, when compiling goes on for longer than a moment.  Thread-safe.

    tell: replaced by the command line and the window; in Python ``logging`` prints the line, as it prints warnings.
    """

    def __init__(self) -> None:
        self.tell: Callable[[str], None] = _log.warning
        self.kept = True  # False once a loop has no folder in which it could be kept
        self._spent, self._since, self._depth, self._told = 0.0, 0.0, 0, False
        self._lock = threading.Lock()

    def started(self) -> None:
        """A loop begins to be compiled; loops that it calls may be compiled within."""
        with self._lock:
            if self._depth == 0:
                self._since = perf_counter()
            self._depth += 1
            tell = self._spent > _QUIET_SECONDS and not self._told
            self._told = self._told or tell
        if tell:
            self.tell(self.line())

    def ended(self) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._spent += perf_counter() - self._since

    def line(self) -> str:
        if self.kept:
            return "compiling loops, once, about a minute"
        return ("compiling loops, about a minute, in every process: no folder to keep them in can be written; "
                "set POINTGLASS_CACHE to one")


NOTICE = CompilingNotice()
