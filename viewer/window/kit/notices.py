"""Messages: a dialog that stays until it is closed, toasts that disappear by themselves, and notices about the scan.

No window: ``dialogs``, ``hud`` and ``outliner`` draw what is here.  Times are seconds on the session's clock.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, auto
from pathlib import Path

from ...common.errors import Option, PointglassError
from ...common.text import printable
from ...readers.remote.local_copies import name_by_address

Problem = str | Exception
"""What went wrong: a sentence, or an error, which is put into the window's words when it is shown."""
TOAST_SECONDS = 4.0
NOTE_SECONDS = 10.0
MOST_SAVED = 5
"""Saved files that are listed; they are also in the folder of the last."""
_OPTIONS = {"--size": "window", "--view": "view", "--filter": "filter", "--quality": "quality", "--precision": "precision",
            "--device": "device", "--out": "place", "--resume": "the same folder"}  # fmt: skip
"""Of the command line's options, those that a person finds in the window: option -> what it is called there."""


def _window_option(option: Option) -> str:
    return str(Option(_OPTIONS.get(option.name, option.name), option.choice))


def in_window(problem: Problem) -> str:
    """What went wrong and what to do, in the words of the window rather than of the command line."""
    if not isinstance(problem, PointglassError):
        return str(problem)
    name_by_address(problem)
    return printable(problem.words(_window_option))


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


class ToastSubject(Enum):
    """What a toast is about, where a later one replaces it or an event makes it obsolete."""

    NOTHING_OPEN = auto()
    SPEED = auto()
    FLOOR = auto()
    RECORDING = auto()
    HIDDEN_INTERFACE = auto()
    PROJECTION = auto()


@dataclass(frozen=True)
class Toast:
    """A line that goes by itself.  until: on the session's clock.  of_scene: it is about the scene shown, and goes with it.
    subject: of toasts with the same one only the latest is shown."""

    text: str
    until: float
    of_scene: bool = False
    subject: ToastSubject | None = None


@dataclass(frozen=True)
class KeepAsScanned:
    """Opens the scan again with the colours of the file."""

    label = "Keep colours as scanned"


@dataclass(frozen=True)
class LoadAllPoints:
    """Loads the complete scan of a preview."""

    label = "Load all points"


@dataclass(frozen=True)
class Brighten:
    """Sets an exposure that suits a dark scan."""

    label = "Brighten"


@dataclass(frozen=True)
class OpenProject:
    """Opens the project saved beside the scan.  file: of the project."""

    file: Path
    label = "Open it"


@dataclass(frozen=True)
class CallUp:
    """Makes another axis point up.  axis: a key of viewer.picture.edits.UP_AXES."""

    axis: str

    @property
    def label(self) -> str:
        """See Offer."""
        return f"Call {self.axis} up"


Offer = KeepAsScanned | LoadAllPoints | Brighten | OpenProject | CallUp
"""What can be done about a notice; ``label``: its button.  viewer.window.session.scan_notice_actions does it."""


@dataclass(frozen=True)
class ScanNotice:
    """Something to know about the scan shown; it stays in the outliner.  offer: what can be done about it."""

    text: str
    offer: Offer | None = None


class Notices:
    """message: the dialog that is open, else None.  toasts: three at most, the latest last.  of_scan: about the scan shown.
    saved: files that were saved from this window, the latest last."""

    def __init__(self, clock: Callable[[], float]):
        self._clock = clock
        self.message: Message | None = None
        self._answered: Callable[[], object] | None = None
        self._said: set[str] = set()
        self.toasts: list[Toast] = []
        self.of_scan: list[ScanNotice] = []
        self.saved: list[Path] = []

    def tell_of_scan(self, found: "list[ScanNotice]") -> None:
        """What is to be known of the scan that is shown now; the first two also as toasts, which stay longer than others."""
        self.of_scan = found
        for notice in found[:2]:
            self.toast(notice.text, seconds=NOTE_SECONDS, of_scene=True)

    def say(self, title: str, *problems: Problem) -> None:
        """Opens a dialog with one or several problems."""
        self.message = Message(title, "\n\n".join(map(in_window, problems)))

    def say_once(self, title: str, problem: Problem) -> None:
        """As :meth:`say`, once while a scan is shown: what nobody asked for may fail again and again."""
        if (text := in_window(problem)) not in self._said:
            self._said.add(text)
            self.say(title, problem)

    def say_also(self, title: str, *problems: Problem) -> None:
        """As :meth:`say`; where a message is open, below its text, so that none is lost."""
        opened = self.message
        self.say(title, *problems)
        if opened is not None and self.message is not None:
            self.message = replace(opened, text=f"{opened.text}\n\n{title}.\n{self.message.text}")

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
        self, text: str, *, seconds: float = TOAST_SECONDS, subject: ToastSubject | None = None, of_scene: bool = False
    ) -> None:
        """Shows a line for a moment.  subject, of_scene: as in Toast."""
        if subject is not None:
            self.drop(subject)
        self.toasts = [*self.toasts[-2:], Toast(text, self._clock() + seconds, of_scene, subject)]

    def tell_saved(self, path: Path, text: str = "") -> None:
        """Says that a file was saved, and keeps it in the list of jobs.  text: what is said, where "Saved PATH" is not all."""
        self.list_saved(path)
        self.toast(text or f"Saved {path}")

    def list_saved(self, path: Path) -> None:
        """Keeps a saved file in the list of jobs."""
        self.forget_saved(path)
        self.saved = [*self.saved[1 - MOST_SAVED :], path]

    def forget_saved(self, path: Path) -> None:
        """Takes a file off the list."""
        self.saved = [other for other in self.saved if other != path]

    def drop(self, subject: ToastSubject) -> None:
        """Forgets the toast about ``subject``."""
        self.toasts = [toast for toast in self.toasts if toast.subject is not subject]

    def leave_scene(self) -> None:
        """Forgets what was said about the scene that is no longer shown."""
        self.toasts = [toast for toast in self.toasts if not toast.of_scene]
        self.of_scan = []
        self._said.clear()

    def expire(self) -> bool:
        """Forgets the toasts whose time is over.  Returns whether there were any."""
        now, before = self._clock(), len(self.toasts)
        self.toasts = [toast for toast in self.toasts if toast.until > now]
        return len(self.toasts) != before
