"""Training runs: exact resume after a kill, equality of one and two processes, what is logged."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from pointglass.model.common.errors import DataError
from pointglass.model.data.crops import Crops
from pointglass.model.network.unet import PaperUNet
from pointglass.model.network.weights import load_weights
from pointglass.model.train.objective import Objective
from pointglass.model.train.trainer import Process, TrainConfig, Trainer, train
from pointglass.model.train.training_log import PICTURES_EVERY, TrainingLog

ROOT = Path(__file__).resolve().parents[3]


def _config(pairs, out, **changes):
    return TrainConfig(**{"pairs": (str(pairs),), "out": str(out), "quality": "fast", "steps": 8, "batch": 2, "crop": 32,
                          "neighbours": 1, "save_every": 0.0, "device": "cpu", **changes})


def _state(path):
    return load_weights(path)[0].state_dict()


class _Killed(Exception):
    pass


@pytest.mark.slow
def test_training_resumes_exactly_after_a_kill(pairs, tmp_path):
    whole = _state(train(_config(pairs, tmp_path / "whole")))

    def kill(step):
        if step == 5:
            raise _Killed

    with pytest.raises(_Killed):
        train(_config(pairs, tmp_path / "parts", save_every=0.0), on_step=kill)
    parts = _state(train(_config(pairs, tmp_path / "parts")))
    assert all(torch.equal(whole[k], parts[k]) for k in whole)
    assert json.loads((tmp_path / "whole" / "fast-filtered" / "config.json").read_text())["crop"] == 32
    assert not list(tmp_path.rglob("*.partial"))


@pytest.mark.slow
def test_another_seed_gives_other_weights(pairs, tmp_path):
    a, b = (_state(train(_config(pairs, tmp_path / str(seed), seed=seed))) for seed in (1, 2))
    assert any(not torch.equal(a[k], b[k]) for k in a)


def test_an_invalid_checkpoint_is_refused_by_name(pairs, tmp_path):
    (tmp_path / "fast-filtered").mkdir()
    (tmp_path / "fast-filtered" / "checkpoint.pt").write_bytes(b"not a checkpoint")
    with pytest.raises(DataError, match=r"checkpoint\.pt: not a checkpoint") as caught:
        train(_config(pairs, tmp_path))
    assert "\n" not in str(caught.value)


BOTH = """
import os, socket, sys; sys.path.insert(0, sys.argv[1])
from pointglass.model.train.trainer import TrainConfig, train
import torch.distributed as dist

if sys.argv[4] == "forked":
    import torch._dynamo  # an optimiser imports it: once for both
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        os.environ |= {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(free.getsockname()[1]), "WORLD_SIZE": "2"}
    other = os.fork()
    os.environ |= dict.fromkeys(("RANK", "LOCAL_RANK"), "0" if other else "1")
seen = []
train(TrainConfig(pairs=(sys.argv[2],), out=sys.argv[3], quality='fast', steps=2, batch=1, crop=32, neighbours=0, device='cpu',
                  warmup=1), on_step=lambda step: seen.append((step, dist.get_world_size())))
assert seen == [(1, 2), (2, 2)], seen
if sys.argv[4] == "forked" and other:
    assert os.waitpid(other, 0)[1] == 0
"""


@pytest.mark.slow
@pytest.mark.parametrize("started", ["forked", pytest.param("torchrun", marks=pytest.mark.long)])
def test_two_processes_average_their_gradients(pairs, tmp_path, started):
    """Forked with the variables that torchrun sets, so that the libraries are loaded once.  (torchrun: three times.)"""
    script = tmp_path / "both.py"
    script.write_text(BOTH)
    run = [sys.executable, *(["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"] if started == "torchrun"
                             else []), str(script)]
    done = subprocess.run([*run, str(ROOT), str(pairs), str(tmp_path / "two"), started], capture_output=True, text=True,
                          timeout=240, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr[:3000]
    assert json.loads((tmp_path / "two" / "fast-filtered" / "config.json").read_text())["processes"] == 2
    two = torch.load(tmp_path / "two" / "fast-filtered" / "checkpoint.pt", weights_only=True)["network"]

    config = _config(pairs, tmp_path / "one", steps=2, batch=1, neighbours=0, warmup=1)
    trainer = Trainer(config, Process(0, 1, torch.device("cpu")))
    objective, crops = Objective(None, 0.1, 0.1, 0.1, config.structure_weight), Crops([pairs], 32, config.seed)

    class Mean:
        """Both processes' crops, one after the other: the mean of their losses has the mean of their gradients."""

        def __call__(self, made, beside, batch):
            losses = [objective(made[k : k + 1], beside, crops.batch(trainer.step, 1, 0, process=k))[0] for k in (0, 1)]
            return (losses[0] + losses[1]) / 2, {}

    for step in range(2):
        both = [crops.batch(step, 1, 0, process=k) for k in (0, 1)]
        batch = replace(both[0], x=torch.cat([b.x for b in both]))
        trainer.advance(batch, Mean(), config.learning_rate(step, step / 2))  # type: ignore[arg-type]
    one = trainer.network.state_dict()
    start = Trainer(config, trainer.process).network.state_dict()

    def apart(a, b):
        return sum(float((a[k] - b[k]).square().sum()) for k in a) ** 0.5

    train(_config(pairs, tmp_path / "alone", steps=2, batch=1, neighbours=0, warmup=1))
    alone = torch.load(tmp_path / "alone" / "fast-filtered" / "checkpoint.pt", weights_only=True)["network"]
    # Adam's first steps are nearly the signs of gradients, so rounding changes a few weights much: compare norms
    assert apart(one, two) < 0.2 * apart(one, start) < 0.2 * 2 * apart(one, alone)


def test_scalars_and_pictures_reach_tensorboard(pairs, tmp_path, monkeypatch):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    from pointglass.model.train import training_log

    monkeypatch.setattr(training_log, "EVERY", 2)
    monkeypatch.setattr(training_log, "PICTURES_EVERY", 4)
    train(_config(pairs, tmp_path / "run"))
    board = EventAccumulator(str(tmp_path / "run" / "fast-filtered" / "tensorboard"))
    board.Reload()
    assert {"loss", "l1", "rate"} <= set(board.Tags()["scalars"])
    lines = [json.loads(line) for line in (tmp_path / "run" / "fast-filtered" / "log.jsonl").read_text().splitlines()]
    told = {event.step: event.value for event in board.Scalars("loss")}
    assert told == pytest.approx({line["step"]: line["loss"] for line in lines}) and 8 in told
    picture = board.Images("filled, made, true")[-1]
    assert (picture.width, picture.height) == (3 * 32, 2 * 32)


def test_pictures_for_tensorboard_do_not_change_the_averaged_network(tmp_path, monkeypatch):
    """The paper's network has running statistics, which it updates in training mode."""
    monkeypatch.setattr("pointglass.model.train.trainer.make_network", lambda _quality: PaperUNet(4))
    averaged = Trainer(TrainConfig((), str(tmp_path), quality="paper"), Process(0, 1, torch.device("cpu"))).averaged
    before = {name: value.clone() for name, value in averaged.state_dict().items()}
    batch = SimpleNamespace(x=torch.rand(4, 5, 64, 64), colour=torch.rand(4, 3, 64, 64))
    with TrainingLog(tmp_path, 0, shown=True) as log:
        assert log.board is not None
        log.pictures(PICTURES_EVERY, averaged, batch)
    assert any("running_mean" in name for name in before)
    assert all(torch.equal(before[name], value) for name, value in averaged.state_dict().items())
