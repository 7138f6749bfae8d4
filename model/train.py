"""Training: pairs made ahead, random crops, L1 plus a perceptual distance, an averaged network, exact resume.

One call of :func:`train` runs until its steps or minutes are used up, saving a checkpoint (network, average, optimiser,
random state) every few minutes; called again with the same configuration it goes on from there.
"""

import json
import math
import os
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from model.losses import perceptual
from model.unet import make_network
from model.weights import load_weights, save_weights


@dataclass(frozen=True)
class TrainConfig:
    """What a training run is; saved beside its results.

    pairs: folders made by :mod:`model.data.pairs`, drawn from in equal shares.  start_from: weights to go on from.
    minutes: stop after this long in this call (0: by steps alone).
    perceptual_weight: of the perceptual distance, L1 taking the rest (paper: 0.1).
    """

    pairs: tuple[str, ...]
    out: str
    quality: str = "balanced"
    filtered: bool = True
    steps: int = 20000
    minutes: float = 0.0
    batch: int = 8
    crop: int = 192
    rate: float = 1e-3
    warmup: int = 200
    perceptual_weight: float = 0.1
    perceptual_path: str | None = None
    average: float = 0.998
    seed: int = 1
    start_from: str | None = None
    save_every: float = 300.0


class Crops:
    """Random crops of the pairs, flipped and turned, with one exposure a crop put on input and truth alike."""

    def __init__(self, folders: list[Path], crop: int, seed: int):
        self.inputs = [np.load(folder / "inputs.npy", mmap_mode="r") for folder in folders]
        self.truth = [np.load(folder / "truth.npy", mmap_mode="r") for folder in folders]
        self.crop = crop
        self.rng = np.random.default_rng(seed)

    def batch(self, count: int) -> tuple[Tensor, Tensor]:
        """(B, 5, crop, crop) float32 input and (B, 3, crop, crop) float32 truth."""
        rng, crop = self.rng, self.crop
        xs, ys = [], []
        for _ in range(count):
            folder = int(rng.integers(len(self.inputs)))
            inputs, truth = self.inputs[folder], self.truth[folder]
            i = int(rng.integers(len(inputs)))
            r = int(rng.integers(inputs.shape[2] - crop + 1))
            c = int(rng.integers(inputs.shape[3] - crop + 1))
            x = inputs[i, :, r : r + crop, c : c + crop].astype(np.float32)
            y = truth[i, :, r : r + crop, c : c + crop].astype(np.float32) / 255
            turns = int(rng.integers(4))
            x, y = np.rot90(x, turns, (1, 2)), np.rot90(y, turns, (1, 2))
            if rng.random() < 0.5:
                x, y = x[:, :, ::-1], y[:, :, ::-1]
            gain = np.exp(rng.normal(0, 0.15, (3, 1, 1)) * 0.4 + rng.normal(0, 0.15)).astype(np.float32)
            x, y = x.copy(), y * gain
            x[:3] *= gain
            if rng.random() < 0.5:
                order = rng.permutation(3)
                x[:3], y = x[order], y[order]
            xs.append(x)
            ys.append(np.ascontiguousarray(np.minimum(y, 1.0)))
            np.minimum(x[:3], 1.0, out=x[:3])
        return torch.from_numpy(np.stack(xs)), torch.from_numpy(np.stack(ys))


def _rate(step: int, config: TrainConfig, done: float) -> float:
    """Warm-up, then a cosine over the share of the run that is done (0..1), by steps or by minutes."""
    warm = min(1.0, (step + 1) / config.warmup)
    return config.rate * warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * min(done, 1.0))))


def _average(target: nn.Module, source: nn.Module, keep: float) -> None:
    for a, b in zip(target.state_dict().values(), source.state_dict().values(), strict=True):
        if a.is_floating_point():
            a.lerp_(b, 1 - keep)
        else:
            a.copy_(b)


def train(config: TrainConfig) -> Path:
    """Trains and returns the path of the weights (the averaged network).  Resumes from ``out/checkpoint.pt``."""
    out = Path(config.out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "config.json").write_text(json.dumps(asdict(config), indent=1))
    torch.manual_seed(config.seed)
    network = make_network(config.quality).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if config.start_from:
        network.load_state_dict(load_weights(Path(config.start_from))[0].state_dict())
    averaged = make_network(config.quality).requires_grad_(False)
    averaged.load_state_dict(network.state_dict())
    optimiser = torch.optim.AdamW(network.parameters(), config.rate, weight_decay=1e-4)
    distance, distance_name = perceptual(Path(config.perceptual_path) if config.perceptual_path else None)
    crops = Crops([Path(p) for p in config.pairs], config.crop, config.seed)
    step, spent = 0, 0.0
    checkpoint = out / "checkpoint.pt"
    if checkpoint.is_file():
        saved = torch.load(checkpoint, weights_only=True)
        network.load_state_dict(saved["network"])
        averaged.load_state_dict(saved["averaged"])
        optimiser.load_state_dict(saved["optimiser"])
        step, spent = saved["step"], saved["spent"]
        crops.rng.bit_generator.state = json.loads(saved["rng"])
        torch.set_rng_state(saved["torch_rng"])
    weights = out / f"{config.quality}-{'filtered' if config.filtered else 'unfiltered'}.safetensors"
    notes = {"perceptual": distance_name, **asdict(config)}

    def save() -> None:
        beside = checkpoint.with_name(f"checkpoint.{os.getpid()}.partial")
        torch.save(
            {
                "network": network.state_dict(), "averaged": averaged.state_dict(), "optimiser": optimiser.state_dict(),
                "step": step, "spent": spent, "rng": json.dumps(crops.rng.bit_generator.state),
                "torch_rng": torch.get_rng_state(),
            },
            beside,
        )
        beside.replace(checkpoint)
        save_weights(weights, averaged, config.quality, filtered=config.filtered, notes={**notes, "step": step})

    start, last_save, shown = time.monotonic() - spent, time.monotonic(), []
    limit = config.minutes * 60
    while step < config.steps and (not limit or spent < limit):
        done = max(step / config.steps, spent / limit if limit else 0.0)
        for group in optimiser.param_groups:
            group["lr"] = _rate(step, config, done)
        x, y = crops.batch(config.batch)
        x = x.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        with torch.autocast("cpu", torch.bfloat16):
            made = network(x)
            loss = (made - y).abs().mean()
            if distance is not None:
                half = len(made) // 2 or 1  # the distance costs more than the network: half of the batch is enough
                gap = distance(made[:half].clamp(0, 1), y[:half])
                loss = (1 - config.perceptual_weight) * loss + config.perceptual_weight * gap
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        _average(averaged, network, min(config.average, (1 + step) / (10 + step)))
        step, spent = step + 1, time.monotonic() - start
        shown.append(float(loss.detach()))
        if step % 100 == 0:
            print(f"step {step}  loss {np.mean(shown):.4f}  {spent / step:.2f} s a step", flush=True)
            shown.clear()
        if time.monotonic() - last_save > config.save_every:
            save()
            last_save = time.monotonic()
    save()
    return weights
