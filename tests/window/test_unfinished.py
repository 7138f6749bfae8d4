"""What is not finished is left after a question only, and Esc closes what lies above it, with X key and pointer events."""

import pytest
from drive_unfinished import CHECKS
from x_server import report_of

pytestmark = [pytest.mark.window, pytest.mark.timeout(700)]  # a minute, more beside other work


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return report_of("drive_unfinished.py", tmp_path_factory.mktemp("unfinished"))


@pytest.mark.parametrize("claim", CHECKS)
def test_unfinished(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
