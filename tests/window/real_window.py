"""The window as a person starts it: in a process of its own, on an X server of its own, driven by X events."""

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from x_keyboard import needs_xdotool, request_close
from x_server import ROOT

LONGEST_S = 90.0
"""Seconds that anything may take beside other work."""
_QUIET = 8
"""Samples, a twentieth of a second apart, in which a program at rest does nothing; it wakes twice a second."""


def until(condition: Callable[[], Any], what: str, seconds: float = LONGEST_S) -> Any:
    """Waits for a condition; returns what it returned."""
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, f"waited too long for {what}"
        time.sleep(0.1)
    return found


class RealWindow:
    """One window.  process: of the program.  display: the X server's.  folder: its working folder."""

    def __init__(self, display: str, folder: Path, *arguments: object):
        self.folder = folder
        self.environment = os.environ | {
            "DISPLAY": display, "POINTGLASS_CACHE": str(folder / "cache"), "POINTGLASS_STATE": str(folder / "state"),
            "PYTHONPATH": str(ROOT),
        }  # fmt: skip
        self.environment.pop("WAYLAND_DISPLAY", None)
        self.log = (folder / "window.log").open("ab")
        command = [sys.executable, "-m", "pointglass.viewer", *map(str, arguments)]
        self.process = subprocess.Popen(command, env=self.environment, cwd=folder, stdout=self.log, stderr=self.log)
        search = ("search", "--all", "--pid", self.process.pid, "--name", "pointglass")
        self.window = str(until(lambda: self.xdo(*search, check=False), "the window")).splitlines()[-1]

    def xdo(self, *words: object, check: bool = True) -> str:
        done = subprocess.run(["xdotool", *map(str, words)], env=self.environment, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0 or not check, done.stderr
        return done.stdout.strip()

    @property
    def title(self) -> str:
        return self.xdo("getwindowname", self.window)

    def wait_for_title(self, part: str) -> None:
        until(lambda: part in self.title, f"a title with {part!r}, it is {self.title!r}")

    def keys(self, *names: str) -> None:
        """Presses keys one after the other, in this window."""
        self.xdo("windowfocus", "--sync", self.window)
        for name in names:
            self.xdo("key", name)

    def click(self, x: int, y: int) -> None:
        """Moves there in steps, as a hand does, and clicks.  A move is lost now and then, once in some thirty runs: X has the
        pointer at its end, the window has not heard of it.  Where that happens is not known."""
        for back in (40, 10, 3, 0):
            self.xdo("mousemove", "--sync", "--window", self.window, x - back, y)
        self._at_rest(3.0)  # the picture at rest is read where the pointer is; a job may go on
        self.xdo("click", 1)

    def rest(self) -> None:
        """Waits until the program has answered all events and waits for the next.  However busy the machine is, it has drawn
        what there was to draw then."""
        assert self._at_rest(LONGEST_S), "the program is never at rest"

    def _at_rest(self, seconds: float) -> bool:
        """Whether within this time none of its threads runs or waits for a processor, in some samples one after the other."""
        end, quiet = time.monotonic() + seconds, 0
        while quiet < _QUIET and time.monotonic() < end:
            time.sleep(0.05)
            quiet = 0 if self._runs else quiet + 1
        return quiet == _QUIET

    @property
    def _runs(self) -> bool:
        """Whether a thread runs or could."""
        for stat in Path(f"/proc/{self.process.pid}/task").glob("*/stat"):
            with contextlib.suppress(OSError):  # a thread that ended
                if stat.read_text().rpartition(") ")[2][0] in "RD":
                    return True
        return False

    def close(self) -> None:
        """As the window manager's button does."""
        request_close(self.environment["DISPLAY"], int(self.window))

    def ended(self) -> int:
        """Waits for the end of the process.  Returns its exit code."""
        return self.process.wait(LONGEST_S)

    def picture(self, name: str) -> None:
        """Saves the screen as NAME.png in the folder."""
        from PIL import ImageGrab

        ImageGrab.grab(xdisplay=self.environment["DISPLAY"]).save(self.folder / f"{name}.png")


@contextlib.contextmanager
def x_display() -> Iterator[str]:
    """An X server.  Skips the test where Xvfb or xdotool is not installed."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (apt install xvfb)")
    needs_xdotool()
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"],
                              pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            yield f":{pipe.readline().strip()}"
    finally:
        server.terminate()
        server.wait()
