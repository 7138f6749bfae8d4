"""The window's tools without a window: pointing, measuring, clipping and saving change the document as a person expects."""

import threading
from dataclasses import replace
from time import monotonic, sleep
from types import SimpleNamespace

import numpy as np
import pytest

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box, Slab, vector
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.window.file_dialog.chosen_path import examine
from pointglass.viewer.window.interaction.clipping.clip_tool import ClipTool, along_axis, handles, turned, with_face_moved
from pointglass.viewer.window.interaction.measuring.measure import Measure
from pointglass.viewer.window.interaction.tool import KeyEvent, PointerEvent
from pointglass.viewer.window.session import exact_points
from pointglass.viewer.window.session.work import DocumentState
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.measuring.measure_text import text_of
from pointglass.viewer.work.measuring.values import evaluate
from pointglass.viewer.work.project import places_in, write_project


@pytest.fixture(scope="module")
def wall():
    """A wall of 4 by 3 m at y = 5, in a fine regular grid."""
    x, z = np.meshgrid(np.arange(0, 4, 0.01), np.arange(0, 3, 0.01))
    xyz = np.stack([x.ravel(), np.full(x.size, 5.0), z.ravel()], axis=1)
    return scene_from_arrays(xyz, np.full((len(xyz), 3), 90, np.uint8), meta=ScanDescription(metres_per_unit=1.0))


class Context:
    """What tools use of a window."""

    def __init__(self, scene):
        self.scene, self.camera = scene, from_fov(400, 300, 60.0, look_at((2.0, 1.0, 1.5), (2.0, 5.0, 1.5)))
        work = DocumentState()
        work.begin([])
        work.accept()
        pixels, z = self.camera.project(unpack(scene)[0])
        depth = np.full((300, 400), np.inf, np.float32)
        column, row = np.floor(pixels).astype(int).T
        inside = (column >= 0) & (column < 400) & (row >= 0) & (row < 300)
        np.minimum.at(depth, (row[inside], column[inside]), z[inside].astype(np.float32))
        arrays = {"depth": depth, "mask": np.isfinite(depth)}
        self.viewport = SimpleNamespace(frame=object(), pixels=SimpleNamespace(read=lambda _, name, wait: arrays[name]))
        self.session = SimpleNamespace(work=work, flight=SimpleNamespace(moving=False), pointer=None,
                                       view_settings=SimpleNamespace(shown_settings=Settings(), background="sky"))
        self.toasts, self.renewed = [], 0

    @property
    def document(self):
        return self.session.work.document

    def pixels(self, length):
        return length

    def tell_saved(self, path, text=""):
        self.toast(text or f"Saved {path}")

    def toast(self, text):
        self.toasts.append(text)

    def wake(self):
        pass

    def renew_picture(self):
        self.renewed += 1

    def ray(self, position):
        along = self.camera.unproject([position], 1.0)[0] - self.camera.position
        return self.camera.position, along / np.linalg.norm(along)


@pytest.fixture
def context(wall):
    return Context(wall)


def click(tool, context, place, button="left", clicks=1):
    (pixel,), _ = context.camera.project([place])
    for kind in ("press", "release"):
        tool.pointer(PointerEvent(kind, tuple(pixel), button=button, clicks=clicks if kind == "release" else 0), context)


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
        tool.draw(drawn, context)
    assert drawn.labels == []
    for along in (0.01, 2.0):
        work.under_pointer = replace(near, index=near.index + 1, position=(1.0 + along, 5.0, 1.0))
        tool.draw(drawn, context)
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
    context, tool = Context(wall), Measure()
    tool.kind = "plane"
    click(tool, context, (1.0, 5.0, 1.0))
    assert context.document.measurements == () and "Esc gives up" in tool.hint(context)
    fitted(tool, context)
    (made,) = context.document.measurements
    assert made.kind == "plane" and made.name == "Plane" and made.fit is not None
    assert evaluate(made).value == pytest.approx(90.0, abs=0.01) and abs(made.fit.place[1] - 5.0) < 1e-4
    assert context.session.work.undo() == "Measure plane" and context.document.measurements == ()


