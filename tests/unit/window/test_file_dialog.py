"""The file dialog without a window: names, paths, endings, questions, folders that cannot be listed, what is remembered."""

import json
import os
import threading
import time
from pathlib import Path

import pytest

from pointglass.viewer.window.file_dialog import file_dialogs, folder_list
from pointglass.viewer.window.file_dialog.chosen_path import pasted
from pointglass.viewer.window.file_dialog.file_choice import FileChoice, Request
from pointglass.viewer.window.file_dialog.file_dialogs import FileDialogs
from pointglass.viewer.window.file_dialog.folder_list import natural, size_text

SCANS = {"Scans": (".laz", ".e57"), "All files": ()}


@pytest.fixture(autouse=True)
def state(tmp_path_factory, monkeypatch):
    """No remembered folders, and no dialog of the system."""
    folder = tmp_path_factory.mktemp("state")
    monkeypatch.setenv("POINTGLASS_STATE", str(folder))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    return folder


@pytest.fixture
def folder(tmp_path):
    for name in ("scan 10.laz", "scan 9.laz", "Scan 2.E57", "notes.txt", ".hidden.laz"):
        (tmp_path / name).write_bytes(b"x" * len(name))
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "inside.laz").write_bytes(b"y")
    return tmp_path


def made(folder, kind="open", **how):
    how.setdefault("endings", SCANS)
    choice = FileChoice(Request("test", "Test", kind, how.pop("done", print), **how), [Path(folder)])
    wait(choice)
    return choice


def wait(choice):
    choice.listing.join(60.0)
    end = time.monotonic() + 60
    choice.follow()
    while choice.waiting and time.monotonic() < end:
        time.sleep(0.002)
        choice.follow()
    assert not choice.waiting
    choice.listing.join(60.0)


def names(choice):
    return [entry.name for entry in choice.rows]


def test_folders_come_first_and_numbers_count(folder):
    choice = made(folder)
    assert names(choice) == ["deeper", "Scan 2.E57", "scan 9.laz", "scan 10.laz"]
    choice.kind = 1
    assert "notes.txt" in names(choice) and ".hidden.laz" not in names(choice)
    choice.hidden = True
    assert ".hidden.laz" in names(choice)
    choice.hidden, choice.order, choice.descending = False, "size", True
    assert names(choice)[:2] == ["deeper", "scan 10.laz"]


def test_the_selected_row_stays_selected_in_another_order(folder):
    choice = made(folder)
    choice.select(names(choice).index("scan 9.laz"))
    choice.descending = True
    assert names(choice)[choice.cursor] == "scan 9.laz"
    choice.hidden, choice.order = True, "size"
    assert names(choice)[choice.cursor] == "scan 9.laz"
    choice.filter = "10"
    assert names(choice) == ["scan 10.laz"] and choice.cursor == -1


def test_typing_searches_completes_and_enters_folders(folder):
    choice = made(folder)
    choice.type("sc")
    assert names(choice) == ["Scan 2.E57", "scan 9.laz", "scan 10.laz"]
    choice.type("scan 9")
    choice.complete()
    assert choice.text == "scan 9.laz"
    choice.type("dee")
    choice.complete()
    assert choice.text == "deeper/"
    choice.listing.join(60.0)
    assert names(choice) == ["inside.laz"]
    choice.move(1)
    choice.enter()
    wait(choice)
    assert choice.result == [folder / "deeper" / "inside.laz"]


@pytest.mark.parametrize(("typed", "chosen"),
                         [("9.l", "scan 9.laz"), ("scan 2", "Scan 2.E57"), ("deeper/in", "deeper/inside.laz")])
def test_enter_chooses_the_only_file_that_a_search_has_left(folder, typed, chosen):
    choice = made(folder)
    choice.type(typed)
    choice.listing.join(60.0)
    choice.enter()
    wait(choice)
    assert choice.result == [folder / chosen] and choice.problem == ""


def test_enter_chooses_none_of_several_that_a_search_has_left(folder):
    choice = made(folder)
    choice.type("sc")
    choice.enter()
    wait(choice)
    assert choice.result is None and choice.problem.endswith("sc: it does not exist")


def test_a_pasted_path_is_understood(folder):
    there = folder / "scan 9.laz"
    for text in (str(there), f"'{there}'", f' "{there}" ', there.as_uri(), str(folder / "deeper" / ".." / "scan 9.laz")):
        choice = made("/")
        choice.type(text)
        choice.enter()
        wait(choice)
        assert choice.result == [there], text
    assert pasted("~") == "~"


def test_an_address_is_chosen_as_it_is_where_scans_are_asked_for(folder):
    for addresses in (True, False):
        choice = made(folder, addresses=addresses)
        choice.type("'https://there/deeper/scan 9?a=1'")
        choice.complete()
        assert len(names(choice)) == 4, "the folder stays listed"
        choice.enter()
        wait(choice)
        assert choice.result == ([Path("https://there/deeper/scan 9?a=1")] if addresses else None)
        assert addresses or "only scans are read from addresses" in choice.problem


