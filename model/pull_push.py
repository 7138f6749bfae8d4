"""Hole filling without learning: the pull-push pyramid in torch, twin of ``fill_pull.comp`` and ``fill_push.comp``.

Pull: each coarser pixel is the weighted mean of its children, its weight the children's sum, at most 1.  Push: from the
coarsest level down, what a pixel's weight leaves open comes from the bilinearly sampled coarser level (Grossman and
Dally 1998; Marroquim et al. 2007).  Measured pixels are never touched, but where they weigh less than those around them
(model/station_weights.py).
"""

import torch
from torch import Tensor

from model.pyramid import RING, bilinear, parents, quads, shifted

SURROUND_SHARE = 16
"""The largest blocks that may surround a hole are 1 / 16 of the picture's longer side."""
STRICT_FROM = 3
"""From this level up (blocks of 8 pixels) all eight blocks around must hold something, so that outlines stay tight."""


def pull_push(image: Tensor, mask: Tensor) -> Tensor:
    """Fills the pixels outside ``mask``.

    image: (C, H, W) float.  mask: (H, W) bool, True where measured, or float weights 0..1 of what is measured.  Returns
    (C, H, W), equal to ``image`` where the weight is 1; all zeros where nothing at all is measured.
    """
    weight = mask.to(image.dtype)
    colours, weights = [image * weight], [weight]  # colours carry their weight
    while max(weights[-1].shape) > 1:
        a, b, c, d = quads(weights[-1], 0.0)
        total = (a + b) + (c + d)
        p, q, r, s = quads(colours[-1], 0.0)
        colour = (p + q) + (r + s)
        scale = torch.where(total > 1.0, 1.0 / total.clamp_min(1.0), torch.ones_like(total))
        colours.append(colour * scale)
        weights.append(total.clamp_max(1.0))
    filled = colours[-1] / weights[-1].clamp_min(1e-20)
    for colour, weight in zip(reversed(colours[:-1]), reversed(weights[:-1]), strict=True):
        filled = colour + (1.0 - weight) * bilinear(filled, *weight.shape)
    return filled


def surround_levels(width: int, height: int) -> int:
    """Pyramid levels at which :func:`surrounded` looks: at least 1."""
    return max(1, (max(width, height) // SURROUND_SHARE).bit_length() - 1)


def surrounded(mask: Tensor) -> Tensor:
    """(H, W) bool: pixels that are measured or that measured pixels surround, at some scale; the rest is void.

    At a level a block is surrounded where, of each two consecutive blocks of the eight around it, at least one holds a
    measured pixel; from STRICT_FROM up, where all eight do.  What lies beyond the picture surrounds nothing.
    """
    held = [mask.to(torch.float32)]
    for _ in range(surround_levels(mask.shape[-1], mask.shape[-2])):
        a, b, c, d = quads(held[-1], 0.0)
        held.append(torch.maximum(torch.maximum(a, b), torch.maximum(c, d)))
    inside = None
    for number in range(len(held) - 1, 0, -1):
        level = held[number]
        ring = [shifted(level, dx, dy, 0.0) for dx, dy in RING]
        least = torch.ones_like(level)
        for k in range(8):
            other = ring[k] if number >= STRICT_FROM else ring[(k + 1) % 8]
            least = torch.minimum(least, torch.maximum(ring[k], other))
        inside = least if inside is None else torch.maximum(least, parents(inside, *level.shape))
    assert inside is not None
    return mask | (parents(inside, *mask.shape) > 0)
