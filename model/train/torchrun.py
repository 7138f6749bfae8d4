"""Distributed training under ``torchrun``: the process group, and values that all processes share.  One process otherwise."""

import contextlib
import os
from dataclasses import dataclass

import torch
import torch.distributed as dist


@dataclass(frozen=True)
class Process:
    """This process: its rank, the number of processes, and its device."""

    rank: int
    count: int
    device: torch.device

    @property
    def first(self) -> bool:
        return self.rank == 0


@contextlib.contextmanager
def processes(device: str):
    """Joins the process group if ``torchrun`` started this process, and leaves it at the end.  device: auto, cuda or cpu."""
    rank, count = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    cuda = device == "cuda" or (device == "auto" and torch.cuda.is_available())
    chosen = torch.device("cuda", int(os.environ.get("LOCAL_RANK", 0))) if cuda else torch.device("cpu")
    if cuda:
        torch.cuda.set_device(chosen)
    joined = count > 1 and not dist.is_initialized()
    if joined:
        dist.init_process_group("nccl" if cuda else "gloo")
    try:
        yield Process(rank, count, chosen)
    finally:
        if joined:
            dist.destroy_process_group()


def of_the_first(process: Process, value: float) -> float:
    """The first process's value, for example its clock, in all processes: all must take the same steps at the same rates."""
    if process.count == 1:
        return value
    shared = torch.tensor([value], dtype=torch.float64, device=process.device)
    dist.broadcast(shared, 0)
    return float(shared.item())
