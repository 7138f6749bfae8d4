"""The Notes tool without a window: what clicks, keys and choices make of the document."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tool_window import a_wall, context_of  # noqa: F401  (a fixture)

from pointglass.viewer.window.interaction.notes.note_fields import NoteFields
from pointglass.viewer.window.interaction.notes.note_markers import note_at
from pointglass.viewer.window.interaction.notes.notes_tool import Notes
from pointglass.viewer.window.interaction.tool import KeyEvent, Modifiers, PointerEvent


def click(x: float, y: float) -> PointerEvent:
    return PointerEvent("release", (x, y), button="left", clicks=1)


@pytest.fixture
def made(wall):
    context = context_of(wall)
    context.session.loads = SimpleNamespace(wake=lambda: None)
    return Notes(), context


def test_a_click_writes_a_note_at_the_measured_point_and_another_on_it_chooses_it(made):
    tool, context = made
    tool.pointer(click(200, 150), context)
    (note,) = context.document.annotations
    assert abs(np.array(note.position) - (2.0, 5.0, 1.5)).max() < 0.03 and note.status == "open" and note.made.endswith("Z")
    assert np.allclose(note.view.camera(400, 300).camera_to_world, context.camera.camera_to_world)
    assert tool.chosen == 0 and tool._fields._asks > 0, "the text takes the keys"
    tool.pointer(click(300, 200), context)
    assert len(context.document.annotations) == 2 and tool.chosen == 1
    tool.pointer(click(203, 148), context)
    assert len(context.document.annotations) == 2 and tool.chosen == 0
    context.session.work.undo()
    context.session.work.undo()
    tool._fields = SimpleNamespace(follow=lambda context, note: None)
    tool.follow(context)
    assert context.document.annotations == () and tool.chosen is None


def test_a_click_beside_the_scan_says_so_and_other_buttons_do_nothing(made):
    tool, context = made
    tool.pointer(click(3, 3), context)
    tool.pointer(replace(click(200, 150), button="right"), context)
    tool.pointer(replace(click(200, 150), clicks=0), context)
    assert context.document.annotations == () and len(context.toasts) == 1


def test_typing_is_one_step_and_each_choice_another(made):
    tool, context = made
    tool.pointer(click(200, 150), context)
    for text in ("C", "Cr", "Crack"):
        tool.change(context, 0, "Text of a note", ("note text", 0), text=text)
    tool.change(context, 0, "Status of a note", status="done")
    note = context.document.annotations[0]
    assert (note.text, note.status) == ("Crack", "done")
    context.session.work.undo()
    assert context.document.annotations[0].status == "open" and context.document.annotations[0].text == "Crack"
    context.session.work.undo()
    assert context.document.annotations[0].text == ""
    context.session.work.undo()
    assert context.document.annotations == ()


def test_delete_takes_the_chosen_note_and_escape_lets_it_go(made):
    tool, context = made
    for x in (150, 200, 250):
        tool.pointer(click(x, 150), context)
    tool.choose(1)
    kept = context.document.annotations[::2]
    assert not tool.key_event(KeyEvent("Z", "press", Modifiers(control=True)), context)
    assert tool.key_event(KeyEvent("DELETE", "press"), context) and context.document.annotations == kept
    assert tool.chosen is None and not tool.key_event(KeyEvent("DELETE", "press"), context)
    tool.choose(0)
    assert tool.key_event(KeyEvent("ESCAPE", "press"), context) and tool.chosen is None
    assert not tool.key_event(KeyEvent("ESCAPE", "press"), context), "the next one leaves the tool"


def test_a_marker_behind_the_camera_is_not_hit(made):
    _, context = made
    behind = tuple(map(float, context.camera.position - 4 * context.camera.forward))
    from pointglass.viewer.work.notes.annotation import Annotation

    context.session.work.edit("x", annotations=(Annotation("behind", behind),))
    assert note_at(context, (200.0, 150.0), 1e9) is None


def test_only_pictures_are_attached_and_only_to_the_note_that_is_there(made, tmp_path):
    tool, context = made
    tool.pointer(click(200, 150), context)
    tool.pointer(click(300, 150), context)
    fields, (note, other) = NoteFields(), context.document.annotations
    fields._attach(context, tool, note, [tmp_path / "a.txt"])
    assert context.document.annotations[0].picture == "" and "a.txt is not attached" in context.toasts[-1]
    tool.delete(context, 0)  # while the dialog is open
    fields._attach(context, tool, note, [tmp_path / "a.jpg"])
    assert context.document.annotations == (other,)
    fields._attach(context, tool, other, [tmp_path / "a.JPG"])
    assert context.document.annotations[0].picture == str(tmp_path / "a.JPG")
