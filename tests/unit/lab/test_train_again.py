"""Repeated training into one folder: equal facts continue, others are refused, each network has its own checkpoint."""

import json
import shutil

import pytest
import torch
from rooms import make_room
from safetensors import safe_open

from pointglass.model.network.weights import load_weights
from pointglass.viewer.cli import main


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    root = tmp_path_factory.mktemp("data")
    return [make_room(root / name, view=(72, 96), views=1) for name in ("one", "two")]


@pytest.fixture(scope="module")
def trained(rooms, tmp_path_factory):
    """A folder with three steps of the filtered network on the first room."""
    out = tmp_path_factory.mktemp("trained") / "run"
    assert main(_line(out, rooms[0])) == 0
    return out


@pytest.fixture
def run(trained, tmp_path):
    return shutil.copytree(trained, tmp_path / "run")


def _line(out, *more, steps=3):
    return [str(word) for word in ("train", "--quality", "fast", "--batch", 2, "--crop", 32, "--device", "cpu", "--minutes", 0,
                                   "--out", out, "--steps", steps, *more)]  # fmt: skip


def _state(path):
    return load_weights(path)[0].state_dict()


def _notes(path):
    return json.loads(load_weights(path)[1]["notes"])


def _equal(a, b):
    return all(torch.equal(a[k], b[k]) for k in a)


def _contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_a_training_moved_together_with_its_rooms_continues(rooms, tmp_path, capsys):
    """As on a cluster that mounts a job's folder at a different path each time."""
    here, there = tmp_path / "job1", tmp_path / "job2"
    shutil.copytree(rooms[0], here / "one")
    shutil.copytree(rooms[1], tmp_path / "apart" / "one")
    assert main(_line(here / "run", here / "one")) == 0
    here.rename(there)
    assert main(_line(there / "run", there / "one", steps=5)) == 0
    assert torch.load(there / "run" / "fast-filtered" / "checkpoint.pt", weights_only=True)["step"] == 5
    capsys.readouterr()
    assert main(_line(there / "run", tmp_path / "apart" / "one", steps=6)) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and str(here / "one") in message and "choose another --out" in message


@pytest.mark.parametrize("torn", [b"", b"\x80\x04]q\x00."])
@pytest.mark.filterwarnings("error")
def test_an_invalid_checkpoint_gives_one_line(rooms, run, capsys, torn):
    (run / "fast-filtered" / "checkpoint.pt").write_bytes(torn)
    assert main(_line(run, rooms[0], steps=4)) == 2
    message = capsys.readouterr().err
    assert "checkpoint.pt: not a checkpoint of this training" in message and message.count("\n") == 1


@pytest.mark.slow
def test_the_unfiltered_network_trains_separately_in_the_same_folder(rooms, run, tmp_path):
    assert main(_line(run, rooms[0], "--unfiltered")) == 0
    assert main(_line(tmp_path / "alone", rooms[0], "--unfiltered")) == 0
    both = [_state(run / f"fast-{kind}.safetensors") for kind in ("filtered", "unfiltered")]
    assert not _equal(*both) and _equal(both[1], _state(tmp_path / "alone" / "fast-unfiltered.safetensors"))
    assert _notes(run / "fast-unfiltered.safetensors")["pairs"][0].startswith("pairs-unfiltered-0-1 ")
    assert main(_line(run, rooms[0], steps=4)) == 0, "and the filtered one goes on"
    assert [_notes(run / f"fast-{kind}.safetensors")["step"] for kind in ("filtered", "unfiltered")] == [4, 3]


@pytest.mark.parametrize(("other", "message"), [
    (("ONE", "--seed", 77), "--seed 1 (not 77)"), (("ONE", "--batch", 3), "--batch 2 (not 3)"),
    (("ONE", "--rate", 0.1), "--rate 0.001 (not 0.1)"), (("ONE", "--start-from", "WEIGHTS"), "--start-from none (not weights "),
])
def test_other_arguments_are_refused_and_nothing_changes(rooms, run, tmp_path, capsys, other, message):
    shutil.copy(run / "fast-filtered.safetensors", tmp_path / "w.safetensors")
    before = _contents(run)
    names = {"ONE": rooms[0], "WEIGHTS": tmp_path / "w.safetensors"}
    assert main(_line(run, *(names.get(word, word) for word in other), steps=6)) == 2
    error = capsys.readouterr().err
    assert message in error and str(run) in error and "choose another --out" in error and error.count("\n") == 1
    assert before == _contents(run)


