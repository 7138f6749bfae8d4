"""Checks of tools of a surveyor's day by X key and pointer events, for ``drive_unfinished.py``: the volume in a clip box whose
numbers are typed, the buttons of a selection, and what F12 says of letters that no font has."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np
from checks_written_files import tool_of
from drive_dialogs import Person, write_points
from x_keyboard import xdo

from pointglass.viewer.common import fonts
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.window.kit.number_field import _Said
from pointglass.viewer.work.notes.annotation import Annotation

_STEP, _SIDE, _TALL = 0.04, 1.6, 0.5
"""Metres: spacing of the points, and the heap, a block, on a floor of 4 x 4 m."""

LETTER = "\u7ba1"
"""A letter of Chinese, which only fonts of the machine have."""


@contextmanager
def no_fonts(folder: Path) -> Iterator[None]:
    """Within the block the machine has no fonts but the product's own."""
    def asked_again() -> None:
        fonts.machine_fonts.cache_clear()
        fonts.font_with.cache_clear()

    folder.mkdir()
    with patch.dict(os.environ, {fonts.ENVIRONMENT: str(folder)}):
        asked_again()
        yield
    asked_again()


def heap() -> np.ndarray:
    """(n, 3): a floor with a block in its middle, its walls too."""
    flat = np.stack(np.meshgrid(*[np.arange(0.0, 4.0, _STEP)] * 2), axis=-1).reshape(-1, 2)
    inside = (np.abs(flat - 2.0) < _SIDE / 2).all(axis=1)
    along, up = np.meshgrid(np.arange(-_SIDE / 2, _SIDE / 2, _STEP), np.arange(0.0, _TALL, _STEP))
    walls = [np.stack([2.0 + a, 2.0 + b, up], axis=-1).reshape(-1, 3) for side in (-_SIDE / 2, _SIDE / 2)
             for a, b in ((along, np.full_like(along, side)), (np.full_like(along, side), along))]
    return np.concatenate([np.column_stack([flat, np.where(inside, _TALL, 0.0)]), *walls])


def typed(p: Person, label: str, number: str) -> None:
    """Types a number in the place of that of a field."""
    p.click(label)
    p.key("ctrl+a")
    xdo("type", "--delay", 8, "--", number)
    p.d.settle(8)
    p.key("Return")
    p.d.settle(4)


def check_the_volume_in_a_clip_box_of_typed_numbers_is_measured(p: Person, folder: Path) -> None:
    session = p.d.session
    p.d.drop(write_points(folder / "scans" / "heap.ply", heap()))
    p.opened("heap.ply")
    p.d.rest()
    p.key("b")
    p.click("+ Box")
    for label, number in (("##z", "0.5123456"), ("##height", "0.8246912"), ("##length", "3.2"), ("##width", "3.2")):
        typed(p, label, number)
    (box,) = session.document.clips
    assert isinstance(box, Box)
    assert box.centre[2] == 0.5123456 and 2 * box.half[2] == 0.8246912 and 2 * box.half[0] == 3.2, box
    p.click("##z")
    p.key("Tab")  # visited, not typed in
    p.d.settle(4)
    assert session.document.clips == (box,), "digits that a field does not show"
    for text in ("abc", "nan", "12abc", "-4", "1e30"):
        assert session.document.clips == (box,)
        typed(p, "##width", text)
        assert {"-4": "expected a size above 0", "1e30": "is limited to"}.get(text, text) in _Said.text and _Said.field
    p.d.picture("said at a field")
    (limited,) = session.document.clips
    assert isinstance(limited, Box) and 3.2 < limited.half[1] < 41, limited
    typed(p, "##width", "3.2")
    assert session.document.clips == (box,)
    a_click_that_waits_for_typed_keys_has_the_modifiers_of_its_press(p)
    typed(p, "##z", "0.5123456")
    p.click("Measure the volume in it")
    p.d.until(lambda: session.document.measurements)
    (made,) = session.document.measurements
    truth = _SIDE**2 * (_TALL - 0.1)
    assert made.kind == "volume" and made.volume is not None and abs(made.volume.cut - truth) <= made.volume.uncertainty, made
    assert made.volume.uncertainty < 0.15 * truth
    p.key("ctrl+z")
    assert not session.document.measurements and session.document.clips == (box,)
    session.work.edit("No clips", clips=())
    p.key("Escape")


