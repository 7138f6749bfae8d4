"""The measuring tool without a window: clicks set points, fit surfaces and are undone; tables hold places of the file."""

import threading
from dataclasses import replace
from time import monotonic, sleep
from types import SimpleNamespace

import numpy as np
import pytest
from tool_window import a_wall, click, context_of, tool_context  # noqa: F401  (fixtures)
from untyped import any_typed

from pointglass.viewer.window.file_dialog.chosen_path import examine
from pointglass.viewer.window.interaction.measuring.measure import Measure
from pointglass.viewer.window.interaction.tool import KeyEvent
from pointglass.viewer.window.session import exact_points
from pointglass.viewer.work.measuring.measure_text import text_of
from pointglass.viewer.work.measuring.values import evaluate


def test_a_distance_is_measured_between_two_clicks_and_undone(context):
    tool = Measure()
    click(tool, context, (1.0, 5.0, 1.0))
    assert len(tool.points) == 1 and context.document.measurements == ()
    click(tool, context, (3.0, 5.0, 2.0))
    (made,) = context.document.measurements
    assert made.name == "Distance" and tool.points == []
    result = evaluate(made)
    assert abs(result.value - np.sqrt(5)) < 0.01 and 0 < result.uncertainty < 0.02
    assert context.session.work.undo() == "Measure distance" and context.document.measurements == ()
    context.session.work.redo()
    assert context.document.measurements == (made,)


def test_the_point_that_was_set_last_is_not_set_again(context):
    """A hand that trembles, or a pointer that a slow machine has left behind, makes no distance of 0 m."""
    tool = Measure()
    for _ in range(2):
        click(tool, context, (1.0, 5.0, 1.0))
    assert len(tool.points) == 1 and context.document.measurements == () and "set before" in context.toasts[-1]
    click(tool, context, (3.0, 5.0, 2.0))
    (made,) = context.document.measurements
    assert evaluate(made).value == pytest.approx(np.sqrt(5), abs=0.01)


class Drawn:
    """Keeps the labels that are drawn over a picture."""

    def __init__(self):
        self.labels = []

    def label(self, _, text):
        self.labels.append(text)

    def __getattr__(self, _):
        return lambda *_, **__: None


def test_a_length_is_written_from_the_next_measured_point_on_with_the_digits_that_it_will_have(context):
    tool, work, drawn = Measure(), context.session.work, Drawn()
    work.exact_points = SimpleNamespace(of=lambda _, picked, __: replace(picked, position=(1.0001, 5.0, 1.0001)))  # the file's
    click(tool, context, (1.0, 5.0, 1.0))
    near = tool._pointing.at(context, tuple(context.camera.project([(1.0, 5.0, 1.0)])[0][0]))
    for work.under_pointer in (near, replace(near, position=tool.points[0].position)):
        tool.draw(any_typed(drawn), context)
    assert drawn.labels == []
    for along in (0.01, 2.0):
        work.under_pointer = replace(near, index=near.index + 1, position=(1.0 + along, 5.0, 1.0))
        tool.draw(any_typed(drawn), context)
    assert [len(label.split(".")[1]) for label in drawn.labels] == [len("123 m")] * 2
    work.exact_points = SimpleNamespace(of=lambda _, picked, __: picked)
    click(tool, context, (3.0, 5.0, 1.0))
    (made,) = context.document.measurements
    assert text_of(evaluate(made), "m").startswith(drawn.labels[1].split()[0][:5])


def fitted(tool, context) -> None:
    """Turns the window's loop until no surface is being fitted."""
    end = monotonic() + 60
    while tool._fitting.points and monotonic() < end:
        tool.follow(context)
        sleep(0.01)


def test_a_click_fits_a_plane_beside_the_frame_and_one_step_takes_it_back(wall):
    context, tool = context_of(wall), Measure()
    tool.kind = "plane"
    click(tool, context, (1.0, 5.0, 1.0))
    assert context.document.measurements == () and "Esc gives up" in tool.hint(context)
    fitted(tool, context)
    (made,) = context.document.measurements
    assert made.kind == "plane" and made.name == "Plane" and made.fit is not None
    assert evaluate(made).value == pytest.approx(90.0, abs=0.01) and abs(made.fit.place[1] - 5.0) < 1e-4
    assert context.session.work.undo() == "Measure plane" and context.document.measurements == ()


def test_a_fit_is_given_up_by_esc_and_a_flat_wall_is_no_pipe(wall):
    context, tool = context_of(wall), Measure()
    tool.kind = "pipe"
    click(tool, context, (1.0, 5.0, 1.0))
    assert tool.key_event(KeyEvent("ESCAPE", "press"), context) and not tool.key_event(KeyEvent("ESCAPE", "press"), context)
    click(tool, context, (1.0, 5.0, 1.0))
    fitted(tool, context)
    assert context.document.measurements == () and context.toasts[-1].startswith("Nothing round here")


