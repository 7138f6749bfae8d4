"""Tools without a window: clipping changes the document as a person expects, projects are saved as they were left."""

import numpy as np
import pytest
from tool_window import a_wall, tool_context  # noqa: F401  (fixtures)

from pointglass.viewer.picture.clip import Box, Slab, vector
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.interaction.clipping.clip_tool import ClipTool, along_axis, handles, turned, with_face_moved
from pointglass.viewer.window.interaction.tool import KeyEvent, PointerEvent
from pointglass.viewer.window.session.work import DocumentState
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import places_in, write_project


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