def test_a_fit_is_given_up_by_esc_and_a_flat_wall_is_no_pipe(wall):
    context, tool = Context(wall), Measure()
    tool.kind = "pipe"
    click(tool, context, (1.0, 5.0, 1.0))
    assert tool.key_event(KeyEvent("ESCAPE", "press"), context) and not tool.key_event(KeyEvent("ESCAPE", "press"), context)
    click(tool, context, (1.0, 5.0, 1.0))
    fitted(tool, context)
    assert context.document.measurements == () and context.toasts[-1].startswith("Nothing round here")


def test_a_plane_that_is_set_goes_over_to_a_kind_that_begins_with_one(wall):
    context, tool = Context(wall), Measure()
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
    context, tool = Context(wall), Measure()
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


def random_axes(random):
    q = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return tuple(vector(row) for row in q)


def test_a_moved_face_leaves_the_opposite_one(seed):
    random = np.random.default_rng(seed)
    for _ in range(30):
        axes = random_axes(random)
        box = Box(vector(random.normal(size=3)), vector(random.uniform(0.5, 2, 3)), axes)
        for clip in (box, Slab(box.centre, axes[0], 1.5)):
            before = handles(clip)
            face = int(random.integers(len(before)))
            by = float(random.uniform(-0.4, 2.0))
            after = handles(with_face_moved(clip, face, by, 1e-3))
            assert np.allclose(after[face ^ 1][0] @ before[face][1], before[face ^ 1][0] @ before[face][1])
            assert (after[face][0] - before[face][0]) @ before[face][1] == pytest.approx(by)


def test_a_face_cannot_pass_the_opposite_one():
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    assert with_face_moved(box, 1, -5.0, 0.01).half == (0.01, 1.0, 1.0)


def test_the_place_on_the_axis_is_nearest_to_the_ray(seed):
    random = np.random.default_rng(seed)
    for _ in range(50):
        origin, place = random.normal(size=(2, 3))
        ray, axis = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
        found = along_axis(origin, ray, place, axis)
        if found is None:
            continue

        def away(t, origin=origin, ray=ray, place=place, axis=axis):
            return np.linalg.norm(np.cross(place + t * axis - origin, ray))

        assert away(found) <= min(away(found - 1e-3), away(found + 1e-3))


def test_a_new_box_holds_the_whole_scan_and_little_more(context):
    ClipTool().add(context, "box")
    low, high = context.scene.bounds
    corners = context.document.clips[0].corners
    assert corners.min(axis=0) == pytest.approx(low - 0.01 * (high - low))
    assert corners.max(axis=0) == pytest.approx(high + 0.01 * (high - low))


def test_dragging_a_handle_is_one_step(context):
    tool = ClipTool()
    tool.add(context, "box")
    before = context.document.clips[0]
    place, _ = handles(before)[1]
    (pixel,), _ = context.camera.project([place])
    assert tool.pointer(PointerEvent("press", tuple(pixel), button="left"), context)
    for step in range(1, 6):
        tool.pointer(PointerEvent("move", (pixel[0] + 5 * step, pixel[1]), button="left"), context)
    assert tool.pointer(PointerEvent("release", (pixel[0] + 25, pixel[1]), button="left"), context)
    moved = context.document.clips[0]
    assert moved.half[0] > before.half[0]
    context.session.work.undo()
    assert context.document.clips == (before,)
    assert not tool.pointer(PointerEvent("press", (1.0, 1.0), button="left"), context), "beside a handle the view turns"
    assert tool.key_event(KeyEvent("DELETE", "press"), context) and context.document.clips == ()