@pytest.mark.parametrize(("folders", "message"), [
    (("TWO",), "/one (not /"), (("ONE", "TWO"), "no folder /"), (("/nonexistent/room",), "(not /nonexistent/room)"),
    (("ONE", "--procedural", 1), "--procedural 0 (not 1)"),
])
def test_other_folders_are_refused_by_name(rooms, run, capsys, folders, message):
    names, before = {"ONE": rooms[0], "TWO": rooms[1]}, _contents(run)
    assert main(_line(run, *(names.get(word, word) for word in folders), steps=5)) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and _contents(run) == before


@pytest.mark.slow
def test_a_room_whose_files_have_changed_is_refused_by_name(rooms, tmp_path, capsys):
    """Its pairs belong to the old files; a picture that was added later would silently be ignored."""
    room, run = shutil.copytree(rooms[0], tmp_path / "room"), tmp_path / "room" / "run"
    assert main(_line(run, room)) == 0
    (room / ".hidden").write_text("not data")
    assert main(_line(run, room, steps=4)) == 0, "what lies in --out, and what is hidden, is no data"
    before = _contents(run)
    (room / "view-99.jpg").write_bytes(b"new")
    capsys.readouterr()
    assert main(_line(run, room, steps=5)) == 2
    error = capsys.readouterr().err
    assert f"its pairs were made with other files in {room}; choose another --out" in error and error.count("\n") == 1
    assert before == _contents(run)
    (room / "view-99.jpg").unlink()
    shutil.move(room, tmp_path / "gone")
    assert main(_line(tmp_path / "gone" / "run", room, steps=5)) == 0, "pairs that are there need no room any more"


def test_weights_contain_no_paths(rooms, run):
    with safe_open(str(run / "fast-filtered.safetensors"), "pt") as file:
        header = json.dumps(file.metadata())
    assert str(rooms[0].parent) not in header and str(run.parent) not in header and "/tmp" not in header
    notes = _notes(run / "fast-filtered.safetensors")
    assert notes["sources"] == ["one"] and notes["pairs"][0].startswith("pairs-filtered-0-1 ")
    assert json.loads((run / "fast-filtered" / "config.json").read_text())["sources"] == [str(rooms[0])]


def test_the_same_room_by_another_path_continues(rooms, run, monkeypatch):
    monkeypatch.chdir(rooms[0].parent)
    moved = run.rename(run.with_name("moved"))
    assert main(_line(moved, "one/../one", steps=4)) == 0
    assert _notes(moved / "fast-filtered.safetensors")["step"] == 4


@pytest.mark.slow
def test_incomplete_pairs_of_another_room_are_not_reused(rooms, tmp_path, monkeypatch, capsys):
    from pointglass.model.data import pairs

    build = pairs.build

    def stopped(places, out, **options):
        if out.name.endswith("-2"):
            raise KeyboardInterrupt
        return build(places, out, **options)

    monkeypatch.setattr(pairs, "build", stopped)
    assert main(_line(tmp_path / "run", rooms[0])) == 130
    monkeypatch.setattr(pairs, "build", build)
    assert main(_line(tmp_path / "run", rooms[1])) == 2
    assert "/one (not " in capsys.readouterr().err
    assert main(_line(tmp_path / "run", rooms[0])) == 0


@pytest.mark.parametrize("left", ["other crops", "no facts", "no record", "a checkpoint beside the weights"])
def test_files_of_an_earlier_version_are_refused_and_unchanged(rooms, run, capsys, left):
    path = run / "fast-filtered" / "checkpoint.pt"
    saved = torch.load(path, weights_only=True)
    if left == "no record":
        (run / "pairs-filtered.json").unlink()
    elif left == "a checkpoint beside the weights":
        path.rename(run / path.name)
    elif left == "no facts":
        del saved["made_from"]
    else:
        saved["made_from"] = json.dumps({k: v for k, v in json.loads(saved["made_from"]).items() if k != "crops"})
    if path.is_file():
        torch.save(saved, path)
    before = _contents(run)
    assert main(_line(run, rooms[0], steps=5)) == 2
    error = capsys.readouterr().err
    assert "of an earlier version of pointglass" in error and "choose another --out" in error and error.count("\n") == 1
    assert before == _contents(run)


@pytest.mark.slow
def test_initial_weights_are_identified_by_their_contents(rooms, run, tmp_path, capsys):
    first, same, other = (tmp_path / f"{name}.safetensors" for name in "abc")
    for path in (first, same):
        shutil.copy(run / "fast-filtered.safetensors", path)
    start, out = (rooms[0], "--start-from"), tmp_path / "second"
    assert main(_line(out, *start, first)) == 0 and main(_line(out, *start, same, steps=4)) == 0
    assert main(_line(run, rooms[0], steps=4)) == 0
    shutil.copy(run / "fast-filtered.safetensors", other)
    assert main(_line(out, *start, other, steps=5)) == 2
    assert "--start-from weights " in capsys.readouterr().err
    assert _notes(out / "fast-filtered.safetensors")["step"] == 4
