"""Autosave: what is not saved is on disk, goes when it is saved, and is offered after a crash or a kill."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from work_window import BOX, TAPE, Window, work_window  # noqa: F401  (a fixture)

from pointglass.viewer.window.session import autosave as module
from pointglass.viewer.window.session.autosave import Autosave, UnsavedWork, read_unsaved
from pointglass.viewer.window.session.recovery import recoverable
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.project import read_project


def autosaves(folder: Path) -> list[Path]:
    return sorted((folder / "state" / "autosave").glob("[!.]*.json"))


def held(file: Path) -> Document:
    """The document in an autosave."""
    found = read_unsaved(file)
    assert found is not None
    return found.document


def until(condition, seconds: float = 90.0):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


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


def test_an_autosave_whose_folder_is_moved_away_is_written_again_and_stays_locked(window, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "RETRY_S", 0.05)
    window.edit(measurements=(TAPE,))
    until(lambda: autosaves(tmp_path))
    os.rename(tmp_path / "state", tmp_path / "moved")
    (file,) = until(lambda: autosaves(tmp_path))  # without a further change
    assert held(file).measurements == (TAPE,)
    assert recoverable() == [], "its window is open"
    window.flow.autosave.close(keep=True)
    assert [found.file for found in recoverable()] == [file]


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
import test_autosave as tests
from pointglass.viewer.work.notes.annotation import Annotation
tests.module.PAUSE_S = 0.0
made = tests.Window(Path(sys.argv[1]))
made.open(made.scan)
number = 0
while True:
    number += 1
    made.edit(annotations=(Annotation(str(number), (0.0, 0.0, 0.0)),) * 200)
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
    environment = os.environ | {"POINTGLASS_STATE": str(folder / "state"), "PYTHONPATH": str(here.parents[2])}
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(folder), str(here), str(here.parent)], env=environment,
                               text=True, stdout=subprocess.PIPE)
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


def test_restored_work_that_is_saved_is_not_offered_again_after_a_full_disk(window, tmp_path, monkeypatch):
    left = Autosave()
    left.follow(UnsavedWork(dataclasses.replace(window.session.document, measurements=(TAPE,)), title="room.ply"))
    left.close(keep=True)
    (file,) = autosaves(tmp_path)

    def full(path, text):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "write_durably", full)
    window.flow.look_for_offers()
    window.flow.follow()
    window.answer("Restore")
    window.edit(clips=(BOX,))
    until(lambda: window.flow.autosave.problem)
    assert held(file).measurements == (TAPE,), "what was there before stays until it is saved"
    window.flow.save()
    window.flow.follow()
    window.flow.close()
    assert not autosaves(tmp_path) and not window.flow.changed


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
