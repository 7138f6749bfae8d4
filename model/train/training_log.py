"""Progress of a training run: a line on the terminal, ``log.jsonl``, and TensorBoard where it is installed."""

import json
from collections import defaultdict
from pathlib import Path

import torch
from torch import Tensor, nn

from ..common.errors import INSTALL_LAB
from ..common.files.folders import replace_text

EVERY = 50
"""Steps between log lines."""
PICTURES_EVERY = 500
"""Steps between pictures in TensorBoard."""


class TrainingLog:
    """Logs means of the loss's terms over EVERY steps.

    step: steps done so far.  Entries of later steps, which an earlier run logged after its last checkpoint, are removed.
    shown: False in all processes but the first, which then log nothing.
    """

    def __init__(self, out: Path, step: int, *, shown: bool):
        self.shown, self.count, self.last = shown, 0, 0.0
        self.sums: defaultdict[str, float | Tensor] = defaultdict(float)
        if shown:
            _cut(out / "log.jsonl", step)
        self.file = (out / "log.jsonl").open("a") if shown else None
        self.board = None
        if shown:
            try:
                from torch.utils.tensorboard import SummaryWriter

                self.board = SummaryWriter(str(out / "tensorboard"), purge_step=step + 1)
            except ImportError:
                print(f"TensorBoard is not installed: scalars go to log.jsonl only ({INSTALL_LAB})", flush=True)

    def __enter__(self) -> "TrainingLog":
        return self

    def __exit__(self, *_) -> None:
        if self.file is not None:
            self.file.close()
        if self.board is not None:
            self.board.close()

    def step(self, step: int, terms: dict[str, Tensor], rate: float, spent: float) -> None:
        """Adds a step.  spent: seconds of training so far, earlier runs included."""
        if self.file is None:
            return
        for name, value in terms.items():
            self.sums[name] = self.sums[name] + value.double()  # stays on the device: float() would wait for the GPU
        self.count += 1
        if step % EVERY:
            return
        means = {name: float(value) / self.count for name, value in self.sums.items()}
        seconds = (spent - self.last) / self.count if self.last else spent / step
        self.file.write(json.dumps({"step": step, "seconds": round(spent, 1), "rate": rate, **means}) + "\n")
        self.file.flush()
        if self.board is not None:
            for name, value in {**means, "rate": rate}.items():
                self.board.add_scalar(name, value, step)
        print(f"step {step}  {'  '.join(f'{k} {v:.4f}' for k, v in means.items())}  {seconds:.2f} s a step", flush=True)
        self.sums.clear()
        self.count, self.last = 0, spent

    def pictures(self, step: int, network: nn.Module, batch) -> None:
        """Every PICTURES_EVERY steps: the first crops filled, from the network, and true, side by side."""
        if self.board is None or step % PICTURES_EVERY:
            return
        with torch.no_grad():
            made = network(batch.x[:4])[:, :3].float().clamp(0, 1)
        rows = torch.cat([batch.x[:4, :3], made, batch.colour[:4]], 3)
        self.board.add_image("filled, made, true", torch.cat(list(rows.cpu()), 1), step)


def _cut(path: Path, step: int) -> None:
    """Removes from a log the lines after a step, and lines that were written incompletely."""
    if not path.is_file():
        return
    text = path.read_text("utf-8", errors="replace")
    kept = "".join(line for line in text.splitlines(keepends=True) if line.endswith("\n") and _step_of(line) <= step)
    if kept != text:
        replace_text(path, kept)


def _step_of(line: str) -> float:
    try:
        step = json.loads(line)["step"]
    except (ValueError, KeyError, TypeError):
        step = None
    return step if isinstance(step, int) else float("inf")
