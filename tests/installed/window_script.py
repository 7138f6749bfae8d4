"""Drives the window of an installed product, in the person's folder: demo scan, each quality that is shipped, a flight.

Copied to that folder beside driver.py.  ``python window_script.py FOLDER`` leaves pictures and report.json in FOLDER.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from driver import Driver


def main(folder: Path) -> None:
    import pointglass
    from pointglass.viewer.window.planning.networks import missing_qualities

    driver = Driver(folder, on_screen=True)
    session: Any = driver.session
    driver.drop(pointglass.demo_scan())
    driver.until(lambda: session.loads.current is None and session.scene is not None, 90)
    driver.rest()
    report: dict = {"points": session.scene.count, "missing": missing_qualities(session.view_settings.settings)}
    filled = driver.bare()
    pictures = {}
    for quality in ("fast", "balanced"):
        choose(driver, view="neural", quality=quality)
        driver.picture(quality)
        pictures[quality] = driver.bare()
    report["neural"] = {name: float(np.abs(picture.astype(int) - filled).mean()) for name, picture in pictures.items()}
    report["networks"] = session.view_settings.networks

    drawn = set()
    session.picture.adaptive_lod.target_ms = 1e6  # this machine is slow: the fast network is fast enough, the balanced is not
    session.picture.adaptive_lod.ran_network("balanced", 1e9)
    driver.key("W", "down")

    def small_network() -> bool:
        drawn.add(session.screen.smaller_network if session.picture.made.moving else None)
        return "fast" in drawn

    driver.until(small_network, 60)
    driver.picture("flight", settle=1)
    driver.key("W", "up")
    driver.until(lambda: not session.flight.moving)
    driver.rest()
    report["at_rest"] = [list(session.screen.drawn), session.picture.made.network]
    report["message"] = session.notices.message and session.notices.message.text
    report["package"] = pointglass.__file__
    report["own"] = sorted({"model", "viewer", "shaders", "assets"} & set(sys.modules))
    driver.app.close()
    (folder / "report.json").write_text(json.dumps(report))


def choose(driver: Driver, **settings) -> None:
    """Requests settings as the panel does, and waits for the picture."""
    from dataclasses import replace

    chosen = driver.session.view_settings
    chosen.request(replace(chosen.shown_settings, **settings))
    driver.until(lambda: chosen.wanted is None and chosen.network_load is None, 90)
    driver.rest()
    assert chosen.settings.quality == settings["quality"] and driver.session.screen.drawn == ("neural",)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
