"""Checks of points that are set and surfaces that are fitted, for ``drive_unfinished.py``: saving, leaving, Esc meanwhile."""

from pathlib import Path
from unittest.mock import patch

from checks_written_files import held, tool_of
from drive_dialogs import Person, write_ply
from x_keyboard import xdo

from pointglass.viewer.window.interaction.measuring import fitting
from pointglass.viewer.window.session import exact_points
from pointglass.viewer.work.project import read_project


def set_points(p: Person, kind: str, number: int) -> None:
    """Measures ``kind`` with so many clicks, side by side in the middle of the picture."""
    session, tool = p.d.session, tool_of(p, "measure")
    tool.kind = kind
    p.key("t")
    left, top, width, height = (*session.area.origin, *session.area.size)
    for clicked in range(number):
        xdo("mousemove", round(left + width * (0.4 + 0.2 * clicked)), round(top + height * 0.5))
        p.d.rest()
        xdo("click", 1)
        done = len(session.document.measurements)
        p.d.until(lambda clicked=clicked, done=done: len(tool.points) == clicked + 1
                  or len(session.document.measurements) > done)  # fmt: skip


def check_a_project_that_another_window_saves_while_points_are_read_is_not_replaced(p: Person, folder: Path) -> None:
    session, project, theirs = p.d.session, folder / "scans" / "dense.pointglass", "saved by another window"
    p.d.drop(write_ply(folder / "scans" / "dense.ply", points=100_000))
    p.opened("dense.ply")
    with patch.object(exact_points, "is_quick", lambda *_: False), held(exact_points, "exactly"):
        set_points(p, "distance", 2)
        assert session.document.measurements and session.work.exact_points.busy
        p.key("ctrl+s")
        p.d.until(lambda: any("Saving once" in toast.text for toast in session.notices.toasts))
        project.write_text(theirs)
    p.d.until(lambda: session.notices.message is not None or not p.d.app.projects.changed)
    assert session.notices.message is not None and session.notices.message.title == "Replace the project?"
    p.key("Escape")
    assert session.notices.message is None and p.d.app.projects.changed and project.read_text() == theirs
    p.key("ctrl+s")  # there is a file of this name
    p.listed()
    p.key("Escape")
    assert p.choice is None and project.read_text() == theirs
    p.key("Escape")


def check_escape_closes_what_lies_above_points_that_are_set(p: Person, folder: Path) -> None:
    session, tool = p.d.session, tool_of(p, "measure")
    p.d.drop(Path("room5"))
    p.opened("room5")
    set_points(p, "polyline", 2)
    points = list(tool.points)
    assert len(points) == 2
    left, top, width, height = (*session.area.origin, *session.area.size)
    p.key("F1")
    assert session.help
    p.key("Escape")
    assert not session.help and tool.points == points
    p.key("F10")
    assert not session.interface
    p.key("Escape")
    assert session.interface and tool.points == points
    p.click("##kind")
    p.items.find("Polyline")
    p.key("Escape")
    p.d.settle(8)
    assert tool.points == points and tool.kind == "polyline"
    xdo("mousemove", round(left + width * 0.6), round(top + height * 0.6))
    p.d.settle()
    xdo("mousedown", 2)
    p.d.until(lambda: p.d.app.toolbox.holding)
    p.key("Escape")
    assert not p.d.app.toolbox.holding and tool.points == points
    xdo("mouseup", 2)
    p.d.settle()
    p.key("Escape")
    assert not tool.points and p.d.app.toolbox.active is tool
    p.key("Escape")
    assert p.d.app.toolbox.active is p.d.app.toolbox.fly


def check_points_do_not_go_over_to_another_kind_and_those_left_over_are_told(p: Person, folder: Path) -> None:
    session, tool = p.d.session, tool_of(p, "measure")
    p.d.drop(Path("room5"))
    p.opened("room5")
    set_points(p, "distance", 1)
    (first,) = tool.points
    p.click("##kind")
    p.click("Area")
    p.d.until(lambda: tool.kind == "area")
    assert not tool.points, "a distance's point is no corner of an area"
    assert session.notices.toasts[-1].text == "1 point of the distance given up; Ctrl+Z brings it back"
    p.key("ctrl+z")
    assert tool.kind == "distance" and tool.points == [first]
    p.key("Escape", "t")
    assert p.d.app.toolbox.active is not tool
    set_points(p, "area", 2)
    kept = list(tool.points)
    p.key("t", "t")
    assert p.d.app.toolbox.active is tool and tool.points == kept
    assert tool.hint(p.d.app.tools) == "2 points of an area that is not ended: go on, or Esc"
    p.key("Escape")
    assert not tool.points and p.d.app.toolbox.active is tool
    p.key("Escape")


