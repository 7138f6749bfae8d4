"""A person leaves, by X key and pointer events, what is not finished, for ``test_unfinished.py``: Ctrl+Q while a file is
written, a name that another window writes to, and Esc where something lies above points that are set."""

import errno
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from drive_dialogs import Person, main, write_ply
from x_keyboard import xdo

from pointglass.viewer.commands.film import encode
from pointglass.viewer.commands.section import sheet
from pointglass.viewer.window.interaction.film import film_job
from pointglass.viewer.window.interaction.measuring import fitting
from pointglass.viewer.window.saving import still_job
from pointglass.viewer.window.session import exact_points
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import read_project, write_project


@contextmanager
def held(module, name: str) -> Iterator[None]:
    """Within the block the function of a module waits before it begins."""
    usual, go = getattr(module, name), threading.Event()

    def waits(*given, **named):
        assert go.wait(60.0)
        return usual(*given, **named)

    with patch.object(module, name, waits):
        try:
            yield
        finally:
            go.set()


def tool_of(p: Person, name: str):
    return next(tool for tool in p.d.app.toolbox.tools if tool.name == name)


def asked_about(p: Person, what: str) -> None:
    """Presses Ctrl+Q; the question names ``what``; Esc goes on."""
    xdo("key", "ctrl+q")
    p.d.until(lambda: p.d.session.notices.message is not None)
    message = p.d.session.notices.message
    assert message.title == "Close the window?" and what in message.text, message
    p.key("Escape")
    assert p.d.session.notices.message is None and not p.d.app.closing


def check_a_sheet_that_is_drawn_is_given_up_after_a_question_only(p: Person, folder: Path) -> None:
    p.d.drop(write_ply(folder / "scans" / "hall.ply"))
    p.opened("hall.ply")
    p.d.rest()
    p.key("n")
    tool, out = tool_of(p, "section"), folder / "scans" / "plan.pdf"
    with held(sheet, "_save"):
        p.click("Save sheet…")
        p.listed()
        p.type(f"{out}")
        p.key("Return")
        p.d.until(lambda: tool.worker is not None and out.exists())
        asked_about(p, "A sheet is being drawn.")
    p.d.until(lambda: tool.worker is None)
    assert out.read_bytes().startswith(b"%PDF")
    p.key("Escape")


def check_a_picture_that_is_rendered_is_given_up_after_a_question_only(p: Person, folder: Path) -> None:
    p.d.session.work.shot_scale = 2
    with held(still_job, "save_png"):
        p.key("F12")
        p.d.until(lambda: p.d.app.save_actions.still is not None)
        asked_about(p, "A picture is being rendered.")
    p.d.until(lambda: p.d.app.save_actions.still is None)
    p.d.session.work.shot_scale = 1
    (made,) = folder.glob("pointglass-*.png")
    assert made.stat().st_size


def check_the_name_of_a_film_that_is_rendered_is_not_given_to_another_file(p: Person, folder: Path) -> None:
    tool, out = tool_of(p, "film"), folder / "scans" / "walk.mp4"
    tool.size, tool.view = (64, 48), "filled"
    p.key("k")
    p.click("Add keyframe here")
    with held(film_job, "film"):
        p.click("Render video…")
        p.listed()
        p.type(f"{out}")
        p.key("Return")
        p.d.until(out.exists)
        asked_about(p, "A film is being rendered.")
        chosen: list[Path] = []
        p.d.app.files.save("films", "Save the film", "walk.mp4", film_endings, chosen.append)  # as another window does
        p.listed()
        p.key("Return")
        p.d.until(lambda: bool(p.choice.problem))
        assert "a window is writing this file" in p.choice.problem and p.choice.question is None
        p.key("Escape")
        assert p.choice is None and not chosen
    p.d.until(lambda: tool.worker is None)
    assert b"ftyp" in out.read_bytes()[:16]
    frames = folder / "scans" / "frames"
    with patch.object(encode, "write_json", side_effect=OSError(errno.ENOSPC, "No space left on device")):
        tool.start(p.d.app.tools, frames)
        p.d.until(lambda: p.d.session.notices.message is not None)
    told = p.d.session.notices.message.text
    assert told.startswith(f"{frames}: cannot be written (No space left on device); choose") and not frames.exists()
    p.key("Escape", "Escape")


film_endings = {"MP4 video": (".mp4",)}


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
    projects.leave = usual
    tool.kind = "distance"
    p.key("Escape")


def check_a_scan_that_is_left_out_while_it_is_away_is_shown_when_it_is_back(p: Person, folder: Path) -> None:
    there, gone = (write_ply(folder / "scans" / f"{name}.ply", away) for name, away in (("there", 0.0), ("gone", 6.0)))
    project, away = folder / "scans" / "pair.pointglass", folder / "away.ply"
    write_project(project, Document((ScanFile(str(there)), ScanFile(str(gone)))))
    gone.rename(away)
    p.d.drop(project)
    p.d.until(lambda: p.d.app.missing_scans.asked is not None)
    p.d.settle()
    p.click("Leave it out")
    p.opened("there.ply")
    p.key("ctrl+s")
    p.d.until(lambda: any("Saved" in toast.text for toast in p.d.session.notices.toasts))
    away.rename(gone)
    p.d.drop(project)
    p.opened("there.ply and 1 more")
    assert [scan.visible for scan in read_project(project).scans] == [True, True]


