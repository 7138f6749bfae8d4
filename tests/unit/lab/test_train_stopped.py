"""Training interrupted by Ctrl-C or a kill: no step is lost or repeated, and there is no traceback."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from rooms import make_room

from pointglass.model.common.errors import DataError
from pointglass.model.common.process.interrupts import finish_before_interrupt
from pointglass.model.common.system import STOPS
from pointglass.model.data.pairs import build
from pointglass.model.data.stations import load_scene
from pointglass.model.network.weights import load_weights
from pointglass.model.train import recipes, training_log
from pointglass.model.train import trainer as train
from pointglass.model.train.recipes import RECIPES, Recipe, Stage, follow
from pointglass.model.train.torchrun import Process
from pointglass.model.train.trainer import TrainConfig, Trainer
from pointglass.viewer.cli import main

ROOT = Path(__file__).resolve().parents[3]
TINY = Recipe(0.05, 0.2, (
    Stage("fast", True, 0.5, batch=2, crop=32),
    Stage("fast", False, 0.3, after="fast-filtered", batch=2, crop=32),
))


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    root = tmp_path_factory.mktemp("pairs")
    build([load_scene(make_room(root / "box"))], root / "out", scans=1, variants=2, neighbours=True)
    return root / "out"


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    root = tmp_path_factory.mktemp("rooms")
    return [make_room(root / name / "room", view=(72, 96), views=1) for name in "ab"]


def _config(pairs, out, **changes):
    return TrainConfig(**{"pairs": (str(pairs),), "out": str(out), "quality": "fast", "steps": 8, "batch": 2, "crop": 32,
                          "neighbours": 1, "device": "cpu", **changes})


def _state(path):
    return load_weights(path)[0].state_dict()


@pytest.fixture(scope="module")
def whole(pairs, tmp_path_factory):
    """The weights of an uninterrupted run."""
    return _state(train.train(_config(pairs, tmp_path_factory.mktemp("whole"))))


def _press(number=signal.SIGINT):
    os.kill(os.getpid(), number)


def _step_of(out):
    return torch.load(out / "fast-filtered" / "checkpoint.pt", weights_only=True)["step"]


@pytest.fixture(params=STOPS, ids=["ctrl-c", "sigterm"])
def stop(request):
    """Ctrl-C, or SIGTERM as the command line handles it."""
    before = signal.signal(request.param, signal.default_int_handler)
    yield request.param
    signal.signal(request.param, before)


@pytest.mark.slow
@pytest.mark.parametrize("within", [False, True])
def test_an_interrupt_keeps_every_completed_step(pairs, whole, tmp_path, monkeypatch, within, stop):
    """Between two steps, or within one, which is then completed; the weights equal those of an uninterrupted run."""
    advance = Trainer.advance

    def pressed(self, *rest):
        if within and self.step == 4:
            _press(stop)
        return advance(self, *rest)

    monkeypatch.setattr(Trainer, "advance", pressed)
    with pytest.raises(KeyboardInterrupt):
        train.train(_config(pairs, tmp_path / "run"), on_step=lambda step: _press(stop) if step == 5 and not within else None)
    monkeypatch.undo()
    assert _step_of(tmp_path / "run") == 5 and (tmp_path / "run" / "fast-filtered.safetensors").is_file()
    parts = _state(train.train(_config(pairs, tmp_path / "run")))
    assert all(torch.equal(whole[k], parts[k]) for k in whole)
    assert signal.getsignal(stop) is signal.default_int_handler and not list(tmp_path.rglob("*.partial"))


def test_half_a_step_is_not_saved(pairs, tmp_path, monkeypatch):
    """A second Ctrl-C interrupts a step: the checkpoint stays that of the last complete step."""
    step = torch.optim.AdamW.step

    def twice(self, *rest):
        step(self, *rest)
        if len(list(self.state.values())) and int(next(iter(self.state.values()))["step"]) == 4:
            _press()
            _press()

    monkeypatch.setattr(torch.optim.AdamW, "step", twice)
    with pytest.raises(KeyboardInterrupt):
        train.train(_config(pairs, tmp_path, save_every=0.0))
    assert _step_of(tmp_path) == 3


@pytest.mark.parametrize("stop", [signal.SIGTERM], indirect=True)
def test_repeated_sigterm_waits_for_the_step(stop):
    whole = []
    with pytest.raises(KeyboardInterrupt), finish_before_interrupt():
        _press(stop)
        _press(stop)
        whole.append(True)
    assert whole and signal.getsignal(stop) is signal.default_int_handler


def test_an_error_caused_by_ctrl_c_is_reported_as_ctrl_c():
    with pytest.raises(KeyboardInterrupt), finish_before_interrupt():
        _press()
        raise RuntimeError("the other process is gone")
    with pytest.raises(RuntimeError), finish_before_interrupt():
        raise RuntimeError("something else")


def test_the_log_has_every_step_once_after_a_kill(pairs, tmp_path, monkeypatch):
    monkeypatch.setattr(training_log, "EVERY", 1)

    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    def kill(step):
        if step == 6:
            raise MemoryError

    with pytest.raises(MemoryError):  # nothing was saved: the next call starts again
        train.train(_config(pairs, tmp_path), on_step=kill)
    train.train(_config(pairs, tmp_path, steps=3))
    log = tmp_path / "fast-filtered" / "log.jsonl"
    with log.open("a") as file:
        file.write('{"step": 4, "loss": 1.0}\n{"step": 5, "lo')
    train.train(_config(pairs, tmp_path, steps=5))
    assert [json.loads(line)["step"] for line in log.read_text().splitlines()] == [1, 2, 3, 4, 5]
    board = EventAccumulator(str(log.with_name("tensorboard")))
    board.Reload()
    assert [event.step for event in board.Scalars("loss")] == [1, 2, 3, 4, 5]


@pytest.mark.slow
def test_a_recipe_makes_pairs_of_every_room(rooms, tmp_path):
    """Rooms with the same name, and rooms with two picture sizes in one folder."""
    make_room(tmp_path / "mixed" / "small", view=(72, 96), views=1)
    make_room(tmp_path / "mixed" / "large", view=(80, 112), views=1)
    made = follow(TINY, [*rooms, tmp_path / "mixed"], tmp_path / "run", minutes=0.015, perceptual=None, device="cpu",
                  most_places=0)
    found = {}
    for path in (tmp_path / "run" / "pairs").glob("*/*/pairs.json"):
        shape = train.Crops([path.parent], 32, 1).folders[0].truth.shape
        found.setdefault((path.parents[1].name, path.parent.name[-1]), []).append(shape[2:])
    assert {key: sorted(sizes) for key, sizes in found.items()} == {
        ("filtered", "1"): [(72, 96)] * 3 + [(80, 112)], ("unfiltered", "1"): [(72, 96)] * 3 + [(80, 112)],
        ("filtered", "2"): [(36, 48)] * 3 + [(40, 56)],
    }
    assert len(json.loads(load_weights(made[0])[1]["notes"])["pairs"]) == 8


def test_crops_of_a_recipe_fit_into_its_pictures(tmp_path):
    """Half of a procedural picture is 240 pixels high, less than the GPU recipe's crops of 256."""
    folders = []
    for height in (480, 240):
        folders.append(tmp_path / str(height))
        folders[-1].mkdir()
        for name, channels, kind in (("measured", 6, np.float16), ("truth", 5, np.uint8)):
            np.save(folders[-1] / f"{name}.npy", np.zeros((1, channels, height, 4 * height // 3), kind))
    stage = RECIPES["gpu"].stages[0]
    assert [recipes._crop(stage, some) for some in (folders[:1], folders)] == [256, 240]


@pytest.mark.slow
def test_no_pairs_are_added_once_training_has_begun(rooms, tmp_path, monkeypatch):
    def stopped(_config):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(recipes, "train", stopped)
        with pytest.raises(KeyboardInterrupt):
            follow(TINY, rooms[:1], tmp_path, minutes=0.015, perceptual=None, device="cpu", most_places=0)
    before = sorted(tmp_path.glob("pairs/*/*"))
    monkeypatch.setattr(recipes, "_make_all", lambda *_: pytest.fail("pairs are made again"))
    made = follow(TINY, rooms[:1], tmp_path, minutes=0.03, perceptual=None, device="cpu", most_places=4)
    assert sorted(tmp_path.glob("pairs/*/*")) == before and len(made) == 2


def test_a_resumed_recipe_spends_the_remaining_time_for_pairs(tmp_path, monkeypatch):
    """The first call is interrupted; the second continues with the next place for the rest of the time."""
    clock, given = [0.0], []

    class Pool:
        def submit(self, _leaving, _make, job, out, kinds, seed, _textures):
            from concurrent.futures import Future

            if clock[0] >= stop:
                raise KeyboardInterrupt
            given.append(job.name)
            clock[0] += 10.0
            for *_, folder in job.targets(Path(out), kinds):
                folder.mkdir(exist_ok=True)
            future = Future()
            future.set_result(job.name)
            return future

    from contextlib import nullcontext
    from types import SimpleNamespace

    monkeypatch.setattr(recipes, "workers", lambda _count: nullcontext(Pool()))
    monkeypatch.setattr(recipes, "usable_processors", lambda: 1)
    monkeypatch.setattr(recipes, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    facts, stop = {"seed": 1, "folders": []}, 30.0
    with pytest.raises(KeyboardInterrupt):
        recipes.make_pairs(TINY, [], tmp_path, facts, 50.0, 99)
    assert given == ["place-0", "place-1", "place-2"]
    assert json.loads((tmp_path / "recipe.json").read_text())["most"] == dict.fromkeys(("street", "thing", "room"), 10.0)
    stop, clock[0] = 1e9, 1000.0
    (tmp_path / "pairs" / "filtered" / "place-2-2").rmdir()  # was in progress
    made = recipes.make_pairs(TINY, [], tmp_path, facts, 50.0, 99)
    assert given[3:] == ["place-2", "place-3"] and len(made["filtered"]) == 8
    assert recipes.make_pairs(TINY, [], tmp_path, facts, 500.0, 99) == made and len(given) == 5


def test_a_place_that_would_not_finish_in_time_is_not_begun(tmp_path):
    """A room takes ten times as long as an object; begun in the last minute, it would take the networks' time."""
    clock = [0.0]
    progress = recipes._Progress(tmp_path / "recipe.json", {"pairs": None, "seconds": 0.0})
    progress.spent = lambda: clock[0]  # type: ignore[method-assign]
    assert all(progress.in_time(kind, 100.0) for kind in ("room", "thing"))
    clock[0] = 40.0
    progress.done("room", 0.0)
    progress.done("thing", 35.0)
    progress.done("thing", 39.0)
    told = {at: [kind for kind in ("room", "thing", "new") if progress.in_time(kind, 100.0)]
            for at in (50.0, 60.0, 61.0, 95.0, 96.0) if clock.__setitem__(0, at) is None}
    assert told == {50.0: ["room", "thing", "new"], 60.0: ["room", "thing"], 61.0: ["thing"], 95.0: ["thing"], 96.0: []}
    progress.keep()
    assert json.loads((tmp_path / "recipe.json").read_text())["most"] == {"room": 40.0, "thing": 5.0}


@pytest.mark.slow
def test_another_recipe_or_room_is_refused_and_nothing_changes(rooms, tmp_path):
    def again(out, *folders, seed=1):
        follow(TINY, folders, out, minutes=0.01, perceptual=None, device="cpu", most_places=0, seed=seed)

    again(tmp_path, rooms[0])
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    for message, folders, seed in ((r"a/room \(not .*b/room", rooms[1:], 1), (r"--seed 1 \(not 2\)", rooms[:1], 2)):
        with pytest.raises(DataError, match=message):
            again(tmp_path, *folders, seed=seed)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    (tmp_path / "recipe.json").unlink()
    with pytest.raises(DataError, match="was not made by this recipe"):
        again(tmp_path, rooms[0])


@pytest.mark.slow
@pytest.mark.parametrize(("number", "to"), [(signal.SIGINT, os.killpg), (signal.SIGTERM, os.kill),
                                            pytest.param(signal.SIGTERM, os.killpg, marks=pytest.mark.long)])
def test_a_recipe_interrupted_in_its_first_place_leaves_no_files_and_prints_one_line(tmp_path, number, to):
    """Ctrl-C as a terminal sends it, to every process of the command; SIGTERM to all, or to the main process."""
    line = [sys.executable, "-m", "pointglass.viewer", "train", "--recipe", "night", "--out", str(tmp_path / "rec"),
            "--device", "cpu"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(line, cwd=ROOT, start_new_session=True, **pipes)
    deadline = time.monotonic() + 60
    while not (tmp_path / "rec" / "recipe.json").is_file():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    time.sleep(1.5)
    to(process.pid, number)
    _, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (130, "pointglass: stopped\n") and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_divergence_gives_one_line_and_keeps_the_last_weights(pairs, rooms, tmp_path, capsys, monkeypatch):
    """A step with a gradient of NaN would turn every weight into NaN."""
    train.train(_config(pairs, tmp_path, steps=3))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.suffix in (".safetensors", ".pt")}
    make, made = train.Objective.forward, []

    def broken(self, *given):
        loss, terms = make(self, *given)
        made.append(loss)
        return loss * (float("nan") if len(made) == 2 else 1.0), terms

    monkeypatch.setattr(train.Objective, "forward", broken)
    with pytest.raises(DataError, match=r"step 5 \(loss nan\); the weights of step 3 are kept; choose a lower --rate"):
        train.train(_config(pairs, tmp_path, steps=9, save_every=1e9))
    assert len(before) == 2 and all(path.read_bytes() == content for path, content in before.items())
    monkeypatch.undo()
    assert main(["train", str(rooms[0]), "--out", str(tmp_path / "wild"), "--quality", "fast", "--batch", "2", "--crop", "32",
                 "--device", "cpu", "--steps", "60", "--rate", "1e6"]) == 2
    error = capsys.readouterr().err
    assert "training diverged" in error and error.count("\n") == 1
    assert not (tmp_path / "wild" / "fast-filtered.safetensors").exists()


def test_weights_beyond_half_precision_are_not_written(tmp_path):
    trainer = Trainer(TrainConfig((), str(tmp_path), quality="fast", device="cpu"), Process(0, 1, torch.device("cpu")))
    trainer.config.state.mkdir()
    with torch.no_grad():
        trainer.averaged.get_parameter("stem.bias")[0] = 1e5
    with pytest.raises(DataError, match=r"stem\.bias has values beyond half precision"):
        trainer.save(tmp_path / "fast-filtered.safetensors", {}, {})
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_log_has_the_means_of_its_steps(tmp_path, monkeypatch):
    monkeypatch.setattr(training_log, "EVERY", 4)
    with training_log.TrainingLog(tmp_path, 0, shown=True) as log:
        for step in range(1, 9):
            log.step(step, {"loss": torch.tensor(float(step))}, 0.1, float(step))
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [(line["step"], line["loss"]) for line in lines] == [(4, 2.5), (8, 6.5)]
