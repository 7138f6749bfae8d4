"""The system's own dialog for choosing files or a folder, which runs beside the window's loop."""

import shutil
import sys
from pathlib import Path
from typing import Any, Literal

PROGRAMS = ("zenity", "kdialog", "matedialog", "qarma")
"""What shows the dialog on Linux."""


def dialog_problem() -> str:
    """Why no dialog can be shown here, "" where it can."""
    if sys.platform in ("darwin", "win32") or any(map(shutil.which, PROGRAMS)):
        return ""
    return "The file dialog needs zenity or kdialog, and neither is installed. Drop files on the window instead."


class OpenDialog:
    """At most one dialog.  ``poll`` is called once a frame."""

    def __init__(self) -> None:
        self._dialog: Any = None

    @property
    def shown(self) -> bool:
        """Whether a dialog is open."""
        return self._dialog is not None

    def show(self, kind: Literal["files", "folder"]) -> None:
        """Opens the dialog, if none is open."""
        from imgui_bundle import portable_file_dialogs as dialogs

        from ..readers.formats import FORMATS

        if self._dialog is not None:
            return
        if kind == "folder":
            self._dialog = dialogs.select_folder("Open a folder of scans")
            return
        patterns = " ".join(f"*{suffix} *{suffix.upper()}" for row in FORMATS for suffix in row.suffixes)
        filters = ["Scans", patterns, "All files", "*"]
        self._dialog = dialogs.open_file("Open scans", "", filters, dialogs.opt.multiselect)

    def poll(self) -> list[Path]:
        """What was chosen since the last call; nothing while the dialog is open or where it was cancelled."""
        if self._dialog is None or not self._dialog.ready(0):
            return []
        chosen, self._dialog = self._dialog.result(), None
        return [Path(path) for path in ([chosen] if isinstance(chosen, str) else chosen) if path]