def check_scans_whose_names_are_not_utf_8_are_shown_listed_and_saved(p: Person, folder: Path) -> None:
    session, odd = p.d.session, folder / "odd"
    odd.mkdir()
    names = [os.fsdecode(name) for name in (b"caf\xe9.ply", b"th\xe9.ply")]
    for name, away in zip(names, (0.0, 6.0), strict=True):
        write_ply(odd / name, away)
    p.d.drop(odd)
    p.d.until(lambda: session.scene is not None and len(session.shown_scan.paths) == 2)
    p.d.rest()
    p.key("o")
    p.listed()
    p.key("Escape")
    p.key("t")
    p.key("i")
    session.work.edit("Background", background="sky")
    p.key("ctrl+s")  # beside the scans, under a name of its own
    p.d.until(lambda: not p.d.app.projects.changed)
    assert session.work.project is not None
    assert [Path(scan.path).name for scan in read_project(session.work.project).scans] == ["odd"], "the folder"
    assert sorted(Path(source).name for source in session.scene.meta.sources) == sorted(names)
    p.key("Escape")


def check_a_save_that_asks_takes_the_place_of_the_open_dialog(p: Person, folder: Path) -> None:
    taken = folder / "scans" / "there.pointglass"
    taken.write_text("somebody's")
    p.d.drop(write_ply(folder / "scans" / "there.ply", points=100_000))
    p.opened("there.ply")
    p.key("o")
    p.listed()
    p.key("ctrl+s")  # the usual name is taken
    p.d.until(lambda: p.choice is not None and p.choice.saving)
    p.listed()
    p.key("ctrl+s")
    p.d.settle()
    assert p.choice.saving and p.choice.text == "there.pointglass"
    p.key("Escape")
    assert p.choice is None and taken.read_text() == "somebody's"


SILENT_HOLDER = """
import ctypes, time
x = ctypes.CDLL("libX11.so.6")
x.XOpenDisplay.restype, x.XDefaultRootWindow.restype = ctypes.c_void_p, ctypes.c_ulong
display = ctypes.c_void_p(x.XOpenDisplay(None))
window = x.XCreateSimpleWindow(display, ctypes.c_ulong(x.XDefaultRootWindow(display)), 0, 0, 1, 1, 0, 0, 0)
x.XSetSelectionOwner(display, x.XInternAtom(display, b"CLIPBOARD", 0), window, 0)
x.XSync(display, 0)
print("holds", flush=True)
time.sleep(600)
"""
"""A program that holds the clipboard and does not answer."""


def check_a_program_that_holds_the_clipboard_and_hangs_does_not_stop_the_window(p: Person, folder: Path) -> None:
    session, tool = p.d.session, tool_of(p, "measure")
    copied = session.flight.state
    p.key("ctrl+c")
    session.flight.go(replace(copied, position=copied.position + 0.5))
    p.d.settle()
    p.key("ctrl+v")
    assert np.allclose(session.flight.state.position, copied.position)
    holder = subprocess.Popen([sys.executable, "-c", SILENT_HOLDER], stdout=subprocess.PIPE)
    try:
        assert holder.stdout is not None and holder.stdout.readline() == b"holds\n"

        def told() -> bool:
            return any("does not answer" in toast.text for toast in session.notices.toasts)

        p.key("ctrl+v")
        assert told() and np.allclose(session.flight.state.position, copied.position)
        session.notices.toasts = []
        if not session.document.measurements:
            p.d.rest()
            set_points(p, "distance", 2)
        else:
            p.key("t")
        p.click("##name")
        xdo("keydown", "ctrl")
        p.d.settle(4)
        p.key("v")
        p.d.settle(4)
        xdo("keyup", "ctrl")
        p.d.until(told)
        assert session.document.measurements[0].name == "Distance"
    finally:
        holder.kill()
        holder.wait()
    p.key("Escape", "Escape")
    assert p.d.app.toolbox.active is not tool


def type_into(p: Person, label: str, text: str) -> None:
    """Types into a slider, which a click with Ctrl makes a field."""
    xdo("keydown", "ctrl")
    p.d.settle(4)
    p.click(label)
    p.d.settle(4)
    xdo("keyup", "ctrl")
    p.d.settle(4)
    xdo("type", "--delay", 8, text)
    p.d.settle(16)
    p.key("Return")
    p.d.settle(8)


def check_text_that_is_no_number_changes_nothing(p: Person, folder: Path) -> None:
    section, session = tool_of(p, "section"), p.d.session
    p.key("n")
    type_into(p, "##height", "4")
    assert section.height == 4.0, f"typed as {section.height}"
    for label in ("##height", "##thickness"):
        type_into(p, label, "nan")
    assert section.height == 4.0 and np.isfinite(section.thickness or 0.0) and section.cut(p.d.app.tools) is not None
    section.kind = "elevation"
    p.d.settle()
    type_into(p, "##azimuth", "nan")
    assert np.isfinite(section.azimuth)
    p.key("k")
    for away in (0.0, 0.5):
        session.flight.go(replace(session.flight.state, position=session.flight.state.position + away))
        p.click("Add keyframe here")
    before = session.document.path
    type_into(p, "##length", "nan")
    assert len(before.keyframes) > 1 and session.document.path == before
    p.key("Escape")


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}


if __name__ == "__main__":
    main(Path(sys.argv[1]), CHECKS)