@pytest.mark.parametrize("kind", ("save", "open"))
def test_home_and_dots_go_to_a_folder_and_name_no_file(folder, monkeypatch, kind):
    monkeypatch.setenv("HOME", str(folder / "deeper"))
    for text, there in (("~", folder / "deeper"), (".", folder), ("..", folder.parent), ("deeper/..", folder),
                        ("deeper/.", folder / "deeper"), ("~/..", folder)):
        choice = made(folder, kind=kind)
        choice.type(text)
        choice.enter()
        assert choice.folder == there and choice.result is None and not choice.waiting, text


def test_what_cannot_be_opened_is_said_in_words(folder):
    choice = made(folder)
    choice.enter()
    assert "Select a file" in choice.problem
    choice.type("gone.laz")
    choice.enter()
    wait(choice)
    assert choice.problem.endswith("gone.laz: it does not exist") and choice.result is None
    choice.type("/no such folder/a")
    choice.listing.join(60.0)
    assert choice.listing.problem == "/no such folder: it does not exist"
    choice.type("deeper")
    choice.enter()
    wait(choice)
    assert choice.result is None and choice.folder == folder / "deeper"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every folder")
def test_a_folder_without_permission_is_said_in_words(folder):
    (folder / "deeper").chmod(0)
    try:
        choice = made(folder / "deeper")
        assert "permission" in choice.listing.problem
    finally:
        (folder / "deeper").chmod(0o700)


def test_several_files_are_chosen(folder):
    choice = made(folder, many=True)
    choice.select(1)
    choice.select(3, span=True)
    choice.select(2, toggle=True)
    choice.accept()
    wait(choice)
    assert choice.result == [folder / "Scan 2.E57", folder / "scan 10.laz"]


def test_saving_adds_the_ending_and_asks_before_it_replaces(folder):
    csv = {"CSV table": (".csv",), "Text": (".txt",)}
    choice = made(folder, "save", name="new.csv", endings=csv)
    choice.type("notes")
    choice.enter()
    wait(choice)
    assert choice.result == [folder / "notes.csv"]
    choice = made(folder, "save", name="new.csv", endings=csv)
    choice.type("notes.txt")
    choice.enter()
    wait(choice)
    assert choice.result is None and choice.question == folder / "notes.txt"
    choice.answer(False)
    assert choice.result is None and choice.question is None
    choice.enter()
    wait(choice)
    choice.answer(True)
    assert choice.result == [folder / "notes.txt"] and (folder / "notes.txt").read_bytes() == b"x" * 9


@pytest.mark.parametrize("text, said", [
    ("no such/a.csv", "there is no such folder"), ("a" * 300 + ".csv", "longer than 255 bytes"), ("", "Type a name"),
    ("a\0b.csv", "null"),
])  # fmt: skip
def test_names_that_cannot_be_saved_are_said_in_words(folder, text, said):
    choice = made(folder, "save", endings={"CSV table": (".csv",)})
    choice.type(text)
    choice.accept()
    wait(choice)
    assert choice.result is None and said in choice.problem


def test_the_suggested_name_stays_where_a_folder_is_typed(folder):
    choice = made(folder, "save", name="new.csv", endings={"CSV table": (".csv",), "All files": ()})
    for text in (f"{folder}/deeper/", "deeper"):
        choice.kind = 1  # where no ending is added
        choice.type(text)
        choice.enter()
        wait(choice)
        assert choice.folder == folder / "deeper" and choice.text == "new.csv"
        choice.up()
        wait(choice)


def test_a_folder_of_pictures_may_be_there_already(folder):
    kinds = {"MP4 video": (".mp4",), "Folder": ("",)}
    choice = made(folder, "save", name="film.mp4", endings=kinds)
    choice.kind = 1
    choice.type("deeper")
    choice.enter()
    wait(choice)
    assert choice.result == [folder / "deeper"]
    choice = made(folder, "save", name="film.mp4", endings=kinds)
    choice.type("deeper")  # as a video: a folder of this name is in the way only with the ending
    choice.enter()
    wait(choice)
    assert choice.result == [folder / "deeper.mp4"]


def test_a_longer_ending_of_the_chosen_kind_is_completed(folder):
    kinds = {"PLY": (".ply",), "Splats": (".splats.ply",), "LAZ": (".laz",)}
    for kind, typed, given in ((1, "x.ply", "x.splats.ply"), (1, "x.PLY", "x.splats.ply"), (1, "x.splats.ply", "x.splats.ply"),
                               (1, "x.laz", "x.laz"), (1, "x", "x.splats.ply"), (0, "x.ply", "x.ply"),
                               (0, "x.splats.ply", "x.splats.ply"), (2, "x.ply", "x.ply")):  # fmt: skip
        choice = made(folder, "save", endings=kinds)
        choice.kind = kind
        choice.type(typed)
        choice.enter()
        wait(choice)
        assert choice.result == [folder / given], (kind, typed)