def test_a_plane_that_is_set_goes_over_to_a_kind_that_begins_with_one(wall):
    context, tool = context_of(wall), Measure()
    tool.kind = "corner"
    click(tool, context, (1.0, 5.0, 1.0))
    fitted(tool, context)
    (plane,) = tool.points
    assert plane.fit is not None and tool.hint(context).startswith("Click another flat surface")
    tool._change_kind("edge", context)
    assert tool.points == [plane]
    click(tool, context, (3.0, 5.0, 2.0))
    assert "Fitting" in tool.hint(context)
    fitted(tool, context)
    (made,) = context.document.measurements
    assert made.kind == "edge" and evaluate(made).value == pytest.approx(180.0, abs=0.5) and tool.points == []


def test_another_kind_gives_up_planes_that_it_has_no_use_for_those_being_fitted_too(wall):
    context, tool = context_of(wall), Measure()
    tool.kind = "corner"
    click(tool, context, (1.0, 5.0, 1.0))
    fitted(tool, context)
    click(tool, context, (3.0, 5.0, 2.0))
    tool._change_kind("distance", context)
    assert tool.points == [] and tool._fitting.points == [] and "2 points of the corner given up" in context.toasts[-1]
    click(tool, context, (1.0, 5.0, 1.0))
    click(tool, context, (3.0, 5.0, 1.0))
    assert [made.kind for made in context.document.measurements] == ["distance"]


def test_an_area_ends_with_enter_and_points_are_taken_back(context):
    tool = Measure()
    tool.kind = "area"
    for place in ((1.0, 5.0, 0.5), (3.0, 5.0, 0.5), (2.0, 5.0, 1.0), (3.0, 5.0, 2.5), (1.0, 5.0, 2.5)):
        click(tool, context, place)
        if place[0] == 2.0:
            assert tool.key_event(KeyEvent("BACKSPACE", "press"), context)
    assert tool.key_event(KeyEvent("ENTER", "press"), context)
    (made,) = context.document.measurements
    assert evaluate(made).value == pytest.approx(4.0, rel=0.01)


def test_background_sets_no_point(context):
    tool = Measure()
    click(tool, context, (2.0, 5.0, 3.4))
    assert tool.points == [] and "No measured point" in context.toasts[-1]


def test_escape_drops_the_points_begun(context):
    tool = Measure()
    assert not tool.key_event(KeyEvent("ESCAPE", "press"), context)
    click(tool, context, (1.0, 5.0, 1.0))
    assert tool.key_event(KeyEvent("ESCAPE", "press"), context) and tool.points == []


def test_csv_export_says_where_it_went(context, tmp_path):
    tool = Measure()
    click(tool, context, (1.0, 5.0, 1.0))
    click(tool, context, (3.0, 5.0, 1.0))
    tool.export.start(context, tmp_path / "m.csv")
    assert str(tmp_path / "m.csv") in context.toasts[-1] and "Distance,distance" in (tmp_path / "m.csv").read_text()


@pytest.mark.parametrize("note", [None, "scan.xyz has changed: from the grid, to 0.1 mm"])
def test_csv_export_waits_for_places_in_the_file_and_a_message_says_which_are_not(context, tmp_path, monkeypatch, note):
    read = threading.Event()

    def exactly(_scene, _camera, picked):
        read.wait(30)
        moved = np.add(picked.position, 0.0 if note else 0.001)
        return replace(picked, position=tuple(moved.tolist()), note=note, exact=note is None)

    monkeypatch.setattr(exact_points, "exactly", exactly)
    monkeypatch.setattr(exact_points, "is_quick", lambda *_: False)
    context.wake = lambda: None
    tool, reading, file = Measure(), context.session.work.exact_points, tmp_path / "m.csv"
    click(tool, context, (1.0, 5.0, 1.0))
    click(tool, context, (3.0, 5.0, 1.0))
    grid = [point.position for point in context.document.measurements[0].points]
    tool.export.start(context, file)
    reading.poll()
    assert reading.busy and not file.read_bytes() and tool.unfinished, "the name is kept until then"
    assert "is writing" in examine(file, saving=True).problem
    read.set()
    reading.wait(30)
    assert not tool.unfinished and not examine(file, saving=True).problem
    written = [[float(value) for value in line.split(",")[7:10]] for line in file.read_text().splitlines()[1:]]
    np.testing.assert_allclose(written, np.add(grid, 0.0 if note else 0.001), rtol=0, atol=1e-7)
    assert (note in context.toasts) == (note is not None)