def check_a_click_fits_a_plane_of_the_kind_chosen_in_the_list(p: Person, folder: Path) -> None:
    session, tool = p.d.session, tool_of(p, "measure")
    p.d.drop(Path("room5"))
    p.opened("room5")
    p.key("t")
    p.click("##kind")
    p.click("Plane")
    p.d.until(lambda: tool.kind == "plane")
    left, top, width, height = (*session.area.origin, *session.area.size)
    xdo("mousemove", round(left + width * 0.5), round(top + height * 0.5))
    p.d.rest()
    before = len(session.document.measurements)
    xdo("click", 1)
    p.d.until(lambda: len(session.document.measurements) > before)
    made = session.document.measurements[-1]
    assert made.kind == "plane" and made.fit is not None and made.fit.count >= 30
    p.key("ctrl+z")
    assert len(session.document.measurements) == before
    tool.kind = "distance"
    p.key("Escape")


def check_two_planes_clicked_in_quick_succession_are_both_fitted(p: Person, folder: Path) -> None:
    session, tool = p.d.session, tool_of(p, "measure")
    p.d.drop(Path("room5"))
    p.opened("room5")
    p.key("t")
    p.click("##kind")
    p.click("Plane to plane")
    p.d.until(lambda: tool.kind == "plane to plane")
    left, top, width, height = (*session.area.origin, *session.area.size)
    p.d.rest()
    before = len(session.document.measurements)
    with held(fitting, "fit_at"):  # both clicks come before the first surface is found
        for across, down in ((0.5, 0.45), (0.5, 0.9)):
            xdo("mousemove", round(left + width * across), round(top + height * down))
            p.d.settle()
            xdo("click", 1)
            p.d.settle()
        p.d.until(lambda: len(tool._fitting.points) == 2)
    p.d.until(lambda: len(session.document.measurements) > before)
    made = session.document.measurements[-1]
    assert made.kind == "plane to plane" and len(made.fits) == 2 and not tool.points
    p.key("ctrl+z")
    assert len(session.document.measurements) == before
    tool.kind = "distance"
    p.key("Escape")


def check_saving_waits_for_a_plane_that_is_fitted_and_leaving_asks(p: Person, folder: Path) -> None:
    session, tool, projects = p.d.session, tool_of(p, "measure"), p.d.app.projects
    project = folder / "scans" / "walls.pointglass"
    p.d.drop(write_ply(folder / "scans" / "walls.ply", points=100_000))
    p.opened("walls.ply")
    tool.kind = "plane"
    p.key("t")
    left, top, width, height = (*session.area.origin, *session.area.size)
    usual = projects.__dict__.pop("leave")  # the driver's asks nothing
    with held(fitting, "fit_at"):
        xdo("mousemove", round(left + width * 0.5), round(top + height * 0.5))
        p.d.rest()
        xdo("click", 1)
        p.d.until(lambda: bool(tool._fitting.points))
        xdo("key", "ctrl+q")
        p.d.until(lambda: session.notices.message is not None or p.d.app.closing)
        assert session.notices.message and session.notices.message.title == "Give up the measurement that is not ended?"
        p.key("Escape", "ctrl+s")
        assert not p.d.app.closing and not project.exists()
    p.d.until(project.exists)
    assert len(read_project(project).measurements) == 1 and not projects.changed
    tool.kind = "distance"
    xdo("mousemove", round(left + width * 0.5), round(top + height * 0.5))
    p.d.rest()
    xdo("click", 1)
    p.d.until(lambda: len(tool.points) == 1 and session.work.begun is not None and not session.work.exact_points.busy)
    session.work.edit("Remove the plane", measurements=())
    gone: list[bool] = []
    projects.leave(lambda: gone.append(True))
    p.d.rest()
    assert session.notices.message and "distance that is not ended; Save keeps the rest" in session.notices.message.text
    p.key("Return")
    p.d.until(lambda: bool(gone) or session.notices.message is not None)
    assert gone and session.notices.message is None, "one question"
    assert not read_project(project).measurements
    projects.leave = usual
    tool.kind = "distance"
    p.key("Escape")
