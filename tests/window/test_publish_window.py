"""A scan is published from the window with X key and pointer events; the folder is read as a browser would."""

import json

import pytest
from drive_publish import CHECKS
from x_keyboard import needs_xdotool
from x_server import run_with_display

pytestmark = [pytest.mark.window, pytest.mark.timeout(700)]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    needs_xdotool()
    folder = tmp_path_factory.mktemp("publications")
    done = run_with_display("drive_publish.py", folder, seconds=600)
    path = folder / "report.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    assert done.returncode == 0, f"the window ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    return found


@pytest.mark.parametrize("claim", CHECKS)
def test_publishing(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
