"""Files chosen in the window with X key and pointer events: open, save, replace, locate, photographs, several files."""

import pytest
from drive_dialogs import CHECKS
from x_server import report_of

pytestmark = [pytest.mark.window, pytest.mark.timeout(700)]  # a minute, more beside other work


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return report_of("drive_dialogs.py", tmp_path_factory.mktemp("dialogs"))


@pytest.mark.parametrize("claim", CHECKS)
def test_dialogs(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
