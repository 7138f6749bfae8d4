"""The table of qualities: one row for each network that can be chosen.  Pure values; imports no torch.

Command line, window, Python interface, training, benchmarks and messages read it: a new quality is one row here and its weights
in assets/weights (`pointglass train --quality NAME`).
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Size:
    """widths: channels of each level.  convolutions: 3x3 ones, down and up, at each.  block: pixels a side of a block."""

    widths: tuple[int, ...]
    convolutions: int
    block: int = 2


@dataclass(frozen=True)
class Quality:
    """text: for help and window.  relative_time: of one picture, the fast network's is 1.

    size: of a compact network (model.network.unet); None: the paper's network, or none of its own.
    mirrors: the quality whose network and weights it runs on mirrored pictures, averaged; None: it has its own.
    smaller: the quality that may stand in for it while the camera moves; that one's ``smaller`` comes next.
    Whether its weights are shipped, model.network.weights_folder finds.
    """

    text: str
    relative_time: float
    size: Size | None = None
    mirrors: str | None = None
    smaller: str | None = None


DEFAULT = "balanced"
QUALITIES: dict[str, Quality] = {
    "fast": Quality("the smallest network", 1.0, Size((32, 64, 96, 128), 1)),
    "balanced": Quality("the default network", 2.0, Size((64, 128, 192, 256), 1), smaller="fast"),
    "best": Quality("the default network on four mirrored copies, averaged; more accurate, takes four times as long", 8.0,
                    mirrors="balanced", smaller="balanced"),
    "paper": Quality("the paper's 31M-parameter U-Net", 25.0, smaller="fast"),
}
"""Relative times: measured at 960x720 on two cores in bf16 (viewer/bench/README.md)."""


def trainable() -> list[str]:
    """Qualities with weights of their own."""
    return [name for name, row in QUALITIES.items() if row.mirrors is None]


def stand_ins(quality: str) -> tuple[str, ...]:
    """Qualities that may stand in for one while the camera moves, the largest first."""
    found: list[str] = []
    while (smaller := QUALITIES[found[-1] if found else quality].smaller) is not None and smaller not in found:
        found.append(smaller)
    return tuple(found)
