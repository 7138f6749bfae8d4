"""What panels may have the window do.  The window implements it (viewer.window.shell.actions); a panel knows no window."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from .recovery import Recoverable


class Actions(Protocol):
    """Called when a person acts on what a panel shows; never while nothing is pressed."""

    def do(self, name: str) -> None:
        """What a control does, by its name in the table of controls (viewer.window.interaction.controls)."""

    def open(self, paths: Sequence[Path]) -> None:
        """Opens scans or a project instead of what is open, once that is saved or given up."""

    def select_tool(self, name: str) -> None:
        """Selects a tool; the one that is selected: Fly."""

    def restore(self, found: Recoverable) -> None:
        """Opens the scans of unsaved work with it."""

    def ask_to_discard(self, found: Recoverable) -> None:
        """Removes unsaved work where the person confirms it."""
