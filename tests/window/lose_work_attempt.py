"""An attempt to lose work (lose_work.py): one window after the other on one scan, driven by X events, and what must be true."""

import random
import shutil
import time
from pathlib import Path

from real_window import RealWindow
from test_work_is_kept import dimmed

from pointglass.viewer.window.session.autosave import read_unsaved
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.measuring.measurement import Measurement
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.project import read_project


class LostError(Exception):
    """Work is lost, a file of somebody else replaced, or the title wrong."""


class OddError(Exception):
    """The attempt cannot go on."""


Piece = Measurement | Annotation


def alike(some: list[Piece], others: list[Piece]) -> bool:
    """Whether these are the same pieces of work, in whatever order."""
    return sorted(map(repr, some)) == sorted(map(repr, others))


def pieces(document: Document) -> list[Piece]:
    return [*document.measurements, *document.annotations]


class Attempt:
    """One window after the other on one scan.  expected: the measurements and notes that there are now, as they were made.
    project: the file that Ctrl+S writes.  done: what was done, in words."""

    def __init__(self, display: str, folder: Path, master: Path, chance: random.Random):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(master, folder)
        self.display, self.folder, self.chance = display, folder, chance
        self.scan = folder / "scans" / "room.xyz"
        self.project = self.scan.with_name("room.pointglass")
        self.expected: list[Piece] = []
        self.done: list[str] = []
        self.window: RealWindow

    def open(self, *arguments: object) -> None:
        self.window = RealWindow(self.display, self.folder, *(arguments or ("view", self.scan)), "--view", "filled")
        self.window.wait_for_title("·")
        time.sleep(2.5)

    def autosaved(self):
        """The newest autosave, None where there is none."""
        files = sorted((self.folder / "state" / "autosave").glob("[!.]*.json"), key=lambda file: file.stat().st_mtime)
        return next((found for file in reversed(files) if (found := read_unsaved(file)) is not None), None)

    @property
    def saved(self) -> list[Piece]:
        return pieces(read_project(self.project)) if self.project.exists() else []

    @property
    def state(self) -> list[Piece]:
        """What is autosaved, else saved."""
        found = self.autosaved()
        return pieces(found.document) if found is not None else self.saved

    @property
    def changed(self) -> bool:
        return not alike(self.expected, self.saved)

    @property
    def alive(self) -> bool:
        return self.window.process.poll() is None

    def waits(self, condition, seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not (found := bool(condition())) and time.monotonic() < end:
            time.sleep(0.2)
        return found

    def measure(self) -> None:
        """One more distance; its points are read from the file, which may take a moment."""
        self.window.keys("i", "t")  # from whatever tool
        before = len(self.expected)
        for _ in range(3):
            for columns in ((420, 620), (640, 780)):
                self.window.click(self.chance.randint(*columns), self.chance.randint(250, 470))
            if self.waits(lambda: len(self.state) == before + 1 and getattr(self.autosaved(), "begun", None) is None, 8.0):
                time.sleep(1.5)
                self.gained()
                self.done.append(f"measured {before + 1}")
                return
            self.window.keys("BackSpace", "BackSpace")  # a click was lost: real_window.click
        raise OddError("three measurements in a row were not made")

    def gained(self) -> None:
        """What there is now and was not there before is expected from now on."""
        known = set(map(repr, self.expected))
        self.expected = [*self.expected, *(piece for piece in self.state if repr(piece) not in known)]
        if not alike(self.expected, self.state):
            raise LostError(f"{len(self.state)} pieces of work where {len(self.expected)} are expected")

    def note(self, text: str) -> None:
        """One more note, with this text."""
        self.window.keys("i", "l")
        before = len(self.expected)
        for _ in range(3):
            self.window.click(self.chance.randint(420, 780), self.chance.randint(250, 470))
            if self.waits(lambda: len(self.state) == before + 1, 8.0):
                break
        else:
            raise OddError("three notes in a row were not made")
        time.sleep(1.0)
        self.window.xdo("type", "--delay", "15", text)
        if not self.waits(lambda: text in [getattr(piece, "text", None) for piece in self.state], 8.0):
            raise LostError(f"the text of the note is not {text!r}")
        self.window.keys("Escape")
        time.sleep(1.5)
        self.gained()
        self.done.append(f"noted {before + 1}")

    def settles(self) -> None:
        """Within five seconds the autosave has what there is."""
        if not self.waits(lambda: alike(self.state, self.expected), 6.0):
            raise LostError(f"5 s after the change there are {len(self.state)} of {len(self.expected)} measurements and notes")

    def marked(self, changed: bool) -> None:
        """Whether the title shows changes."""
        if not self.waits(lambda: ("•" in self.window.title) == changed, 8.0):
            raise LostError(f"title {self.window.title!r}, changes: {changed}")

    def save(self, *events: object) -> None:
        """By Ctrl+S, or by the given words of xdotool."""
        self.window.xdo("windowfocus", "--sync", self.window.window)
        self.window.xdo(*(events or ("key", "ctrl+s")))
        self.done.append("ctrl+s")
        if not self.waits(lambda: alike(self.saved, self.expected) and "•" not in self.window.title, 15.0):
            raise LostError(f"not saved: {self.window.title!r}, {len(self.saved)} of {len(self.expected)}")

    def asked(self, there: bool = True) -> None:
        """Waits for a question, or its end."""
        if not self.waits(lambda: not self.alive or dimmed(self.window) == there, 12.0):
            raise OddError(f"a question is there: {not there}")
        if not self.alive:
            raise LostError("the window has ended")

    def ended(self) -> None:
        if not self.waits(lambda: not self.alive, 40.0):
            raise LostError("the window does not end")

    def all_saved(self) -> None:
        if not alike(self.saved, self.expected):
            raise LostError(f"the project has {len(self.saved)} of {len(self.expected)} measurements and notes")

    def restored(self) -> None:
        """The next start offers what was not saved; accepted and saved, all of it is there."""
        if not self.changed:
            return
        self.open()
        self.asked()
        self.window.keys("Return")
        self.asked(there=False)
        self.marked(changed=True)
        self.save()
        self.window.keys("ctrl+q")
        self.ended()
        self.done.append("restored, saved")
