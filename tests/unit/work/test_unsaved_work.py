"""Work is never lost without a question: what counts as changed, saving, leaving."""

import dataclasses
import zlib
from pathlib import Path

import numpy as np
import pytest
from test_picture_spec import other
from work_window import BOX, EYE, SCENE, SURVEY, TAPE, Window, work_window  # noqa: F401  (a fixture)

from pointglass.viewer.picture.dates.date_comparison import DateComparison
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.picture.photographs.placed_photograph import PlacedPhotograph
from pointglass.viewer.picture.point_sets import FileRuns, PointSet
from pointglass.viewer.picture.regions import ClassChange, Region
from pointglass.viewer.window.kit.notices import OpenProject
from pointglass.viewer.window.session.autosave import UnsavedWork
from pointglass.viewer.window.session.exact_points import ExactPoints
from pointglass.viewer.window.session.loading import Loaded
from pointglass.viewer.window.session.recovery import Recoverable, recoverable
from pointglass.viewer.window.session.scan_notice_actions import act_on_notice
from pointglass.viewer.work.document import CameraPath, Document, Keyframe
from pointglass.viewer.work.measuring.measurement import Begun, MeasuredPoint
from pointglass.viewer.work.moved_scans import ends_of
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.project import places_in, read_project
from pointglass.viewer.work.viewpoint import Viewpoint

