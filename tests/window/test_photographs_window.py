"""The switch of photographs in a real window, by X pointer events."""

import pytest
from drive_photographs import CHECKS
from x_server import report_of, run_with_display

pytestmark = [pytest.mark.window, pytest.mark.timeout(1100)]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return report_of("drive_photographs.py", tmp_path_factory.mktemp("photographs"), seconds=1000)


@pytest.mark.parametrize("claim", CHECKS)
def test_photographs_in_the_window(report, claim):
    problem = report[claim]["problem"]
    assert problem is None, problem


def test_a_folder_of_photographs_named_on_the_command_line_colours_the_window(tmp_path):
    done = run_with_display("drive_photo_folder.py", tmp_path, seconds=600)
    assert done.returncode == 0, done.stderr
    assert "nowhere" in done.stderr
