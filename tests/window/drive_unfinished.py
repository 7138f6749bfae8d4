"""A person leaves, by X key and pointer events, what is not finished, for ``test_unfinished.py``: Ctrl+Q while a file is
written, a name that another window writes to, and Esc where something lies above points that are set. And uses day tools."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import checks_cut_off_grid
import checks_day_tools
import checks_set_points
import checks_written_files
import numpy as np
from checks_set_points import set_points
from checks_written_files import tool_of
from drive_dialogs import Person, main, write_ply
from x_keyboard import xdo

from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import read_project, write_project


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
    p.d.until(lambda: session.scene is not None and session.loads.current is None
              and sorted(path.name for path in session.shown_scan.paths) == sorted(names))
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


_PARTS = vars(checks_written_files), vars(checks_set_points), dict(globals()), vars(checks_day_tools), vars(checks_cut_off_grid)
CHECKS = {name.removeprefix("check_"): made for part in _PARTS for name, made in part.items() if name.startswith("check_")}


if __name__ == "__main__":
    main(Path(sys.argv[1]), CHECKS)