MOVED = ((1.0, 0.0, 0.0, 2.5), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
POINTS = PointSet((FileRuns("room.ply", 8, zlib.compress(np.array([2, 3], "<u8").tobytes())),))
"""The third to the fifth of eight."""
CHANGES: dict[str, object] = {
    "hidden_stations": (1,), "up": (0.0, 1.0, 0.0), "viewpoints": (Viewpoint("here", EYE, 60.0),), "look": Look(exposure=1.0),
    "path": CameraPath((Keyframe(0.0, Viewpoint("a", EYE, 60.0)),)), "clips": (BOX,), "measurements": (TAPE,),
    "annotations": (Annotation("a note", (0.0, 0.0, 0.0)),), "lock_measured": True, "ghosts": "dimmed",
    "hidden_classes": (7,), "regions": (Region("wall", POINTS),), "reclassified": (ClassChange(6, POINTS),),
    "selection": POINTS, "meshes": (MeshLayer("model.glb"),),
    "photographs": (PlacedPhotograph("a.jpg", "a", 640, 480, 500.0, MOVED, 0.8, 90, None, (0.1, 0.3), True),),
    "comparison": DateComparison(("before.laz", 8), ("after.laz", 8)),
}  # fmt: skip
"""Another value of each field that a person works on."""


def test_every_field_of_the_document_counts_as_work_but_where_the_camera_stands(window, tmp_path):
    fields = {each.name for each in dataclasses.fields(Document) if "not_stored" not in each.metadata}
    looked_at = {"view", "settings", "background"}
    assert fields == set(CHANGES) | looked_at | {"scans"}, "say here how a new field is changed"
    assert not window.flow.changed and window.flow.title == "points in memory · pointglass"
    for name, value in CHANGES.items():
        window.edit(**{name: value})
        assert window.flow.changed and window.flow.title.startswith("• "), name
        window.session.work.undo()
        assert not window.flow.changed, "undone to what is saved"
    scan = window.session.document.scans[0]
    for each in dataclasses.fields(scan):
        if each.name != "path":
            value = MOVED if each.name == "transform" else other(scan, each.name)
            window.edit(scans=(dataclasses.replace(scan, **{each.name: value}),))
            assert window.flow.changed, each.name
            window.session.work.undo()
    window.session.view_settings.background = "sky"
    assert not window.flow.changed, "a scan that is only looked at has nothing to be saved"
    window.flow.save()
    assert window.session.work.project == tmp_path / "room.pointglass"
    window.session.view_settings.background = "black"
    assert window.flow.changed, "a project holds how it is looked at"
    window.session.view_settings.background = "sky"
    window.session.flight.field_of_view = 20.0
    assert not window.flow.changed, "flying is no change"


def test_what_is_offered_after_a_crash_is_said_in_words_for_all_that_a_person_makes():
    said = {"viewpoints": "1 bookmark", "path": "1 keyframe", "clips": "1 clip", "measurements": "1 measurement",
            "annotations": "1 note", "regions": "1 region", "reclassified": "a new class for 3 points",
            "selection": "3 selected points", "meshes": "1 mesh file", "photographs": "1 placed photograph",
            "comparison": "a comparison of two dates"}  # fmt: skip
    for name, value in CHANGES.items():
        document = dataclasses.replace(Document(), **{name: value})
        text = Recoverable(Path("a.json"), UnsavedWork(document, "", "", "room", 0.0)).text
        assert text == said.get(name, "changed settings of the picture"), name


def test_a_change_after_saving_counts_and_undo_to_the_saved_state_does_not(window):
    window.edit(clips=(BOX,))
    window.flow.save()
    assert not window.flow.changed and window.flow.name == "room.pointglass"
    window.edit(measurements=(TAPE,))
    assert window.flow.changed
    window.session.work.undo()
    assert not window.flow.changed
    window.session.work.undo()
    assert window.flow.changed, "before the saved state"
    window.session.work.redo()
    assert not window.flow.changed


@pytest.mark.parametrize("answer", ("Save", "Discard", "Cancel"))
def test_another_scan_is_opened_after_a_question_only(window, tmp_path, answer):
    other_scan = tmp_path / "other.ply"
    other_scan.touch()
    window.edit(measurements=(TAPE,))
    window.open(other_scan)
    assert window.asked == "Save the changes to points in memory?"
    assert window.session.document.measurements == (TAPE,) and window.session.loads.current is None
    window.answer(answer)
    if answer == "Cancel":
        assert window.session.document.measurements == (TAPE,) and window.flow.changed
        return
    assert window.session.document.scans[0].path == str(other_scan) and not window.flow.changed
    saved = tmp_path / "room.pointglass"
    assert saved.exists() == (answer == "Save")
    if answer == "Save":
        assert read_project(saved).measurements == (TAPE,)


def test_saving_while_asked_whether_to_save_answers_the_question(window, tmp_path):
    """Ctrl+S with the question of Ctrl+Q open: the work is saved and the window ends; no question of saved work stays."""
    left = []
    window.edit(measurements=(TAPE,))
    window.flow.leave(lambda: left.append("left"))
    assert window.asked.startswith("Save the changes")
    window.flow.save()
    window.session.notices.take_answer()
    assert not window.asked and left == ["left"] and read_project(tmp_path / "room.pointglass").measurements == (TAPE,)
    window.edit(measurements=())
    window.session.notices.ask("Another question?", "", ())
    window.flow.save()
    assert window.asked == "Another question?" and not window.flow.changed and left == ["left"]


def test_a_change_made_while_another_scan_loads_is_asked_about_again(window, tmp_path):
    other_scan = tmp_path / "other.ply"
    other_scan.touch()
    window.edit(measurements=(TAPE,))
    window.flow.leave(lambda: window.session.open([other_scan]))
    message = window.session.notices.message
    window.session.notices.answer([each.label for each in message.answers].index("Discard"))
    window.session.notices.take_answer()
    window.edit(clips=(BOX,))  # before the scan has come
    window.take()
    assert window.asked and window.session.document.clips == (BOX,)
    window.answer("Cancel")
    assert window.session.document.clips == (BOX,) and window.session.document.measurements == (TAPE,)


def test_work_that_was_given_up_stays_where_the_other_scan_cannot_be_opened(window, tmp_path):
    window.edit(measurements=(TAPE,))
    window.open(tmp_path / "bad.pointglass")
    window.answer("Discard")
    assert "cannot be opened" in window.asked and window.session.document.measurements == (TAPE,) and window.flow.changed
    window.flow.close()  # the process is stopped, by a logout for instance
    (found,) = recoverable()
    assert found.unsaved.document.measurements == (TAPE,), "Discard was for the scan that did not come"


def test_work_that_was_given_up_for_the_end_of_the_window_leaves_no_autosave(window):
    window.edit(measurements=(TAPE,))
    window.flow.follow()
    window.flow.end([], lambda: None)
    window.answer("Discard")
    window.flow.close()
    assert recoverable() == []


def test_other_marks_keep_the_document_also_after_a_project_that_could_not_be_loaded(window, tmp_path):
    window.flow.save()
    window.edit(measurements=(TAPE,))
    window.session.work.begin([tmp_path / "room.pointglass"])  # its load was cancelled
    window.session.accept(window.session.shown_scan.variant(SCENE))
    assert window.session.document.measurements == (TAPE,)


def test_what_was_done_in_the_preview_stays_when_all_points_have_come(window, tmp_path):
    scan = tmp_path / "large.ply"
    window.session.work.begin([scan])
    window.session.accept(Loaded(SCENE, SURVEY, (scan,), preview=True))
    window.edit(measurements=(TAPE,))
    window.session.accept(Loaded(SCENE, SURVEY, (scan,), follows_preview=True))
    assert window.session.document.measurements == (TAPE,) and window.session.document.scans[0].path == str(scan)


def test_saving_a_new_project_never_replaces_a_file_and_asks_where_it_cannot_be_written(window, tmp_path):
    existing = tmp_path / "room.pointglass"
    existing.write_text("somebody's")
    window.edit(clips=(BOX,))
    window.flow.save()
    assert window.files.choice is not None and existing.read_text() == "somebody's" and window.flow.changed
    window.files.close()
    assert window.flow.changed, "cancelled"


def test_a_save_that_fails_says_so_in_one_line_and_keeps_the_work_unsaved(window, tmp_path):
    window.edit(clips=(BOX,))
    left = []
    window.flow._write(tmp_path / "gone" / "room.pointglass", lambda: left.append(1))
    message = window.session.notices.message
    assert message.title == "The project was not saved" and "\n" not in message.text and "room.pointglass" in message.text
    assert window.flow.changed and window.session.work.project is None and left == []


def test_a_project_that_another_window_has_saved_is_not_replaced_without_a_question(window, tmp_path):
    window.edit(clips=(BOX,))
    window.flow.save()
    project = tmp_path / "room.pointglass"
    second = Window(tmp_path)
    second.open(project)
    second.edit(measurements=(TAPE,))
    second.flow.save()
    assert not second.asked
    window.edit(annotations=(Annotation("mine", (0.0, 0.0, 0.0)),))
    window.flow.save()
    assert window.asked == "Replace the project?" and read_project(project).measurements == (TAPE,)
    window.answer("Cancel")
    assert window.flow.changed and read_project(project).measurements == (TAPE,)
    window.flow.save()
    window.answer("Replace")
    assert not window.flow.changed and read_project(project).annotations[0].text == "mine"
    second.flow.autosave.close(keep=False)
    second.session.close()


def test_a_project_that_appears_while_points_are_read_is_not_replaced_without_a_question(window, tmp_path, monkeypatch):
    project = tmp_path / "room.pointglass"
    window.edit(measurements=(TAPE,))
    for there in ("", "saved by another window", "saved by another window again"):
        with monkeypatch.context() as reading:
            reading.setattr(ExactPoints, "busy", True)
            window.flow.save()
            assert not window.asked, "it waits"
            project.write_text(there) if there else project.unlink(missing_ok=True)
        window.flow.follow()
        if there:
            assert window.asked == "Replace the project?" and project.read_text() == there and window.flow.changed
            window.answer("Cancel")
            assert window.flow.changed and project.read_text() == there
            project.unlink()
        else:
            assert not window.asked and not window.flow.changed
            project.unlink()
            window.edit(clips=(BOX,))


def test_a_scan_that_is_opened_again_is_seen_from_where_it_was_left_and_its_project_is_offered(window, tmp_path):
    from pointglass.viewer.window.session.recent import last_view, recent_scans

    home = window.session.flight.home
    window.session.flight.state = dataclasses.replace(home, position=home.position + 0.25, yaw=home.yaw + 0.5)
    window.session.flight.field_of_view = 40.0
    left = window.session.camera
    window.flow.remember(None)
    view = last_view([window.scan])
    assert view is not None and last_view([tmp_path / "other.ply"]) is None
    window.edit(clips=(BOX,))
    window.flow.save()
    window.flow.remember(None)
    assert [Path(path).name for path in recent_scans()[0].paths] == ["room.pointglass"], "the project, not its scan alone"
    offers = window.session.shown_scan.notices(window.session.document, window.session.work.project)
    assert not any(isinstance(one.offer, OpenProject) for one in offers), "it is open: a scan that was moved is read again"
    window.session.close_scene()
    window.session.open([window.scan], view=view)
    window.take()
    assert window.session.camera.camera_to_world == pytest.approx(left.camera_to_world)
    assert window.session.camera.fy == pytest.approx(left.fy)
    assert window.session.flight.home.position == pytest.approx(home.position), "Home is the start viewpoint"
    offer = next(notice for notice in window.session.notices.of_scan if isinstance(notice.offer, OpenProject))
    act_on_notice(window.session, offer.offer)
    window.take()
    assert window.session.work.project == tmp_path / "room.pointglass" and window.session.document.clips == (BOX,)


@pytest.mark.parametrize("points", (1, 3))
def test_a_measurement_that_is_not_ended_is_left_after_a_question_only(window, points):
    """One rule for closing the window or the scan, opening and dropping files: all of them call leave."""
    left, work = [], window.session.work
    work.begun = begun = Begun("area", tuple(MeasuredPoint((float(x), 0.0, 0.0)) for x in range(points)))
    window.flow.follow()
    window.flow.leave(lambda: left.append("unchanged"))
    assert window.asked == "Give up the measurement that is not ended?" and not left
    assert f"{points} point" in window.session.notices.message.text
    window.answer("Go on")
    assert not left and work.begun == begun
    window.edit(clips=(BOX,))
    window.flow.leave(lambda: left.append("saved"))
    assert "area that is not ended" in window.session.notices.message.text
    window.answer("Save")
    assert left == ["saved"] and not window.flow.changed, "one question has said what a project does not keep"
    window.edit(clips=())
    window.flow.leave(lambda: left.append("discarded"))
    window.answer("Discard")
    assert left == ["saved", "discarded"], "asked once"


def test_a_window_with_unfinished_work_ends_after_a_question_only(window):
    ended = []
    window.edit(measurements=(TAPE,))
    window.flow.end(["A film is being rendered."], lambda: ended.append(1))
    assert window.asked == "Close the window?" and "film" in window.session.notices.message.text
    window.answer("Go on")
    assert ended == [] and not window.asked, "who goes on is not asked to save"
    window.flow.end(["A film is being rendered."], lambda: ended.append(1))
    window.answer("Close")
    assert ended == [] and window.asked.startswith("Save the changes")
    window.answer("Discard")
    assert ended == [1]
    window.flow.end([], lambda: ended.append(2))
    window.answer("Discard")
    assert ended == [1, 2]


def test_a_project_does_not_take_a_file_that_replaced_its_scan_without_a_word(window, tmp_path):
    """Saving keeps the size and checksum of the scan that was loaded; opening tells that another file is there, and saving then
    takes it: a scan that was edited on purpose is told once."""
    window.scan.write_bytes(b"the scan")
    window.open(window.scan)  # again, as it is now
    assert window.asked == "A scan is another file than before"
    window.session.notices.say_also("Another matter", "of which nothing is lost")
    text = window.session.notices.message.text
    assert "room.ply: It has 8 bytes" in text and "of which nothing is lost" in text
    window.session.notices.message = None
    loaded = ends_of(window.scan)
    window.edit(measurements=(TAPE,))
    window.scan.write_bytes(b"another file, and longer")
    window.flow.save()
    project = tmp_path / "room.pointglass"
    (place,) = places_in(project).values()
    assert (place.size, place.ends) == (8, loaded)
    for told in (True, False):
        again = Window(tmp_path)
        again.open(project)
        assert again.session.document.measurements == (TAPE,)
        assert again.asked == ("A scan is another file than before" if told else "")
        if told:
            assert "room.ply: It has 24 bytes; the scan of the project had 8." in again.session.notices.message.text
            again.session.notices.message = None
            again.edit(clips=(BOX,))
            again.flow.save()
            (place,) = places_in(project).values()
            assert place.ends == ends_of(window.scan)
        again.flow.autosave.close(keep=False)
        again.session.close()
