"""The window of an installed wheel: quality levels, and the small network in flight, as in a checkout."""

import json
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageGrab
from product import ROOT
from x_server import x_display

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]


def environment(installed, display: str, folder: Path) -> dict[str, str]:
    made = installed.environment | {"DISPLAY": display, "POINTGLASS_STATE": str(folder / "state")}
    made.pop("WAYLAND_DISPLAY", None)
    return made


def test_the_window_has_every_quality_and_flies_with_the_small_network(installed, tmp_path):
    for script in (Path(__file__).with_name("window_script.py"), ROOT / "tests" / "window" / "driver.py"):
        shutil.copy(script, installed.work)
    with x_display() as display:
        done = subprocess.run([installed.python, "window_script.py", tmp_path], env=environment(installed, display, tmp_path),
                              cwd=installed.work, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["points"] == 1_350_000 and report["message"] is None
    assert set(report["missing"]) == {"paper"}  # a checkout ships no weights of it either
    assert report["networks"] == ["balanced", "fast"]
    assert all(1 < change < 40 for change in report["neural"].values()), report["neural"]  # levels from the filled view
    assert report["at_rest"] == [["neural"], "balanced"]
    assert Path(report["package"]).parents[1] == installed.site and report["own"] == []
    assert Image.open(tmp_path / "flight.png").size == (640, 400)


def test_the_command_opens_the_demo_in_a_window(installed, tmp_path):
    """Waits until the scan is on the screen, and stops the window as a session manager does."""
    with x_display() as display:
        process = subprocess.Popen([installed.command, "demo"], cwd=installed.work, text=True, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, env=environment(installed, display, tmp_path))
        try:
            end, colours, shown = time.monotonic() + 120, 0, np.zeros((1, 1, 3), np.uint8)
            while colours < 2_000:  # of the start of the window there are a few dozen
                assert process.poll() is None and time.monotonic() < end, process.communicate() if process.poll() else colours
                time.sleep(0.5)
                shown = np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))
                colours = len(np.unique(shown @ np.array([1 << 16, 1 << 8, 1])))
            Image.fromarray(shown).save(tmp_path / "demo.png")
        finally:
            process.send_signal(signal.SIGTERM)
            _, said = process.communicate(timeout=60)
    assert process.returncode == 130 and said == "pointglass: stopped\n"
