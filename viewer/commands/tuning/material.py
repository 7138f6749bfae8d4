"""Interface of both kinds of fine-tuning data, and a check of the disk space for training pairs."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch

from ...common.errors import InputError

HELD_OUT_EVERY = 5
"""Every fifth photograph or viewpoint is held out from training for the evaluation, as in a
fivefold cross-validation."""
DENSITIES = (1.0, 0.25)
"""Shares of the points in the evaluation: all, and those of twice the spacing."""


@dataclass(frozen=True, eq=False)
class HeldOutPicture:
    """A held-out picture.  input: (C, H, W) float16, of the network; truth: (3, H, W), 0..1; known: (H, W) bool, valid
    truth."""

    input: torch.Tensor
    truth: torch.Tensor
    known: torch.Tensor


class Material(Protocol):
    """Training and held-out data of a scan.

    noun: name of the items, plural, for messages.  learned, held: number of training and of held-out items.  perceptual:
    whether the loss can include a perceptual distance.
    """

    @property
    def noun(self) -> str: ...

    @property
    def perceptual(self) -> bool: ...

    @property
    def learned(self) -> int: ...

    @property
    def held(self) -> int: ...

    def held_out_pictures(self) -> list[HeldOutPicture]:
        """The held-out pictures at each density."""
        ...

    def pairs(self, work: Path, name: str, seed: int) -> list[tuple[Path, int]]:
        """Makes folders of training pairs in ``work``.  Returns (folder, number of pictures) each.  name: of the scan."""
        ...


def check_room(work: Path, pixels: int) -> None:
    """Raises InputError if the disk of the folder ``work`` has no space for pairs of ``pixels`` pixels in total."""
    from ....model.network.unet import INPUT_CHANNELS

    needed, free = (2 * INPUT_CHANNELS + 15) * pixels, shutil.disk_usage(work).free  # bytes: half floats, and the truth
    if needed > 0.9 * free:
        raise InputError(f"{needed / 1e9:.1f} GB are needed for training pairs, {free / 1e9:.1f} GB are free", file=work.parent)
