"""What lies in a folder, listed on a thread: a slow or unreachable folder must not stop the window."""

import os
import re
import stat
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

_SHOWN_EVERY = 0.25
"""Seconds between two partial lists of a folder that takes long.  The window sorts each: 0.7 s of a processor for 100,000
names, so 9,000 names take a quarter of this time.  A partial list is below the 1 s at which a wait is noticed (Nielsen
1993)."""


@dataclass(frozen=True)
class Entry:
    """One row of a folder.  folder: whether it is one, links followed.  size: bytes, None of folders and of what cannot be
    read.  modified: seconds since 1970, None where it cannot be read."""

    name: str
    folder: bool
    size: int | None = None
    modified: float | None = None

    @property
    def hidden(self) -> bool:
        return self.name.startswith(".")


def words(error: OSError) -> str:
    """Why a file or folder cannot be used, in words."""
    if isinstance(error, PermissionError):
        return "you do not have permission to open it"
    if isinstance(error, FileNotFoundError):
        return "it does not exist"
    if isinstance(error, NotADirectoryError):
        return "it is a file, not a folder"
    return (error.strerror or str(error)).lower()


def natural(name: str) -> tuple:
    """Sorts ``scan 9`` before ``scan 10``, capital and small letters alike."""
    parts = filter(None, re.split(r"(\d+)", name.casefold()))
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts)


class FolderList:
    """The entries of ``folder``, complete once ``finished``.

    entries: what was found so far, in no order.  problem: why the folder cannot be listed, "" where it can.
    wake: called on the listing thread whenever there is more to show.
    otherwise: folders that are listed instead, the first that is there, where ``folder`` is not.
    """

    def __init__(self, folder: Path, wake: Callable[[], None] = lambda: None, otherwise: Sequence[Path] = ()):
        self.folder = folder
        self._otherwise = otherwise
        self.entries: tuple[Entry, ...] = ()
        self.problem = ""
        self.finished = False
        self._wake, self._cancelled = wake, False
        self._thread = threading.Thread(target=self._run, name="pointglass folder", daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """Another folder is wanted: the thread ends at its next entry."""
        self._cancelled = True

    def join(self, seconds: float) -> None:
        """Waits for the list."""
        self._thread.join(seconds)

    def _run(self) -> None:
        found: list[Entry] = []
        shown = monotonic()
        if not self.folder.is_dir():
            self.folder = next((folder for folder in self._otherwise if folder.is_dir()), self.folder)
        try:
            with os.scandir(self.folder) as rows:
                for row in rows:
                    if self._cancelled:
                        return
                    found.append(_entry(row))
                    if monotonic() - shown > _SHOWN_EVERY:
                        self.entries, shown = tuple(found), monotonic()
                        self._wake()
        except OSError as error:
            self.problem = f"{self.folder}: {words(error)}"
        except ValueError as error:  # a NUL in the name
            self.problem = f"{self.folder}: {error}"
        self.entries, self.finished = tuple(found), True
        self._wake()


def _entry(row: os.DirEntry) -> Entry:
    try:
        facts = row.stat()
    except OSError:  # a link that leads nowhere, a file that went meanwhile
        return Entry(row.name, False)
    folder = stat.S_ISDIR(facts.st_mode)
    return Entry(row.name, folder, None if folder else facts.st_size, facts.st_mtime)


def size_text(size: int | None) -> str:
    """``1.4 GB``, "" for None."""
    if size is None:
        return ""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            value = size / factor
            return f"{value:.1f} {unit}" if value < 10 else f"{value:.0f} {unit}"
    return f"{size} B"
