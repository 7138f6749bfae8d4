"""The window under Xvfb: every control pressed, every picture compared with ``render``'s; drive.py runs the checks."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from drive import CHECKS, HEADLESS

pytestmark = pytest.mark.window
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """What one driven session found.  Its own X server, on whatever display is free."""
    if not shutil.which("Xvfb"):
        pytest.skip("Xvfb is not installed (apt install xvfb)")
    folder = tmp_path_factory.mktemp("window")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            display = pipe.readline().strip()
        assert display, "Xvfb did not start"
        environment = os.environ | {
            "DISPLAY": f":{display}", "POINTGLASS_CACHE": str(folder / "cache"),
            "POINTGLASS_STATE": str(folder / "state"),
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }  # fmt: skip
        environment.pop("WAYLAND_DISPLAY", None)
        drive = [sys.executable, str(Path(__file__).with_name("drive.py")), str(folder)]
        done = subprocess.run(drive, env=environment, capture_output=True, text=True, timeout=400)
        path = folder / "report.json"
        found = json.loads(path.read_text()) if path.exists() else {}
        assert done.returncode == 0, f"the window ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
        return found
    finally:
        server.terminate()
        server.wait()


@pytest.mark.parametrize("claim", [*CHECKS, HEADLESS])
def test_window(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
