"""Drives the window for ``test_window.py``, in a process of its own under Xvfb, and reports what each check found.

The checks are in checks_*.py, their hand in driver.py.  Run as ``python drive.py FOLDER``: pictures and
``report.json`` are left there.
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
"""In this order: each check begins where the one before left the window."""
CHECKS = {
    name.removeprefix("check_"): made for part in PARTS for name, made in vars(part).items() if name.startswith("check_")
}
HEADLESS = "screenshot_equals_headless_render"


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


def main(folder: Path) -> None:
    report: dict[str, dict] = {}

    def attempt(name: str, work) -> None:
        start, problem = time.monotonic(), None
        try:
            work()
        except Exception:
            problem = traceback.format_exc()
        report[name] = {"problem": problem, "seconds": time.monotonic() - start}
        (folder / "report.json").write_text(json.dumps(report, indent=1))

    driver = Driver(folder)
    for name, check in CHECKS.items():
        attempt(name, lambda check=check: check(driver))
        driver.session.notices.message, driver.session.help, driver.session.interface = None, False, True
    driver.app.close()
    attempt(HEADLESS, lambda: check_headless(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
