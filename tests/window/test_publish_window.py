"""A scan is published from the window with X key and pointer events; the folder is read as a browser would."""

import pytest
from drive_publish import CHECKS
from x_server import report_of

pytestmark = [pytest.mark.window, pytest.mark.timeout(700)]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return report_of("drive_publish.py", tmp_path_factory.mktemp("publications"))


@pytest.mark.parametrize("claim", CHECKS)
def test_publishing(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem
