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
class Answer:
    """A button of a question.  do: called in a later turn of the loop; None: nothing is done, as by Esc."""

    label: str
    do: Callable[[], object] | None = None


@dataclass(frozen=True)
class Message:
    """A dialog: something a person has to read, or to answer.  answers: its buttons, the one for Enter first."""

    title: str
    text: str
    answers: tuple[Answer, ...] = (Answer("OK"),)


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
        self._answered: Callable[[], object] | None = None
        self.toasts: list[Toast] = []
        self.of_scan: list[ScanNotice] = []

    def say(self, title: str, text: str) -> None:
        """Opens a dialog.  text: as for the command line."""
        self.message = Message(title, in_window(text))

    def ask(self, title: str, text: str, answers: tuple[Answer, ...]) -> None:
        """Opens a dialog with several buttons.  Esc closes it without an answer."""
        self.message = Message(title, text, answers)

    def answer(self, number: int = 0) -> None:
        """Presses a button of the dialog, which closes."""
        if self.message is not None:
            self._answered, self.message = self.message.answers[number].do, None

    @property
    def answered(self) -> bool:
        """Whether an answer waits for take_answer."""
        return self._answered is not None

    def take_answer(self) -> None:
        """Does what was answered since the last call."""
        do, self._answered = self._answered, None
        if do is not None:
            do()

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
