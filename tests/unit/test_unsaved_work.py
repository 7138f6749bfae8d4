"""Work is never lost without a question: what counts as changed, saving, leaving, autosave, and what a killed process left."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_picture_spec import other
from window_session import room

from pointglass.viewer.settings import Settings
from pointglass.viewer.tools.clip import Box
from pointglass.viewer.tools.document import Annotation, CameraPath, Document, Keyframe, Viewpoint
from pointglass.viewer.tools.look import Look
from pointglass.viewer.tools.measure import MeasuredPoint, Measurement
from pointglass.viewer.tools.project import read_project
from pointglass.viewer.window import autosave as module
from pointglass.viewer.window.autosave import Autosave, UnsavedWork, read_unsaved
from pointglass.viewer.window.file_dialog.file_dialogs import FileDialogs
from pointglass.viewer.window.loading import Loaded
from pointglass.viewer.window.project_flow import ProjectFlow
from pointglass.viewer.window.recovery import recoverable
from pointglass.viewer.window.scan_notice_actions import act_on_notice
from pointglass.viewer.window.session import Session
from pointglass.viewer.window.start_viewpoint import survey

SCENE = room(points=2_000)
SURVEY = survey(SCENE)
EYE = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
BOX = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
TAPE = Measurement("distance", tuple(MeasuredPoint((x, 0.0, 0.0), 0.01, 0.0) for x in (0.0, 1.0)), "Distance")
CHANGES: dict[str, object] = {
    "hidden_stations": (1,), "up": (0.0, 1.0, 0.0), "viewpoints": (Viewpoint("here", EYE, 60.0),), "look": Look(exposure=1.0),
    "path": CameraPath((Keyframe(0.0, Viewpoint("a", EYE, 60.0)),)), "clips": (BOX,), "measurements": (TAPE,),
    "annotations": (Annotation("a note", (0.0, 0.0, 0.0)),), "lock_measured": True, "ghosts": "dimmed",
}  # fmt: skip
"""Another value of each field that a person works on."""


class Window:
    """What a window has besides its picture."""

    def __init__(self, folder: Path):
        self.session = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None,
                               open_scene=lambda paths: SCENE)
        self.files = FileDialogs()
        self.files.prefer_window(True)
        self.flow = ProjectFlow(self.session, self.files, lambda: None)
        self.scan = folder / "room.ply"
        self.scan.touch()

    def open(self, *paths: Path) -> None:
        self.flow.leave(lambda: self.session.open(list(paths)))
        self.take()

    def take(self) -> None:
        """Takes what is being loaded, as the window does."""
        while (current := self.session.loads.current) is not None:
            assert current.join(20.0)
            loaded = self.session.poll()
            if loaded is not None and self.flow.may_replace(loaded):
                self.session.accept(loaded)
            elif loaded is not None:
                self.flow.leave(lambda loaded=loaded: self.session.accept(loaded))
        self.flow.follow()

    def answer(self, label: str) -> None:
        message = self.session.notices.message
        assert message is not None, "nothing is asked"
        self.session.notices.answer([answer.label for answer in message.answers].index(label))
        self.session.notices.take_answer()
        self.take()

    @property
    def asked(self) -> str:
        return self.session.notices.message.title if self.session.notices.message is not None else ""

    def edit(self, **changes) -> None:
        self.session.work.edit("change", **changes)
        self.flow.follow()


@pytest.fixture
def window(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path / "state"))
    monkeypatch.setattr(module, "PAUSE_S", 0.05)
    made = Window(tmp_path)
    made.open(made.scan)
    yield made
    made.flow.autosave.close(keep=False)
    made.session.close()


def autosaves(folder: Path) -> list[Path]:
    return sorted((folder / "state" / "autosave").glob("[!.]*.json"))


def held(file: Path) -> Document:
    """The document in an autosave."""
    found = read_unsaved(file)
    assert found is not None
    return found.document


def until(condition, seconds: float = 20.0):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


def test_every_field_of_the_document_counts_as_work_but_where_the_camera_stands(window, tmp_path):
    fields = {each.name for each in dataclasses.fields(Document)}
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
            window.edit(scans=(dataclasses.replace(scan, **{each.name: other(scan, each.name)}),))
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


def test_other_marks_keep_the_document_also_after_a_project_that_could_not_be_loaded(window, tmp_path):
    window.flow.save()
    window.edit(measurements=(TAPE,))
    window.session.work.begin([tmp_path / "room.pointglass"])  # its load was cancelled
    window.session.accept(window.session.visit.variant(SCENE))
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


def test_the_autosave_holds_what_is_not_saved_and_goes_when_it_is(window, tmp_path):
    window.edit(measurements=(TAPE,))
    (file,) = until(lambda: autosaves(tmp_path))
    assert held(file).measurements == (TAPE,)
    assert held(file).scans[0].path == str(window.scan)
    window.edit(clips=(BOX,))
    until(lambda: held(file).clips == (BOX,))
    assert autosaves(tmp_path) == [file] and recoverable() == [], "its window is open"
    window.flow.save()
    window.flow.follow()
    until(lambda: not list((tmp_path / "state" / "autosave").iterdir()))


def test_a_full_disk_is_said_once_and_the_autosave_is_tried_again(window, tmp_path, monkeypatch):
    def full(path, text):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "RETRY_S", 0.05)
    with monkeypatch.context() as patch:
        patch.setattr(module, "write_durably", full)
        window.edit(measurements=(TAPE,))
        until(lambda: window.flow.autosave.problem)
        window.flow.follow()
        window.flow.follow()
        told = [toast.text for toast in window.session.notices.toasts if "No space left" in toast.text]
        assert len(told) == 1 and window.flow.changed
    until(lambda: autosaves(tmp_path))
    until(lambda: not window.flow.autosave.problem)


KILLED = """
import sys, time
from pathlib import Path
sys.path[:0] = sys.argv[2:]
import test_unsaved_work as tests
tests.module.PAUSE_S = 0.0
made = tests.Window(Path(sys.argv[1]))
made.open(made.scan)
number = 0
while True:
    number += 1
    made.edit(annotations=(tests.Annotation(str(number), (0.0, 0.0, 0.0)),) * 200)
    for file in tests.autosaves(Path(sys.argv[1])):
        print(tests.json.loads(file.read_text())["document"]["annotations"][0]["text"], flush=True)
    if number % 40 == 0:
        made.flow.save()
        print("saved", number, flush=True)
    time.sleep(0.001)
