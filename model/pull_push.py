"""Hole filling without learning: the pull-push pyramid in torch, twin of ``fill_pull.comp`` and ``fill_push.comp``.

Pull: each coarser pixel is the weighted mean of its children, its weight the children's sum, at most 1.  Push: from the
coarsest level down, what a pixel's weight leaves open comes from the bilinearly sampled coarser level (Grossman and
Dally 1998; Marroquim et al. 2007).  Measured pixels are never touched, but where they weigh less than those around them
(model/station_weights.py).
"""

import torch
from torch import Tensor

from model.pyramid import bilinear, quads


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
