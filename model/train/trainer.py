"""The training loop: random crops of precomputed pairs, a weight average of the network, and checkpoints.

One call of :func:`train` runs until its steps or minutes are used up.  It writes a checkpoint (network, average, optimiser,
step, and the facts they were made from) about every minute and on Ctrl-C.  Called again with the same folder and the same
facts, it continues from the checkpoint to the bit; other facts are refused.  Weights are written to ``out``; checkpoint,
``config.json`` and logs to a subfolder named after the weights.  Under ``torchrun`` each process draws its own crops, gradients
are averaged (DistributedDataParallel), and the first process writes the results.
"""

import json
import logging
import math
import os
import pickle
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from torch import nn

from ..common.errors import DataError
from ..common.files.atomic_write import write_atomic
from ..common.files.folders import made_folder
from ..common.files.json_file import write_json
from ..common.process.interrupts import finish_before_interrupt
from ..data.crops import Crops, Prefetcher
from ..network.reconstruct import fast_precision
from ..network.unet import make_network
from ..network.weights import WeightsError, load_weights, save_weights
from ..network.weights_folder import weights_name
from .manifest import EARLIER, Facts, pairs_facts, refuse_other, start_fact
from .net2net import started_from
from .objective import Objective
from .torchrun import Process, of_the_first, processes
from .training_log import TrainingLog

_log = logging.getLogger(__name__)

DECIDING = ("quality", "filtered", "shares", "seed", "batch", "neighbours", "crop", "recolour", "rate", "warmup",
            "perceptual_weight", "coverage_weight", "steady_weight", "structure_weight", "light_weight",
            "excess_weight", "average")
"""Fields of a configuration that determine the weights; a checkpoint continues only if they are equal.  A longer training has
the same."""

CROPS = 4
"""Version of the drawing of crops; increased when the same seed draws different crops."""
WEIGHT_DECAY = 1e-4
"""AdamW's weight decay.  This and the two below are those of the shipped weights' training (assets/weights/README.md)."""
MAX_GRADIENT = 1.0
"""Norm at which gradients are clipped."""
LAST_RATE = 0.02
"""Share of the learning rate at the end of the cosine."""


