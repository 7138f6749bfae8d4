"""Training steps: learning rate, gradient clipping, weight average and checkpoints."""

from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from pointglass.model.data.crops import Batch, Crops
from pointglass.model.network.weights import load_weights
from pointglass.model.train import trainer as train_module
from pointglass.model.train.torchrun import Process
from pointglass.model.train.trainer import TrainConfig, Trainer, train

pytestmark = pytest.mark.usefixtures("one_thread")


def _trainer(out, **changes) -> Trainer:
    config = TrainConfig((), str(out), quality="fast", device="cpu", **changes)
    config.state.mkdir(parents=True)
    return Trainer(config, Process(0, 1, torch.device("cpu")))


@pytest.fixture
def made_up(monkeypatch):
    """Crops that need no pairs."""
    monkeypatch.setattr(Crops, "__init__", lambda *_, **__: None)
    monkeypatch.setattr(Crops, "batch", lambda *_: _batch())


def _batch() -> Batch:
    def random(*shape):
        return torch.rand(2, *shape, 32, 32)

    return Batch(random(6), random(3), random(1), random(1), torch.zeros(0, 6, 32, 32), torch.zeros(0, 2, 32, 32))


def _pull(strength: float) -> Any:
    """Replaces the objective: rewards dark pictures."""
    def objective(made, _beside, _batch):
        return strength * made.square().mean(), {}

    return objective


def test_facts_contain_everything_that_determines_the_weights(tmp_path):
    """Except the duration, paths, devices, and files that are identified by their contents."""
    others = {"pairs", "out", "steps", "minutes", "perceptual_path", "start_from", "save_every", "device", "loaders",
              "sources"}  # fmt: skip
    known = TrainConfig((), str(tmp_path)).facts("squares")
    assert {field.name for field in fields(TrainConfig)} - others == set(known) - {"crops", "pairs", "perceptual", "start_from"}


def test_the_rate_warms_up_and_falls_by_a_cosine_to_a_fiftieth():
    config = TrainConfig((), "", rate=0.5, warmup=4)
    assert [config.learning_rate(step, 0.0) for step in range(6)] == pytest.approx([0.125, 0.25, 0.375, 0.5, 0.5, 0.5])
    done = [config.learning_rate(99, share) for share in (0.25, 0.5, 0.75, 1.0, 1.5)]
    assert done == pytest.approx([0.5 * (0.02 + 0.98 * c) for c in ((2 + 2**0.5) / 4, 0.5, (2 - 2**0.5) / 4, 0, 0)])


@pytest.mark.parametrize("steps, minutes, done", [(1000, 1.0, 10), (4, 1.0, 4), (4, 0.0, 4)])
def test_the_rate_follows_steps_or_minutes_whichever_ends_first(tmp_path, monkeypatch, made_up, steps, minutes, done):
    """With a clock on which a step takes six seconds."""
    clock, rates = [100.0], []

    def advance(trainer, _batch, _objective, rate):
        rates.append(rate)
        clock[0] += 6
        trainer.step += 1
        return {"loss": torch.zeros(())}

    monkeypatch.setattr(train_module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    monkeypatch.setattr(Trainer, "advance", advance)
    config = TrainConfig((), str(tmp_path), quality="fast", device="cpu", steps=steps, minutes=minutes)
    train(config)
    assert rates == pytest.approx([config.learning_rate(k, k / done) for k in range(done)])


def test_the_average_follows_quickly_at_first_and_then_slowly(tmp_path):
    trainer = _trainer(tmp_path, average=0.25)  # the limit applies from the third step
    expected = {name: value.clone() for name, value in trainer.averaged.state_dict().items()}
    for step in range(6):
        trainer.advance(_batch(), _pull(1.0), 1e-3)
        keep = min(0.25, (1 + step) / (10 + step))
        for name, value in trainer.network.state_dict().items():
            expected[name] = keep * expected[name] + (1 - keep) * value
    for name, value in trainer.averaged.state_dict().items():
        assert torch.allclose(value, expected[name], atol=1e-7)
    assert not all(torch.equal(a, b) for a, b in zip(trainer.network.parameters(), trainer.averaged.parameters(), strict=True))


@pytest.mark.parametrize("strength", [1e-3, 1e6])
def test_gradients_are_clipped_to_norm_1(tmp_path, strength):
    torch.manual_seed(1)
    trainer = _trainer(tmp_path)
    trainer.advance(_batch(), _pull(strength), 1e-3)
    norm = np.sqrt(sum(float(p.grad.double().square().sum()) for p in trainer.network.parameters() if p.grad is not None))
    assert norm == pytest.approx(1.0, abs=1e-3) if strength > 1 else 0 < norm < 0.1


def test_the_saved_weights_are_the_average(tmp_path):
    trainer = _trainer(tmp_path)
    with torch.no_grad():
        for p in trainer.averaged.parameters():
            p.copy_(torch.randn_like(p))
    trainer.save(tmp_path / "kept.safetensors", {}, {})
    kept = load_weights(tmp_path / "kept.safetensors")[0].state_dict()
    assert all(torch.equal(kept[name], value.half().float()) for name, value in trainer.averaged.state_dict().items())


def test_a_checkpoint_that_cannot_be_written_leaves_the_older_one(tmp_path, monkeypatch):
    trainer = _trainer(tmp_path)
    trainer.save(tmp_path / "kept.safetensors", {}, {})
    before = trainer.checkpoint.read_bytes()

    def half(_state, path):
        Path(path).write_bytes(before[: len(before) // 2])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(torch, "save", half)
    trainer.advance(_batch(), _pull(1.0), 1e-3)
    with pytest.raises(OSError, match="No space"):
        trainer.save(tmp_path / "kept.safetensors", {}, {})
    assert trainer.checkpoint.read_bytes() == before and trainer.saved == 0
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == ["checkpoint.pt", "kept.safetensors"]


@pytest.mark.parametrize("half", [True, False])
def test_half_a_step_is_never_saved(tmp_path, monkeypatch, made_up, half):
    """Interrupted when the network is updated and the average is not, or between two steps."""
    take, taken = torch.optim.AdamW.step, []

    def stopped(*given):
        take(*given)
        taken.append(given)
        if half and len(taken) == 3:
            raise KeyboardInterrupt

    def known(step):
        if step == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(torch.optim.AdamW, "step", stopped)
    config = TrainConfig((), str(tmp_path), quality="fast", device="cpu", steps=5)
    with pytest.raises(KeyboardInterrupt):
        train(config, on_step=known)
    path = config.state / "checkpoint.pt"
    assert len(taken) == 3 and path.exists() == (not half)
    assert half or torch.load(path, weights_only=True)["step"] == 3
