"""Runs a script of this folder in a process of its own, with an X server of its own on whatever display is free."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from x_keyboard import needs_xdotool

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def x_display() -> Iterator[str]:
    """The name of a display of an X server that runs during the block.  Skips the test where Xvfb is not installed."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (apt install xvfb)")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            display = pipe.readline().strip()
        assert display, "Xvfb did not start"
        yield f":{display}"
    finally:
        server.terminate()
        server.wait()


def run_with_display(script: str, folder: Path, *arguments: str, seconds: float) -> subprocess.CompletedProcess:
    """What ``python SCRIPT FOLDER ARGUMENTS`` did.  Skips the test where Xvfb is not installed."""
    with x_display() as display:
        environment = os.environ | {
            "DISPLAY": display, "POINTGLASS_CACHE": str(folder / "cache"),
            "POINTGLASS_STATE": str(folder / "state"),
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }  # fmt: skip
        environment.pop("WAYLAND_DISPLAY", None)
        drive = [sys.executable, str(Path(__file__).with_name(script)), str(folder), *arguments]
        return subprocess.run(drive, env=environment, capture_output=True, text=True, timeout=seconds)


def report_of(script: str, folder: Path, *, seconds: float = 600) -> dict[str, dict]:
    """What one driven window found: check -> its problem, None, and its seconds.  Fails where the window did not end well."""
    needs_xdotool()
    done = run_with_display(script, folder, seconds=seconds)
    path = folder / "report.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    assert done.returncode == 0, f"the window ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    return found
