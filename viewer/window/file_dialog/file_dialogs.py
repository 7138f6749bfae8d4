"""Files chosen by a person: one dialog at a time, the system's own or the one inside the window.

``save`` and ``open`` return at once; ``done`` is called from the window's loop, in a later turn, with what was chosen, and not
at all where the dialog was cancelled.  A path that ``done`` of ``save`` receives may be written: it has an ending, its folder
exists, and where it exists already the person agreed to replace it.  From a tool::

    def _export(self, context):
        context.files.save("measurements", "Export measurements", "measurements.csv", {"CSV table": (".csv",)},
                           lambda path: self._write(context, path))

Each purpose (any short word) has a folder of its own that is remembered; the first time it is that of the scan.
The system's dialog is used where there is one, unless a person prefers the one inside the window (``prefer_window``), and where
a save dialog must ask (a name typed without its ending that exists with it) the question is asked inside the window.
"""

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

from ...readers.remote.address import is_address
from .file_choice import EVERY, Endings, FileChoice, Request
from .remembered_folders import RememberedFolders

PROGRAMS = ("zenity", "kdialog", "matedialog", "qarma")
"""What shows the system's dialog on Linux."""
_AT_ONCE = 0.4
"""Seconds within which nobody closes a dialog: one that ends sooner could not be shown, and that inside the window is."""


def system_dialog() -> bool:
    """Whether the system has a file dialog."""
    if sys.platform in ("darwin", "win32"):
        return True
    shown = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return shown and any(map(shutil.which, PROGRAMS))


class FileDialogs:
    """The dialogs of one window.

    choice: the dialog inside the window that is open, else None.  has_system: whether the system has one.
    scan_folder: where the scan shown lies, replaceable.
    wake: called on another thread when there is something to draw.
    """

    def __init__(self, wake: Callable[[], None] = lambda: None, scan_folder: Callable[[], Path | None] = lambda: None):
        self._wake, self.scan_folder = wake, scan_folder
        self.folders = RememberedFolders()
        self.choice: FileChoice | None = None
        self._chosen: set[tuple[str, Path | None]] = set()  # purposes in this window, and where the scan lay
        self._system: tuple[Any, Request] | None = None
        self.has_system = system_dialog()
        self._since = 0.0  # when it was opened, seconds

    @property
    def polls(self) -> bool:
        """Whether the system's dialog is open, which does not wake the loop."""
        return self._system is not None

    def save(self, purpose: str, title: str, name: str, endings: Endings, done: Callable[[Path], object]) -> None:
        """Asks where a file is to be saved.  name: suggested.  endings: of the kinds of file; the first one is the usual."""
        self._show(Request(purpose, title, "save", lambda paths: done(paths[0]), endings, name))

    def open(self, purpose: str, title: str, endings: Endings, done: Callable[[list[Path]], object], *, many: bool = False,
             addresses: bool = False, inside: bool = False, folder: Path | None = None) -> None:
        """Asks for an existing file, or several.  addresses: one of a scan may be typed instead, where the dialog is inside the
        window.  inside: it is, also where the system has its own.  folder: where to begin, instead of the remembered one."""
        self._show(Request(purpose, title, "open", done, {**endings, **EVERY}, many=many, addresses=addresses), folder, inside)

    def open_folder(self, purpose: str, title: str, done: Callable[[Path], object]) -> None:
        """Asks for an existing folder."""
        self._show(Request(purpose, title, "folder", lambda paths: done(paths[0])))

    def prefer_window(self, preferred: bool) -> None:
        """Whether the dialog inside the window is used although the system has one; remembered."""
        self.folders.prefer_window(preferred)

    def first_folders(self, purpose: str, *, saves: bool = False) -> list[Path]:
        """Where a dialog begins: the first of these that is there.  saves: what is made of a scan is saved beside it, unless
        another folder was chosen for it in this window: the remembered one is of another work."""
        found = [self.folders.folder_of(purpose), scan := self.scan_folder(), Path.cwd(), Path.home()]
        if saves and scan is not None and (purpose, scan) not in self._chosen:
            found.insert(0, scan)
        return [folder.absolute() for folder in found if folder is not None]

    def _show(self, request: Request, folder: Path | None = None, inside: bool = False) -> None:
        """A dialog inside the window that asks for something else goes: what was asked for last is what a person wants."""
        if self._system is not None or (self.choice is not None and self.choice.request.title == request.title):
            return
        self.close()
        begin = ([folder] if folder is not None else []) + self.first_folders(request.purpose, saves=request.kind == "save")
        self.has_system = system_dialog()  # which may have been installed meanwhile
        if self.has_system and not (self.folders.in_window or inside):
            self._since = monotonic()
            self._system = _system(request, next((folder for folder in begin if folder.is_dir()), begin[-1])), request
        else:
            self.choice = FileChoice(request, begin, self._wake)

    def poll(self) -> bool:
        """Called in every turn of the loop: gives what was chosen to whoever asked.  Returns whether something changed."""
        before = self.choice, self.choice and (self.choice.question, self.choice.problem, self.choice.listing.folder)
        if self.choice is not None:
            self.choice.follow()
            if self.choice.result is not None:
                choice, self.choice = self.choice, None
                self._finish(choice.request, choice.result or [])
            elif self.choice.cancelled:
                self.close()
        if self._system is not None and self._system[0].ready(0):
            (dialog, request), self._system = self._system, None
            chosen = dialog.result()
            failed = not chosen and monotonic() - self._since < _AT_ONCE
            paths = [Path(path) for path in ([chosen] if isinstance(chosen, str) else chosen) if path]
            if paths and request.kind == "save":
                self._check_ending(request, paths[0])
            elif paths:
                self._finish(request, paths)
            elif failed:
                self.choice = FileChoice(request, self.first_folders(request.purpose), self._wake)
        after = self.choice, self.choice and (self.choice.question, self.choice.problem, self.choice.listing.folder)
        return before != after

    def _check_ending(self, request: Request, path: Path) -> None:
        """The system's dialog asked about the name as typed; where an ending is added, the file of that name counts."""
        choice = FileChoice(request, [path.parent], self._wake)
        whole = choice.named(path)
        if whole == path or not whole.exists():
            self._finish(request, [whole])
        else:
            choice.text, choice.question, self.choice = whole.name, whole, choice

    def _finish(self, request: Request, paths: list[Path]) -> None:
        if not (request.addresses and is_address(paths[0])):
            paths = [path.absolute() for path in paths]
            self._chosen.add((request.purpose, self.scan_folder()))
            self.folders.note(request.purpose, paths[0] if request.kind == "folder" else paths[0].parent)
        request.done(paths)

    def close(self) -> None:
        """Closes the dialog inside the window, as Esc does."""
        if self.choice is not None:
            self.choice.listing.cancel()
            self.choice = None


def _system(request: Request, folder: Path) -> Any:
    from imgui_bundle import portable_file_dialogs as dialogs

    if request.kind == "folder":
        return dialogs.select_folder(request.title, str(folder))
    filters: list[str] = []
    for name, endings in request.endings.items():
        patterns = " ".join(f"*{ending} *{ending.upper()}" for ending in endings if ending)
        filters += [name, patterns or "*"]
    if request.kind == "save":
        return dialogs.save_file(request.title, str(folder / request.name), filters)
    options = dialogs.opt.multiselect if request.many else dialogs.opt.none
    return dialogs.open_file(request.title, str(folder / "."), filters, options)
