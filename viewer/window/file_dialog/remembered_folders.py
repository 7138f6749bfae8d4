"""Folders that file dialogs begin in, remembered from one start to the next: ``folders.json`` in the user's state folder.

``{"last": {PURPOSE: FOLDER}, "recent": [FOLDER, ...], "in_window": BOOL}``.  It is written when a file is chosen,
so that a crash forgets nothing.  A file that cannot be read counts as empty.
"""

import json
import logging
from pathlib import Path

from ....model.common.atomic_write import write_atomic
from ..recent import state_dir

FILE = "folders.json"
MOST_RECENT = 8
"""Folders listed as recent places."""
_LARGEST = 1 << 20
"""Bytes of ``folders.json`` that are read."""
_log = logging.getLogger(__name__)


class RememberedFolders:
    """The folder of each purpose, the recent folders, and whether the dialog inside the window is preferred to the system's."""

    def __init__(self) -> None:
        self._last: dict[str, str] = {}
        self._recent: list[str] = []
        self.in_window = False
        self._read()

    def _read(self) -> None:
        path = state_dir() / FILE
        try:
            if path.stat().st_size > _LARGEST:
                raise ValueError("too large")
            found = json.loads(path.read_text("utf-8"))
            last, recent = found.get("last", {}), found.get("recent", [])
            self._last = {name: folder for name, folder in last.items() if isinstance(folder, str)}
            self._recent = [folder for folder in recent if isinstance(folder, str)][:MOST_RECENT]
            self.in_window = found.get("in_window") is True
        except FileNotFoundError:
            return
        except (OSError, ValueError, AttributeError, TypeError, RecursionError) as error:
            _log.warning("%s is not used: %s", path, error)

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
        text = json.dumps({"last": self._last, "recent": self._recent, "in_window": self.in_window}, indent=1) + "\n"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(path, lambda beside: beside.write_text(text, "utf-8"))
        except OSError as error:
            _log.warning("%s cannot be written: %s", path, error)
