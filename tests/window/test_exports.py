"""Points are exported from the window with X key and pointer events, and read with laspy."""

import pytest
from drive_exports import CHECKS
from x_server import report_of

pytestmark = [pytest.mark.window, pytest.mark.timeout(700)]  # a minute, more beside other work


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return report_of("drive_exports.py", tmp_path_factory.mktemp("exports"))


@pytest.mark.parametrize("claim", CHECKS)
def test_exports(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
