"""The window under Xvfb: every control pressed, every picture compared with ``render``'s; drive.py runs the checks."""

import json

import pytest
from drive import CHECKS, HEADLESS
from x_server import run_with_display

pytestmark = [pytest.mark.window, pytest.mark.timeout(1300)]  # minutes, more beside other work


@pytest.fixture(scope="module")
def report(request, tmp_path_factory):
    """What one driven session found that ran the selected checks, each of which may be selected by itself."""
    names = [item.callspec.params["claim"] for item in request.session.items if item.originalname == "test_window"]
    folder = tmp_path_factory.mktemp("window")
    done = run_with_display("drive.py", folder, *names, seconds=1200)
    path = folder / "report.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    assert done.returncode == 0, f"the window ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    return found


@pytest.mark.parametrize("claim", [*CHECKS, HEADLESS])
def test_window(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
