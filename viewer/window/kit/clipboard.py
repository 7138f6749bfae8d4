"""Text that is copied and pasted: kept in memory, or in the system's clipboard, through GLFW."""

from typing import Any


class Clipboard:
    """Kept in memory."""

    def __init__(self) -> None:
        self._text = ""

    def read(self) -> str:
        return self._text

    def write(self, text: str) -> None:
        self._text = text


class SystemClipboard(Clipboard):
    """glfw: the module.  window: its handle."""

    def __init__(self, glfw: Any, window: Any):
        super().__init__()
        self._glfw, self._window = glfw, window

    def read(self) -> str:
        """The text; "" where the clipboard holds something else."""
        found = self._glfw.get_clipboard_string(self._window)
        return found.decode("utf-8", "replace") if found else ""

    def write(self, text: str) -> None:
        self._glfw.set_clipboard_string(self._window, text)
