"""Drives the window for ``test_window.py``, in a process of its own under Xvfb, and reports what each check found.

The checks are in checks_*.py, their hand in driver.py.  Run as ``python drive.py FOLDER [CHECK ...]``: pictures and
``report.json`` are left there.  A check that does not follow the one before it in the list begins in a fresh window;
``--alone`` runs all so, the last one first, which shows that none needs another.
"""

import json
import sys
import time
import traceback
from pathlib import Path

import checks_files
import checks_flight
import checks_navigation
import checks_outputs
import checks_panels
import checks_start
import checks_tools
import checks_window
import numpy as np
from driver import Driver, room

PARTS = (checks_start, checks_flight, checks_panels, checks_files, checks_window, checks_tools, checks_navigation,
         checks_outputs)
"""In this order; a check may begin where the one before left the window, but does not need to."""
SCANS = {checks_start: None, checks_tools: "room7", checks_navigation: "room7", checks_outputs: "room7"}
"""What a fresh window shows for the checks of a part; "room1" where none is named, None: the start page."""
CHECKS = {
    name.removeprefix("check_"): made for part in PARTS for name, made in vars(part).items() if name.startswith("check_")
}
BEGINS_WITH = {name.removeprefix("check_"): SCANS.get(part, "room1") for part in PARTS for name in vars(part)}
HEADLESS, SHOT = "screenshot_equals_headless_render", "screenshot_is_the_picture"


def check_headless(folder: Path) -> None:
    """The screenshot again, without a window, through EGL."""
    from pointglass.viewer.picture.background import composite
    from pointglass.viewer.picture.camera import from_fov
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.window.flight.start_viewpoint import FIELD_OF_VIEW

    shot = np.load(folder / "shot.npz")
    context = create_context()
    renderer = Renderer(context, room(seed=1))
    view = str(shot["view"])
    frame = renderer.render(from_fov(*shot["image"].shape[1::-1], FIELD_OF_VIEW, shot["matrix"]), Settings(view=view))
    assert np.array_equal(composite(frame.image(view)), shot["image"])
    renderer.release()


def main(folder: Path, *asked: str) -> None:
    """asked: names of checks, none: all; or ``--alone``."""
    report: dict[str, dict] = {}

    def attempt(name: str, work) -> None:
        start, problem = time.monotonic(), None
        try:
            work()
        except Exception:
            problem = traceback.format_exc()
        report[name] = {"problem": problem, "seconds": time.monotonic() - start}
        (folder / "report.json").write_text(json.dumps(report, indent=1))

    alone = asked == ("--alone",)
    wanted = set(CHECKS) | {HEADLESS} if alone or not asked else set(asked)
    if HEADLESS in wanted:
        wanted.add(SHOT)
    order = [name for name in CHECKS if name in wanted]
    follows = dict(zip(CHECKS, [None, *CHECKS]))  # name -> the check before it
    driver, last = Driver(folder, on_screen=True), None
    for name in reversed(order) if alone else order:
        if alone or follows[name] != last:
            driver.fresh(BEGINS_WITH[name])
        attempt(name, lambda check=CHECKS[name]: check(driver))
        last = name if report[name]["problem"] is None else ""  # after a failure the next one begins in a fresh window
        driver.session.notices.message, driver.session.help, driver.session.interface = None, False, True
    driver.app.close()
    if HEADLESS in wanted:
        attempt(HEADLESS, lambda: check_headless(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