"""


def killed(folder: Path, seconds: float) -> list[str]:
    """Lets a process edit, autosave and save until it is killed.  Returns the lines that it printed."""
    here = Path(__file__).resolve().parent
    environment = os.environ | {"POINTGLASS_STATE": str(folder / "state"), "PYTHONPATH": str(here.parents[1])}
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(folder), str(here)], env=environment, text=True,
                               stdout=subprocess.PIPE)
    assert process.stdout is not None
    lines = [process.stdout.readline()]
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    lines += process.stdout.readlines()
    process.wait()
    return [line.strip() for line in lines if line.endswith("\n")]


def left_behind(folder: Path) -> int:
    """The last edit that is on disk, in the project or in an autosave."""
    numbers = [0]
    if (project := folder / "room.pointglass").exists():
        numbers += [int(note.text) for note in read_project(project).annotations[:1]]
    numbers += [int(found.unsaved.document.annotations[0].text) for found in recoverable()]
    return max(numbers)


def test_a_killed_window_leaves_at_least_its_last_autosave(tmp_path, monkeypatch, seed):
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.setenv("POINTGLASS_STATE", str(folder / "state"))
        lines = killed(folder, 0.2 + 0.13 * ((seed + number) % 7))
        told = [int(line.removeprefix("saved ")) for line in lines]
        assert told and left_behind(folder) >= max(told)


def test_restored_work_is_unsaved_and_its_autosave_goes_on(window, tmp_path):
    left = Autosave()
    document = dataclasses.replace(window.session.document, measurements=(TAPE,))
    left.follow(UnsavedWork(document, title="room.ply"))
    left.close(keep=True)
    (file,) = autosaves(tmp_path)
    window.flow.look_for_offers()
    window.flow.follow()
    assert window.asked == "Restore unsaved work of room.ply?"
    assert "1 measurement" in window.session.notices.message.text
    window.answer("Restore")
    assert window.session.document.measurements == (TAPE,) and window.flow.changed
    window.edit(clips=(BOX,))
    until(lambda: held(file).clips == (BOX,))
    assert autosaves(tmp_path) == [file] and window.flow.offers == []
    window.session.work.undo()
    window.session.work.undo()
    assert not window.flow.changed and window.session.document.measurements == ()


def test_offers_are_made_once_and_discarded_only_after_a_question(window, tmp_path):
    left = Autosave()
    left.follow(UnsavedWork(dataclasses.replace(window.session.document, measurements=(TAPE,)), title="room.ply"))
    left.close(keep=True)
    window.flow.look_for_offers()
    window.flow.follow()
    window.answer("Later")
    window.flow.follow()
    assert not window.asked and len(window.flow.offers) == 1
    window.flow.ask_to_discard(window.flow.offers[0])
    window.answer("Keep")
    assert len(autosaves(tmp_path)) == 1
    window.flow.ask_to_discard(window.flow.offers[0])
    window.answer("Discard")
    assert autosaves(tmp_path) == [] and window.flow.offers == []


@pytest.mark.parametrize("text", ("", "{", "[" * 100_000, "{}", '{"pointglass_autosave": 1}', "null", "\x00\xff",
                                  json.dumps({"pointglass_autosave": 1, "title": 3, "time": 0, "project": "", "digest": "",
                                              "document": {}})))
def test_a_damaged_autosave_is_set_aside(tmp_path, monkeypatch, text):
    monkeypatch.setenv("POINTGLASS_STATE", str(tmp_path / "state"))
    folder = tmp_path / "state" / "autosave"
    folder.mkdir(parents=True)
    (folder / "a.json").write_text(text, "latin-1")
    assert recoverable() == [] and (folder / "a.json.unreadable").exists() and recoverable() == []


def test_a_scan_that_is_opened_again_is_seen_from_where_it_was_left_and_its_project_is_offered(window, tmp_path):
    from pointglass.viewer.window.recent import last_view, recent_scans

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
    window.session.close_scene()
    window.session.open([window.scan], view=view)
    window.take()
    assert window.session.camera.camera_to_world == pytest.approx(left.camera_to_world)
    assert window.session.camera.fy == pytest.approx(left.fy)
    assert window.session.flight.home.position == pytest.approx(home.position), "Home is the start viewpoint"
    offer = next(notice for notice in window.session.notices.of_scan if notice.label == "Open it")
    act_on_notice(window.session, offer.action)
    window.take()
    assert window.session.work.project == tmp_path / "room.pointglass" and window.session.document.clips == (BOX,)


def test_a_window_with_unfinished_work_ends_after_a_question_only(window):
    ended = []
    window.flow.leave(lambda: window.flow.end(["A film is being rendered."], lambda: ended.append(1)))
    assert window.asked == "Close the window?" and "film" in window.session.notices.message.text
    window.answer("Go on")
    assert ended == []
    window.flow.end(["A film is being rendered."], lambda: ended.append(1))
    window.answer("Close")
    window.flow.end([], lambda: ended.append(2))
    assert ended == [1, 2]
