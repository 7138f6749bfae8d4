"""The switch of photographs in a real window, by X pointer events."""

import json

import pytest
from drive_photographs import CHECKS
from x_keyboard import needs_xdotool
from x_server import run_with_display

pytestmark = [pytest.mark.window, pytest.mark.timeout(400)]


@pytest.mark.parametrize("claim", CHECKS)
def test_photographs_in_the_window(tmp_path, claim):
    needs_xdotool()
    done = run_with_display("drive_photographs.py", tmp_path, seconds=300)
    assert done.returncode == 0, f"the window ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    problem = json.loads((tmp_path / "report.json").read_text())[claim]["problem"]
    assert problem is None, problem
