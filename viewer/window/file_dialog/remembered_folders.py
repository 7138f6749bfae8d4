"""Folders that file dialogs begin in, remembered from one start to the next: ``folders.json`` in the user's state folder.

``{"last": {PURPOSE: FOLDER}, "recent": [FOLDER, ...], "in_window": BOOL}``.  It is written when a file is chosen,
so that a crash forgets nothing.  A file that cannot be read counts as empty.
"""

import logging
from pathlib import Path

from ....model.common.files.state_folder import state_dir
from ...common.state_files import read_state, write_state

FILE = "folders.json"
MOST_RECENT = 8
"""Folders listed as recent places."""
_log = logging.getLogger(__name__)


class RememberedFolders:
    """The folder of each purpose, the recent folders, and whether the dialog inside the window is preferred to the system's."""

    def __init__(self) -> None:
        self._last: dict[str, str] = {}
        self._recent: list[str] = []
        self.in_window = False
        self._read()

    def _read(self) -> None:
        def parse(found) -> tuple[dict[str, str], list[str], bool]:
            last, recent = found.get("last", {}), found.get("recent", [])
            return ({name: folder for name, folder in last.items() if isinstance(folder, str)},
                    [folder for folder in recent if isinstance(folder, str)][:MOST_RECENT], found.get("in_window") is True)

        self._last, self._recent, self.in_window = read_state(state_dir() / FILE, parse, ({}, [], False))

    def folder_of(self, purpose: str) -> Path | None:
        """Where a file of this purpose was chosen last; None where it never was."""
        found = self._last.get(purpose)
        return Path(found) if found else None

    @property
    def recent(self) -> list[Path]:
        """Folders used last, the latest first."""
        return [Path(folder) for folder in self._recent]

    def note(self, purpose: str, folder: Path) -> None:
        """A file of this purpose was chosen in ``folder``."""
        text = str(folder)
        self._last[purpose] = text
        self._recent = [text, *(other for other in self._recent if other != text)][:MOST_RECENT]
        self._write()

    def prefer_window(self, preferred: bool) -> None:
        """Whether the dialog inside the window is used although the system has one."""
        if preferred != self.in_window:
            self.in_window = preferred
            self._write()

    def _write(self) -> None:
        path = state_dir() / FILE
        try:
            write_state(path, {"last": self._last, "recent": self._recent, "in_window": self.in_window})
        except OSError as error:
            _log.warning("%s cannot be written: %s", path, error)
