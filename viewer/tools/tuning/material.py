"""What both kinds of tuning have in common: what is learned from, what is judged, and room for the pairs."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch

from viewer.errors import InputError

JUDGED = 5
"""Every fifth photograph or viewpoint is judged, not learned from."""
DENSITIES = (1.0, 0.25)
"""Of the points, at which the judged pictures are made."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A picture to judge by.  input (C, H, W) float16, the network's; truth (3, H, W) 0..1; known (H, W) bool."""

    input: torch.Tensor
    truth: torch.Tensor
    known: torch.Tensor


class Material(Protocol):
    """What a scan offers to be tuned on.

    noun: of what is learned from and judged, in the plural.  learned, held: how many of each.  perceptual: whether a perceptual
    distance can be part of the loss.
    """

    @property
    def noun(self) -> str: ...

    @property
    def perceptual(self) -> bool: ...

    @property
    def learned(self) -> int: ...

    @property
    def held(self) -> int: ...

    def judged(self) -> list[Judged]:
        """What is judged, at every density."""
        ...

    def pairs(self, work: Path, name: str, seed: int) -> list[tuple[Path, int]]:
        """Makes folders of training pairs in ``work``, and says how many pictures each was made of.  name: of the scan."""
        ...


def check_room(work: Path, pixels: int) -> None:
    """Raises InputError where the disk of the folder ``work`` has no room for pairs of so many pixels."""
    from model.unet import INPUT_CHANNELS

    needed, free = (2 * INPUT_CHANNELS + 15) * pixels, shutil.disk_usage(work).free  # half floats, and bytes of the truth
    if needed > 0.9 * free:
        raise InputError(f"{work.parent}: {needed / 1e9:.1f} GB are needed for training pairs, {free / 1e9:.1f} GB are free")