def a_click_that_waits_for_typed_keys_has_the_modifiers_of_its_press(p: Person) -> None:
    """Keys, a click with Shift and Shift's release within one frame."""
    (left, top), (width, height) = p.d.session.area.origin, p.d.session.area.size
    p.click("##z")
    p.key("ctrl+a")
    xdo("type", "--delay", 1, "0.75")
    with patch.object(p.d.app.toolbox, "pointer", wraps=p.d.app.toolbox.pointer) as given:
        xdo("mousemove", round(left + width / 2), round(top + height / 2), "keydown", "shift", "click", 1, "keyup", "shift")
        p.d.until(lambda: any(call.args[0].kind == "release" for call in given.call_args_list))
    pressed = {call.args[0].kind: call.args[0].modifiers.shift for call in given.call_args_list}
    assert pressed["press"] and pressed["release"] and p.d.session.document.clips[0].centre[2] == 0.75


def check_buttons_of_a_selection_do_what_they_say(p: Person, folder: Path) -> None:
    session, tool = p.d.session, tool_of(p, "select")
    p.key("r")
    p.click("box")
    (left, top), (width, height) = session.area.origin, session.area.size
    p.d.rest()
    spots = ((x, y) for y in (0.5, 0.6, 0.7) for x in (0.5, 0.4, 0.6))
    while tool.box.box is None:  # until a measured point was met
        x, y = next(spots)
        xdo("mousemove", round(left + width * x), round(top + height * y))
        p.d.rest()
        xdo("click", 1)
        p.d.settle(4)
        p.d.until(lambda: not session.work.exact_points.busy)
    for label, number in (("##x", "2"), ("##y", "2"), ("##z", "0.5"), *((f"##{side}", "1.01") for side in
                                                                        ("length", "width", "height"))):  # fmt: skip
        typed(p, label, number)
    p.click("Select inside")
    p.d.until(lambda: session.document.selection and tool.job.worker is None)
    xyz, document = heap(), session.document
    inside = int((np.abs(xyz - (2.0, 2.0, 0.5)) <= 0.505).all(axis=1).sum())
    assert document.selection.count == inside > 100

    def after(button: str, done) -> None:
        p.click(button)
        p.d.until(lambda: done() and tool.job.worker is None)

    after("Classify", lambda: session.document.reclassified)
    assert session.document.reclassified[0].points == document.selection and not session.document.selection
    said = tool._panel._lines(p.d.app.tools)
    assert said == (f"{inside:,} points: class now", "6 building; Ctrl+Z undoes"), said
    after("Select inside", lambda: session.document.selection)
    after("Class as in file", lambda: not session.document.reclassified)
    after("Select inside", lambda: session.document.selection)
    after("Keep", lambda: len(session.document.regions) == 1)
    assert session.document.regions[0].points == document.selection
    p.key("ctrl+z")
    p.d.until(lambda: session.document.selection == document.selection and not session.document.regions)
    for button in ("Hide", "Only", "Delete"):
        before = p.d.bare()
        after(button, lambda: session.document.regions)
        assert (p.d.bare() != before).any(), f"{button} shows nothing"
        p.key("ctrl+z")
        p.d.until(lambda: not session.document.regions and tool.job.worker is None)
        assert np.array_equal(p.d.bare(), before), f"{button} is not undone"
    after("Invert", lambda: session.document.selection != document.selection)
    after("Clear", lambda: not session.document.selection)
    p.key("Escape")


def check_f12_and_a_saved_sheet_name_letters_that_no_font_has(p: Person, folder: Path) -> None:
    with no_fonts(folder / "no fonts"):
        _named_letters(p, folder)


def _named_letters(p: Person, folder: Path) -> None:
    session, film = p.d.session, tool_of(p, "film")
    middle = session.camera.position + 3 * session.camera.forward
    session.work.edit("A note", annotations=(Annotation(f"{LETTER} wall", tuple(middle.tolist())),))
    p.key("k")
    p.click("Saved pictures (F12)")
    p.click("with notes")
    assert session.work.shot_noted and p.d.app.toolbox.active is film

    def told(boxes: bool) -> None:
        p.d.until(lambda: any("Saved" in toast.text for toast in session.notices.toasts))
        found = [toast.text for toast in session.notices.toasts if "drawn as boxes" in toast.text]
        assert len(found) == boxes and all(LETTER in text for text in found), found
        session.notices.toasts = []

    for noted in (True, False):
        session.notices.toasts = []
        p.key("F12")
        told(noted)
        p.click("with notes")
    session.work.edit("No notes", annotations=())
    section = tool_of(p, "section")
    p.key("n")
    section.sheet.paper, section.sheet.title, out = "A4", LETTER, folder / "sheet.pdf"
    p.click("Save sheet…")
    p.listed()
    p.type(str(out))
    p.key("Return")
    told(True)
    assert out.read_bytes().startswith(b"%PDF")
    section.sheet.paper, section.sheet.title = None, ""
    p.key("Escape")