@dataclass(frozen=True)
class TrainConfig:
    """Configuration of a training run; saved with its checkpoint as ``config.json``.

    pairs: folders made by :mod:`model.data.pairs`.  shares: relative frequency of each folder (empty: equal).
    minutes: training time of all calls together (0: only ``steps`` counts).  batch: crops per process and step.
    neighbours: number of them with a neighbouring camera, where the pairs have one.
    rate: learning rate after ``warmup`` steps.
    perceptual_weight: of the perceptual distance; L1 has the rest (paper: 0.1).  structure_weight: of 1 - SSIM.
    light_weight: of local light (model.train.objective); the shipped weights had 1 in their last stage.
    excess_weight: of the error beyond the filled picture's (model.train.objective).
    average: decay of the weight average per step.
    start_from: initial weights, of this size or a smaller one (:mod:`model.train.net2net`).
    save_every: seconds between checkpoints.
    recolour: augments crops with exposures, channel orders, disagreeing stations and noise (model.data.augmentation); off where
    one scanner's own colours are to be learned.
    sources: description of the training data, for the weights' header.
    loaders: processes that prepare crops (-1: none on the CPU; one per core but one beside a GPU).
    """

    pairs: tuple[str, ...]
    out: str
    quality: str = "balanced"
    filtered: bool = True
    steps: int = 20000
    minutes: float = 0.0
    batch: int = 8
    neighbours: int = 2
    crop: int = 192
    rate: float = 1e-3
    warmup: int = 200
    perceptual_weight: float = 0.1
    coverage_weight: float = 0.1
    steady_weight: float = 0.1
    structure_weight: float = 0.05
    light_weight: float = 0.0
    excess_weight: float = 0.0
    perceptual_path: str | None = None
    average: float = 0.998
    seed: int = 1
    start_from: str | None = None
    save_every: float = 60.0
    shares: tuple[float, ...] = ()
    device: str = "auto"
    recolour: bool = True
    loaders: int = -1
    sources: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the weights, and of the folder with their checkpoint and logs."""
        return weights_name(self.quality, filtered=self.filtered)

    @property
    def state(self) -> Path:
        """Folder of checkpoint, configuration and logs."""
        return Path(self.out) / self.name

    def facts(self, perceptual: str) -> Facts:
        """Facts that determine the weights, apart from the training time.  perceptual: name of the distance in use."""
        return {name: getattr(self, name) for name in DECIDING} | {
            "crops": CROPS, "pairs": pairs_facts(self.pairs), "perceptual": perceptual,
            "start_from": start_fact(self.start_from, Path(self.out)),
        }

    def learning_rate(self, step: int, done: float) -> float:
        """Linear warm-up, then a cosine to LAST_RATE.  done: share of the run, 0..1, by steps or by minutes."""
        warm = min(1.0, (step + 1) / self.warmup)
        return self.rate * warm * (LAST_RATE + (1 - LAST_RATE) * 0.5 * (1 + math.cos(math.pi * min(done, 1.0))))


class Trainer:
    """The state of a run: network, its weight average, optimiser and step.  ``load`` and ``save`` restore and store all of it.

    between_steps: False during a step, when the state must not be saved.
    """

    def __init__(self, config: TrainConfig, process: Process):
        torch.manual_seed(config.seed)
        self.config, self.process = config, process
        network = make_network(config.quality)
        self.network = network.to(process.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        if config.start_from:
            try:
                started_from(self.network, load_weights(Path(config.start_from))[0])
            except ValueError as error:
                raise DataError(f"cannot be the start of a {config.quality} network ({error})",
                                file=config.start_from) from None
        self.averaged = make_network(config.quality).to(process.device).requires_grad_(False).eval()
        self.averaged.load_state_dict(self.network.state_dict())
        self.optimiser = torch.optim.AdamW(self.network.parameters(), config.rate, weight_decay=WEIGHT_DECAY)
        self.step, self.spent, self.saved, self.between_steps = 0, 0.0, 0, True
        # without bf16 multiplication in hardware a step in bf16 takes three times as long as in fp32
        self.mixed = process.device.type == "cuda" or fast_precision("cpu") == "bf16"
        _log.info("training on %s, convolutions in %s", process.device, "bf16" if self.mixed else "fp32")
        self.checkpoint = config.state / "checkpoint.pt"
        self.model: nn.Module = self.network

    def load(self, facts: Facts) -> None:
        """Continues from the checkpoint, if there is one.  facts: of this run.

        Raises DataError where the checkpoint is unreadable or was made from other facts.
        """
        out, path = Path(self.config.out), self.checkpoint
        if (earlier := out / path.name).is_file():
            raise DataError(EARLIER, file=earlier)
        if path.is_file():
            try:
                with warnings.catch_warnings(action="ignore"):  # the error below is enough
                    saved = torch.load(path, weights_only=True, map_location=self.process.device)
                if (kept := json.loads(saved.get("made_from", "{}"))).get("crops") != CROPS:
                    raise DataError(EARLIER, file=path)
                refuse_other(out, f"{self.config.name} was", kept, facts)
                self.network.load_state_dict(saved["network"])
                self.averaged.load_state_dict(saved["averaged"])
                self.optimiser.load_state_dict(saved["optimiser"])
                self.step, self.spent = saved["step"], saved["spent"]
            except (RuntimeError, KeyError, ValueError, TypeError, AttributeError, EOFError, OSError,
                    pickle.UnpicklingError) as error:
                reason = (str(error).splitlines() or [type(error).__name__])[0]
                raise DataError(f"not a checkpoint of this training ({reason})", file=path,
                                remedy="choose another --out, or remove it") from None
        self.saved = self.step
        if self.process.count > 1:  # a barrier: all processes have read the checkpoint before the first replaces it
            ids = [self.process.device.index] if self.process.device.type == "cuda" else None
            self.model = nn.parallel.DistributedDataParallel(self.network, device_ids=ids)

    def save(self, weights: Path, facts: Facts, notes: dict) -> None:
        """Writes weights and checkpoint, each atomically, in the first process.

        Raises DataError, with both files unchanged, where weights exceed half precision.
        """
        if not self.process.first:
            return
        state = {
            "network": self.network.state_dict(), "averaged": self.averaged.state_dict(), "made_from": json.dumps(facts),
            "optimiser": self.optimiser.state_dict(), "step": self.step, "spent": self.spent,
        }
        try:
            save_weights(weights, self.averaged, self.config.quality, filtered=self.config.filtered,
                         notes={**notes, "step": self.step})
        except WeightsError as error:
            raise self._diverged(error) from None
        write_atomic(self.checkpoint, lambda beside: torch.save(state, beside))
        self.saved = self.step

    def _diverged(self, why: object) -> DataError:
        kept = f"the weights of step {self.saved} are kept" if self.saved else "nothing is kept"
        return DataError(f"training diverged at step {self.step + 1} ({why}); {kept}", file=self.config.state,
                         remedy="choose a lower --rate, and another --out")

    def advance(self, batch, objective: Objective, rate: float) -> dict[str, torch.Tensor]:
        """One optimisation step.  Returns the terms of the loss.

        Raises DataError, with the weights unchanged, where the gradient is not finite.
        """
        self.between_steps = False
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        with torch.autocast(self.process.device.type, torch.bfloat16, enabled=self.mixed):
            made = self.model(torch.cat([batch.x, batch.neighbour]).contiguous(memory_format=torch.channels_last))
            loss, terms = objective(made[: len(batch.x)], made[len(batch.x) :], batch)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        if not torch.nn.utils.clip_grad_norm_(self.network.parameters(), MAX_GRADIENT).isfinite():
            raise self._diverged(f"loss {float(loss.detach()):g}")
        self.optimiser.step()
        keep = min(self.config.average, (1 + self.step) / (10 + self.step))
        for mine, new in zip(self.averaged.state_dict().values(), self.network.state_dict().values(), strict=True):
            mine.lerp_(new, 1 - keep) if mine.is_floating_point() else mine.copy_(new)
        self.step += 1
        self.between_steps = True
        return {"loss": loss.detach(), **{name: value.detach() for name, value in terms.items()}}


def train(config: TrainConfig, on_step=None) -> Path:
    """Trains and returns the path of the weights (of the weight average).

    on_step: called after each step with the number of steps done.  Raises DataError where pairs or checkpoint do not fit, with
    nothing changed, and where training diverges.
    """
    out = Path(config.out)
    with processes(config.device) as process:
        crops = Crops([Path(p) for p in config.pairs], config.crop, config.seed, config.shares, recolour=config.recolour)
        objective = Objective(
            Path(config.perceptual_path) if config.perceptual_path else None, config.perceptual_weight,
            config.coverage_weight, config.steady_weight, config.structure_weight, config.light_weight,
            config.excess_weight,
        ).to(process.device)
        trainer, facts = Trainer(config, process), config.facts(objective.name)
        trainer.load(facts)
        weights = out / f"{config.name}.safetensors"
        notes = {"perceptual": objective.name, "processes": process.count, "torch": torch.__version__, **asdict(config)}
        with made_folder(config.state):
            if process.first:
                write_json(config.state / "config.json", notes)
            # The header of weights that are published holds no paths of this machine.
            header = {**notes, "pairs": facts["pairs"], "start_from": facts["start_from"], "out": out.name,
                      "sources": [Path(source).name for source in config.sources], "perceptual_path": None}
            with TrainingLog(config.state, trainer.step, shown=process.first) as log:
                _run(config, process, crops, objective, trainer, log, lambda: trainer.save(weights, facts, header), on_step)
    return weights


def _run(config: TrainConfig, process: Process, crops: Crops, objective: Objective, trainer: Trainer, log: TrainingLog,
         save, on_step) -> None:
    start, last_save, limit = time.monotonic() - trainer.spent, time.monotonic(), config.minutes * 60
    loaders = config.loaders if config.loaders >= 0 else (os.cpu_count() or 1) - 1 if process.device.type == "cuda" else 0
    ahead = Prefetcher(crops, config.batch, config.neighbours, process.rank, loaders)
    with ahead, finish_before_interrupt() as interrupt:  # a checkpoint of complete steps is saved
        try:
            while trainer.step < config.steps:
                trainer.spent = of_the_first(process, trainer.spent)
                if limit and trainer.spent >= limit:
                    break
                batch = ahead.batch(trainer.step).to(process.device)
                done = max(trainer.step / config.steps, trainer.spent / limit if limit else 0.0)
                rate = config.learning_rate(trainer.step, done)
                terms = trainer.advance(batch, objective, rate)
                trainer.spent = time.monotonic() - start
                interrupt.check()
                log.step(trainer.step, terms, rate, trainer.spent)
                log.pictures(trainer.step, trainer.averaged, batch)
                if time.monotonic() - last_save > config.save_every:
                    save()
                    last_save = time.monotonic()
                if on_step is not None:
                    on_step(trainer.step)
                interrupt.check()
            save()
        except (KeyboardInterrupt, RuntimeError):  # RuntimeError: another process ended, perhaps by the same Ctrl-C
            if trainer.between_steps and trainer.step > trainer.saved:
                save()
            raise
