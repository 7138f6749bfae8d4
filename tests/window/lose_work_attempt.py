"""An attempt to lose work (lose_work.py): one window after the other on one scan, driven by X events, and what must be true."""

import random
import shutil
import time
from pathlib import Path

from real_window import RealWindow
from test_work_is_kept import dimmed

from pointglass.viewer.window.session.autosave import read_unsaved
from pointglass.viewer.work.measuring.measurement import Measurement
from pointglass.viewer.work.project import read_project


class LostError(Exception):
    """Work is lost, a file of somebody else replaced, or the title wrong."""


class OddError(Exception):
    """The attempt cannot go on."""


class Attempt:
    """One window after the other on one scan.  expected: the measurements that there are now.  project: the file that Ctrl+S
    writes.  done: what was done, in words."""

    def __init__(self, display: str, folder: Path, master: Path, chance: random.Random):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(master, folder)
        self.display, self.folder, self.chance = display, folder, chance
        self.scan = folder / "scans" / "room.xyz"
        self.project = self.scan.with_name("room.pointglass")
        self.expected: list[Measurement] = []
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
    def saved(self) -> list[Measurement]:
        return list(read_project(self.project).measurements) if self.project.exists() else []

    @property
    def state(self) -> list[Measurement]:
        """What is autosaved, else saved."""
        found = self.autosaved()
        return list(found.document.measurements) if found is not None else self.saved

    @property
    def changed(self) -> bool:
        return self.expected != self.saved

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
                self.expected = self.state
                self.done.append(f"measured {before + 1}")
                return
            self.window.keys("BackSpace", "BackSpace")  # a click was lost: real_window.click
        raise OddError("three measurements in a row were not made")

    def settles(self) -> None:
        """Within five seconds the autosave has what there is."""
        if not self.waits(lambda: self.state == self.expected, 6.0):
            raise LostError(f"5 s after the change there are {len(self.state)} of {len(self.expected)} measurements")

    def marked(self, changed: bool) -> None:
        """Whether the title shows changes."""
        if not self.waits(lambda: ("•" in self.window.title) == changed, 8.0):
            raise LostError(f"title {self.window.title!r}, changes: {changed}")

    def save(self) -> None:
        self.window.keys("ctrl+s")
        self.done.append("ctrl+s")
        if not self.waits(lambda: self.saved == self.expected and "•" not in self.window.title, 15.0):
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
        if self.saved != self.expected:
            raise LostError(f"the project has {len(self.saved)} of {len(self.expected)} measurements")

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