def test_turning_four_times_a_quarter_is_nothing():
    box = Box((1.0, 2.0, 3.0), (1.0, 2.0, 3.0))
    turned_box = box
    for _ in range(4):
        turned_box = turned(turned_box, 90.0, np.array([0.0, 0.0, 1.0]))
    assert np.allclose(turned_box.axes, box.axes)
    assert np.allclose(turned(Slab((0, 0, 0), (1.0, 0.0, 0.0), 1.0), 90.0, np.array([0, 0, 1.0])).normal, (0, 1, 0))


def test_a_project_saved_and_opened_is_as_it_was_left(context, tmp_path):
    scan = tmp_path / "wall.ply"
    scan.touch()
    work = context.session.work
    assert work.begin([scan]) == [scan]
    work.accept()
    ClipTool().add(context, "upright")
    path = tmp_path / "wall.pointglass"
    assert work.project_path == path and work.changed(Settings(), "sky")
    work.save_project(path, context.camera, Settings(), "sky")
    assert not work.changed(Settings(), "sky")
    other = DocumentState()
    assert other.begin([path]) == [scan] and other.opens_other
    document = other.accept()
    assert document == work.document and other.project == path
    assert document.view is not None
    assert np.allclose(document.view.camera(400, 300).camera_to_world, context.camera.camera_to_world)
    assert document.background == "sky" and document.clips[0].name == "Section"


@pytest.mark.parametrize("away", ("before it is opened", "while it is open"))
def test_what_is_recorded_of_a_scan_stays_where_it_is_saved_while_the_scan_is_away(context, tmp_path, away):
    here, gone = tmp_path / "here.ply", tmp_path / "gone.ply"
    here.write_text("here"), gone.write_text("gone for now")
    project = tmp_path / "p.pointglass"
    write_project(project, Document((ScanFile(str(here)), ScanFile(str(gone)))))
    before, work = places_in(project), DocumentState()
    assert before[str(gone)].size == 12 and before[str(gone)].ends
    if away == "before it is opened":
        gone.unlink()
        work.located = {str(gone): None}
    read = work.begin([project])
    assert read == ([here] if away == "before it is opened" else [here, gone])
    work.accept()
    assert not work.changed(Settings(), "plain"), "what is left out stays in the project"
    gone.unlink(missing_ok=True)
    here.write_text("here, and changed")
    for path in (project, tmp_path / "copy.pointglass", project):
        work.save_project(path, context.camera, Settings(), "sky")
        found = places_in(path)
        assert found[str(gone)] == before[str(gone)] and found[str(here)].ends == before[str(here)].ends
    gone.write_text("another, as long as it likes")
    work.save_project(project, context.camera, Settings(), "sky")
    assert places_in(project)[str(gone)].size == 12, "the work belongs to the file that was loaded"
    assert work.begin([project]) == [here, gone], "it is back"
    assert len(work.note_loaded([here, gone])) == 2
    work.save_project(project, context.camera, Settings(), "sky")
    assert [places_in(project)[str(path)].size for path in (here, gone)] == [17, 28]


def test_a_project_whose_scan_is_gone_is_refused(tmp_path, capsys):
    from pointglass.viewer.cli import main

    path = tmp_path / "p.pointglass"
    write_project(path, Document((ScanFile(str(tmp_path / "gone.laz")),)))
    assert main(["export", str(path), "--out", str(tmp_path / "a.laz")]) == 2
    said = capsys.readouterr().err
    assert str(path) in said and "gone.laz is not there" in said and "locate it" in said and said.count("\n") == 1
    path.write_text("{")
    assert main([str(path)]) == 2 and "damaged" in capsys.readouterr().err


def test_the_window_exports_to_every_kind_of_file_that_export_writes():
    from pointglass.viewer.commands.exporting.splat_export import SPLATS
    from pointglass.viewer.commands.exporting.targets import TARGETS
    from pointglass.viewer.window.saving.points_export import KINDS

    splats = {"." + end.lstrip(".") for end in SPLATS}
    assert {ending for endings in KINDS.values() for ending in endings} == {*TARGETS, *splats}
