"""An open list takes the arrow keys, Enter and Esc; closed, the keys are the tools' again.  By X events in a real window."""

import time

import pytest
from real_window import until, x_display
from test_work_is_kept import all_points, autosaves, opened, scan  # noqa: F401  (a fixture)

from pointglass.viewer.window.session.autosave import read_unsaved

pytestmark = [pytest.mark.window, pytest.mark.timeout(600)]
KINDS = 1170, 56
"""Of the list of kinds of measurement, at a window of 1280 x 720."""


@pytest.fixture(scope="module")
def display():
    with x_display() as found:
        yield found


def kinds(of) -> list[str]:
    """Of the measurements in the autosaves."""
    return [made.kind for file in autosaves(of) if (found := read_unsaved(file)) for made in found.document.measurements]


def test_arrows_and_enter_choose_and_escape_leaves_the_choice_as_it_is(display, scan):  # noqa: F811
    window = opened(display, scan)
    all_points(scan)
    window.keys("t")
    for keys in (("Down", "Down", "Return"), ("Down", "Escape")):
        window.click(*KINDS)
        time.sleep(1.0)
        for key in keys:
            window.xdo("key", key)
            time.sleep(0.4)
    for number, (first, second) in enumerate([((480, 400), (720, 300)), ((500, 300), (700, 420))], 1):
        window.click(*first)
        window.click(*second)
        until(lambda number=number: len(kinds(scan)) == number, "the measurement")
    assert kinds(scan) == ["height", "height"], "the third of the list; Esc left it chosen, and the tool selected"
    window.process.kill()
