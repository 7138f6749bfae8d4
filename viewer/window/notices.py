"""Messages: a dialog that stays until it is closed, toasts that disappear by themselves, and notices about the scan.

No window: ``dialogs``, ``hud`` and ``scenes_panel`` draw what is here.  Times are seconds on the session's clock.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

TOAST_SECONDS = 4.0
_OPTIONS = {"size": "window", "view": "view", "filter": "filter", "quality": "quality", "precision": "precision",
            "device": "device"}  # fmt: skip
"""Of the command line's options, those that a person finds in the window: option -> what it is called there."""


def in_window(text: str) -> str:
    """What went wrong and what to do, in the words of the window rather than of the command line."""
    return re.sub(rf"(?<!\S)--({'|'.join(_OPTIONS)})(?![\w-])", lambda found: _OPTIONS[found[1]], text)


@dataclass(frozen=True)
class Message:
    """A dialog: something a person has to read."""

    title: str
    text: str


@dataclass(frozen=True)
class Toast:
    """A line that goes by itself.  until: on the session's clock.  of_scene: it is about the scene shown, and goes with it."""

    text: str
    until: float
    of_scene: bool = False


@dataclass(frozen=True)
class ScanNotice:
    """Something to know about the scan shown; it stays in the scene list.  action: what can be done about it, a key that
    the session knows, "" for nothing; label: its button."""

    text: str
    action: str = ""
    label: str = ""


class Notices:
    """message: the dialog that is open, else None.  toasts: three at most, the latest last.  of_scan: about the scan shown."""

    def __init__(self, clock: Callable[[], float]):
        self._clock = clock
        self.message: Message | None = None
        self.toasts: list[Toast] = []
        self.of_scan: list[ScanNotice] = []

    def say(self, title: str, text: str) -> None:
        """Opens a dialog.  text: as for the command line."""
        self.message = Message(title, in_window(text))

    def toast(
        self, text: str, *, seconds: float = TOAST_SECONDS, instead_of: str | None = None, of_scene: bool = False
    ) -> None:
        """Shows a line for a moment.  instead_of: toasts that begin so go at once.  of_scene: as in Toast."""
        kept = [toast for toast in self.toasts if instead_of is None or not toast.text.startswith(instead_of)]
        self.toasts = [*kept[-2:], Toast(text, self._clock() + seconds, of_scene)]

    def drop(self, text: str) -> None:
        """Forgets the toasts that say ``text``."""
        self.toasts = [toast for toast in self.toasts if toast.text != text]

    def leave_scene(self) -> None:
        """Forgets what was said about the scene that is no longer shown."""
        self.toasts = [toast for toast in self.toasts if not toast.of_scene]
        self.of_scan = []

    def expire(self) -> bool:
        """Forgets the toasts whose time is over.  Returns whether there were any."""
        now, before = self._clock(), len(self.toasts)
        self.toasts = [toast for toast in self.toasts if toast.until > now]
        return len(self.toasts) != before
