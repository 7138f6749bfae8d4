"""A person aligns one scan to another, by X key and pointer events, for ``drive_exports.py``: three pairs, ICP, undo."""

import sys
from pathlib import Path

import numpy as np
from checks_written_files import tool_of
from drive_dialogs import Person
from x_keyboard import xdo

from pointglass.viewer.common.rigid_transform import inverse, moved_points, rigid, rotation_about
from pointglass.viewer.window.flight.navigation import view_along
from pointglass.viewer.window.kit import icons
from pointglass.viewer.work.registration.moved_files import transforms_of

sys.path.append(str(Path(__file__).resolve().parents[1] / "unit"))

from cloud_files import write_ply
from swept_room import PLACES, sweep

MARKS = np.array([[3.0, 1.2, 0.9], [0.2, 2.5, 0.9], [-3.0, -1.0, 0.2]])
"""On three walls, seen from both places."""


def _compare_takes_what_align_states(p: Person) -> None:
    """Compare begins with the uncertainty that ICP stated of the moved scan; that of its distances is no smaller."""
    session, tool, stated = p.d.session, tool_of(p, "compare"), p.d.session.document.scans[1].unsure
    assert stated is not None and 0 < stated < 0.02, stated
    p.click(f"{icons.COMPARE}##compare")
    p.d.until(lambda: tool.registration == stated)
    p.click("Compare")
    p.d.until(lambda: tool.worker is None and session.document.comparison is not None and tool.coloured is not None)
    comparison, found = session.document.comparison, tool.coloured.found
    assert comparison.registration == stated and found.uncertainty >= stated and abs(found.median) < found.uncertainty
    p.key("ctrl+z")
    p.d.until(lambda: session.document.comparison is None)
    p.click(f"{icons.ALIGN}##align")


def check_three_pairs_and_icp_bring_a_scan_to_its_place_and_undo_puts_it_back(p: Person, folder: Path) -> None:
    rng, d, session = np.random.default_rng(), p.d, p.d.session
    truth = rigid(rotation_about(np.array([0.0, 0.0, 1.0]), rng.uniform(-10, 10)), np.array([*rng.uniform(8, 10, 2), 0.1]))
    clouds = [sweep(place, int(rng.integers(1 << 30)), columns=260, rows=260, noise=0.002) for place in PLACES[:2]]
    grey = np.full((len(clouds[0]), 3), 128, np.uint8)
    paths = [write_ply(folder / "scans" / "fixed.ply", clouds[0], grey),
             write_ply(folder / "scans" / "moving.ply", moved_points(inverse(truth), clouds[1]), grey)]
    d.drop(*paths)
    d.until(lambda: session.loads.current is None and len(session.shown_scan.paths) == 2 and not session.shown_scan.preview)
    d.key("1")  # measured points alone
    tool = tool_of(p, "align")
    p.click(f"{icons.ALIGN}##align")
    d.until(lambda: d.app.toolbox.active is tool and tool.parts(d.app.tools))
    assert tool.moving == 1

    def click(mark: np.ndarray, number: int) -> None:
        """Flies to where a place of a scan is in the middle of the picture, and clicks the measured point nearest to it."""
        ends = np.stack([PLACES[0], mark, clouds[number][np.linalg.norm(clouds[number] - mark, axis=1).argmin()]])
        eye, there, point = moved_points(inverse(truth), ends) if number else ends
        session.flight.state = view_along(eye, there - eye, 1.0)
        d.rest()
        pixel = session.camera.project([point])[0][0]
        xdo("mousemove", *(round(float(at)) for at in pixel + session.area.origin))
        d.rest()
        d.until(lambda: session.point is not None)
        before = tool.pairs.count, tool.pairs.begun is not None
        d.app.input._last_click = (-1.0, "", (0.0, 0.0))  # the clicks of a pair are no double click
        xdo("click", 1)
        d.until(lambda: (tool.pairs.count, tool.pairs.begun is not None) != before)

    for mark in MARKS:
        click(mark, 1)
        click(mark, 0)
    d.until(lambda: not session.work.exact_points.busy)
    assert tool.pairs.count == 3 and session.document.scans[1].transform is None

    def off() -> float:
        """Metres from its place, of the point of the moved scan that is farthest from it."""
        found = transforms_of(session.document.scans, session.scene.meta.sources)[1]
        own = moved_points(inverse(truth), clouds[1])
        return float(np.linalg.norm((own if found is None else moved_points(found, own)) - clouds[1], axis=1).max())

    assert off() > 5
    p.click("Apply pairs")
    d.until(lambda: tool.worker is None and session.loads.current is None and off() < 0.3)
    assert session.notices.message is None
    by_pairs = off()
    p.click("Refine (ICP)")
    d.until(lambda: tool.worker is None and session.loads.current is None and "overlap" in tool.result)
    d.rest()
    assert off() < min(by_pairs, 0.006), (off(), by_pairs)
    d.picture("aligned")
    _compare_takes_what_align_states(p)
    p.key("ctrl+z")
    d.until(lambda: session.loads.current is None and off() == by_pairs)
    p.key("ctrl+z")
    d.until(lambda: session.loads.current is None and off() > 5)
    assert session.document.scans[1].transform is None
    p.key("Escape", "3")