def test_a_new_folder_is_made_and_entered_or_refused_in_words(folder):
    choice = made(folder, "folder", endings={"All files": ()})
    choice.make_folder("deeper")
    assert "one of this name" in choice.problem
    choice.make_folder("fresh")
    wait(choice)
    choice.accept()
    wait(choice)
    assert choice.result == [folder / "fresh"] and (folder / "fresh").is_dir()


def test_each_purpose_remembers_its_folder_and_a_folder_that_is_gone_is_not_used(folder, state, monkeypatch):
    monkeypatch.chdir(folder)
    chosen = []
    files = FileDialogs()
    files.save("films", "Film", "a.mp4", {"MP4": (".mp4",)}, chosen.append)
    files.choice.type("deeper/a")
    files.choice.enter()
    wait(files.choice)
    files.poll()
    assert chosen == [folder / "deeper" / "a.mp4"] and files.choice is None
    later = FileDialogs()
    later.open("films", "Film", {"MP4": (".mp4",)}, chosen.append)
    wait(later.choice)
    assert later.choice.folder == folder / "deeper"
    later.choice.cancel()
    later.poll()
    assert later.choice is None and len(chosen) == 1
    assert json.loads((state / "folders.json").read_text())["last"] == {"films": str(folder / "deeper")}
    (folder / "deeper" / "inside.laz").unlink()
    (folder / "deeper").rmdir()
    later.open("films", "Film", {"MP4": (".mp4",)}, chosen.append)
    wait(later.choice)
    assert later.choice.folder == folder and not later.choice.listing.problem


def test_what_is_made_of_a_scan_is_saved_beside_it_until_another_folder_is_chosen(folder, state):
    FileDialogs().folders.note("tables", folder)  # of another work
    beside = folder / "deeper"
    files = FileDialogs(scan_folder=lambda: beside)
    assert files.first_folders("tables", saves=True)[0] == beside and files.first_folders("tables")[0] == folder
    files.save("tables", "Table", "a.csv", {"CSV": (".csv",)}, lambda path: None)
    wait(files.choice)
    assert files.choice.folder == beside
    files.choice.type(str(folder / "a"))
    files.choice.enter()
    wait(files.choice)
    files.poll()
    assert files.first_folders("tables", saves=True)[0] == folder


class SystemDialog:
    """The desktop's dialog, closed with an answer."""

    def __init__(self, answer):
        self.answer = answer

    def ready(self, _seconds):
        return True

    def result(self):
        return self.answer


@pytest.mark.parametrize("answer, after, shown", [
    ("", 0.1, True), ("", 3.0, False), ("{}/table", 3.0, True), ("{}/new", 3.0, False),
])  # fmt: skip
def test_the_desktops_dialog_is_helped_where_it_fails_or_an_ending_is_added(folder, monkeypatch, answer, after, shown):
    """One that ends at once could not be shown; one that was asked about "table" did not ask about "table.csv"."""
    (folder / "table.csv").write_text("old")
    now = [100.0]
    monkeypatch.setattr(file_dialogs, "monotonic", lambda: now[0])
    monkeypatch.setattr(file_dialogs, "system_dialog", lambda: True)
    monkeypatch.setattr(file_dialogs, "_system", lambda request, begin: SystemDialog(answer.format(folder)))
    chosen, files = [], FileDialogs()
    files.save("tables", "Table", "a.csv", {"CSV": (".csv",)}, chosen.append)
    now[0] += after
    files.poll()
    assert (files.choice is not None) == shown
    if "table" in answer:
        assert files.choice.question == folder / "table.csv" and not chosen
        files.choice.answer(True)
        files.poll()
        assert chosen == [folder / "table.csv"]
    elif "new" in answer:
        assert chosen == [folder / "new.csv"]


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", '{"last": 3}', '{"last": {"a": 3}, "recent": [1]}', "\xff"])
def test_damaged_memory_counts_as_empty(state, text):
    (state / "folders.json").write_bytes(text.encode("latin-1"))
    folders = FileDialogs().folders
    assert folders.folder_of("a") is None and folders.recent == []


def test_sizes_and_order():
    assert [size_text(size) for size in (None, 5, 1500, 7.9e7, 1.23e10)] == ["", "5 B", "1.5 kB", "79 MB", "12 GB"]
    assert natural("A10b") > natural("a9z") and natural("10") > natural("9")


def test_a_folder_that_does_not_answer_stops_nothing(folder, monkeypatch):
    """A network drive may hang for minutes: the dialog opens at once, and leaves it for another folder."""
    answers, scandir = threading.Event(), os.scandir

    def slow(path):
        if Path(path) == folder:
            assert answers.wait(30.0)
        return scandir(path)

    monkeypatch.setattr(folder_list.os, "scandir", slow)
    choice = FileChoice(Request("test", "Test", "open", print), [folder])
    assert choice.rows == [] and not choice.listing.finished
    choice.type(f"{folder}/deeper/")
    choice.listing.join(60.0)
    assert names(choice) == ["inside.laz"]
    answers.set()
