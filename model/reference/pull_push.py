"""Hole filling (inpainting) without learning: a pull-push pyramid.  Reference implementation of the shaders ``fill_*.comp``.

Pull: each coarser pixel is the weighted mean of its four children, and its weight is the sum of theirs, at most 1.  Push: from
the coarsest level down, a pixel is completed to weight 1 from the bilinearly sampled coarser level (Grossman and Dally 1998;
Marroquim et al. 2007).  Measured pixels change only where their weight is below 1 (model/reference/station_weights.py).

Gaps are filled from the background.  A gap wider than the point spacing of the nearer surface cannot belong to that surface,
because the surface would have been measured there.  Therefore, among the four children of the pull and the four samples of the
push, those clearly nearer than the farthest are left out at levels whose pixels are wider than their surface's point spacing.
Both follow from the depth feature (:func:`model.reference.projection.depth_feature`): the difference of two features is a depth
ratio, and a feature alone is the point spacing in pixels.  Both tests are linear ramps in the feature, so that a picture
changes continuously with the camera.

Where points lie far apart in the picture, each is a spot of its own colour, and in a very noisy scan most of what such a spot
shows is noise.  There the weight of a measured pixel is lowered (:func:`averaging_weight`, ``averaging.comp``): pull-push
completes it and the gap around it from its neighbours, as if each were a mean of n points, n growing with the noise.  A surface
then needs n points to fill a gap, so its spacing counts as wider where gaps are filled from the background.  A pixel nearer
than most around it keeps its weight.
"""

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from ..network.network_layout import DEPTH_FEATURE_SCALE
from .fill_constants import (  # fmt: skip
    DENSITY_BLOCK,
    EMPTY_FEATURE,
    FIRST_LEVEL,
    NEAR_DOUBLINGS,
    NEAR_SPREAD,
    NEARER_SCALE,
    NEARER_START,
    NOISE_UNIT,
    Averaging,
    wider_ramp,
)
from .pyramid import bilinear, clamped, quads

DEPTH = 3
"""Channel of the depth feature."""


def pull_push(image: Tensor, mask: Tensor, footprint: float | None = None, widened: float = 0.0) -> Tensor:
    """Fills the pixels outside ``mask``.

    image: (C, H, W) float.  Where C > 3, channel 3 is the depth feature, and all channels are filled from the background.
    mask: (H, W) bool, True where measured, or float weights 0..1 of the measured pixels.  Returns (C, H, W), equal to ``image``
    where the weight is 1; all zeros where nothing is measured.
    footprint: of an orthographic picture, as of :func:`model.reference.fill_constants.wider_ramp`.
    widened: of :meth:`model.reference.fill_constants.Averaging.widening`.
    """
    by_depth = len(image) > DEPTH
    weight = mask.to(image.dtype)
    sums, weights = [image * weight], [weight]
    while max(weights[-1].shape) > 1:
        parts, shares = quads(sums[-1], 0.0), quads(weights[-1], 0.0)
        level = len(weights) - 1
        if by_depth and level >= FIRST_LEVEL:
            kept = background([_feature(part, share) for part, share in zip(parts, shares, strict=True)], level - widened,
                              footprint)
            parts = [keep * part for keep, part in zip(kept, parts, strict=True)]
            shares = [keep * share for keep, share in zip(kept, shares, strict=True)]
        a, b, c, d = shares
        total = (a + b) + (c + d)
        p, q, r, s = parts
        value = (p + q) + (r + s)
        scale = torch.where(total > 1.0, 1.0 / total.clamp_min(1.0), torch.ones_like(total))
        sums.append(value * scale)
        weights.append(total.clamp_max(1.0))
    filled = sums[-1] / weights[-1].clamp_min(1e-20)
    for level in range(len(weights) - 2, -1, -1):
        weight = weights[level]
        gated = by_depth and level + 1 >= FIRST_LEVEL
        filled = sums[level] + (1.0 - weight) * _sampled(filled, weight.shape[0], weight.shape[1], level + 1 - widened if gated
                                                         else None, footprint)
    return filled


def background(features: Sequence[Tensor], level: float, footprint: float | None = None) -> list[Tensor]:
    """Weights 0..1 of four neighbouring samples of a level: 0 where a sample is clearly nearer than the farthest of them and
    the point spacing of its surface is clearly smaller than the level's pixels.  The farthest has weight 1.

    features: four depth features of one shape.  level: 2^level pixels a side.  footprint: as of :func:`pull_push`.
    """
    a, b, c, d = features
    farthest = torch.maximum(torch.maximum(a, b), torch.maximum(c, d))
    nearer = [((farthest - f) * NEARER_SCALE - NEARER_START).clamp(0.0, 1.0) for f in features]
    factor, offset = wider_ramp(level, footprint)
    wider = [(f * factor + offset).clamp(0.0, 1.0) for f in features]
    return [1.0 - n * w for n, w in zip(nearer, wider, strict=True)]


def _feature(part: Tensor, share: Tensor) -> Tensor:
    """Depth feature of a child.  part: (C, H, W) sums.  share: (H, W) their weights."""
    return torch.where(share > 0, part[DEPTH] / share.clamp_min(1e-20), EMPTY_FEATURE)


def _sampled(coarse: Tensor, height: int, width: int, level: float | None, footprint: float | None) -> Tensor:
    """Samples a filled coarser level at the finer level's pixel centres: bilinear, borders repeated, background only.

    coarse: (C, h, w).  level: of ``coarse``; None: bilinear without a test.  The weights are 9, 3, 3, 1 of 16, as in
    :func:`model.reference.pyramid.bilinear`.
    """
    if level is None:
        return bilinear(coarse, height, width)
    columns = []
    for side in (-1, 1):
        rows = []
        for vertical in (-1, 1):
            a, b = coarse, clamped(coarse, side, 0)
            c, d = clamped(coarse, 0, vertical), clamped(coarse, side, vertical)
            i, j, k, m = background([x[DEPTH] for x in (a, b, c, d)], level, footprint)
            i, j, k = 9.0 * i, 3.0 * j, 3.0 * k
            total = (i + j) + (k + m)
            rows.append(((i * a + j * b) + (k * c + m * d)) / total)
        columns.append(torch.stack(rows, -2).flatten(-3, -2))
    return torch.stack(columns, -1).flatten(-2)[..., :height, :width]


def averaging_weight(confidence: Tensor, sigma: Tensor, feature: Tensor, averaging: Averaging) -> Tensor:
    """(H, W) weight 0..1 of each pixel in the fill.

    confidence: (H, W) 0..1, 0 where nothing is measured.  sigma: (H, W) standard deviation of a pixel's mean colour, full
    brightness = 1.  feature: (H, W) depth feature.
    """
    density, mean, spread = _surroundings(confidence > 0, feature)
    apart = 1.0 / density.clamp_min(1e-6)  # square of the distance between points, pixels
    scale = 1.0 / (averaging.sparse**2 - averaging.dense**2)
    sparse = ((apart - averaging.dense**2) * scale).clamp(0.0, 1.0)
    near = (mean - feature - NEAR_SPREAD * spread) * (1.0 / (NEAR_DOUBLINGS * DEPTH_FEATURE_SCALE))
    averaged = sparse * (1.0 - near.clamp(0.0, 1.0))
    return confidence / (1.0 + averaged * NOISE_UNIT**-2 * sigma.square())


def _surroundings(kept: Tensor, feature: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Share of measured pixels around each, and mean and standard deviation of their depth feature, (H, W) each: of blocks,
    interpolated between their centres, borders repeated."""
    height, width = kept.shape
    own = kept.to(torch.float32)
    planes = torch.stack([own, own * feature, own * feature.square(), torch.ones_like(own)])
    *sums, pixels = F.avg_pool2d(F.pad(planes, (0, -width % DENSITY_BLOCK, 0, -height % DENSITY_BLOCK)), DENSITY_BLOCK)
    whole = torch.stack(sums)[None] / pixels
    # plane by plane: of several at once, the last bits depend on the number of torch's threads
    around = [F.interpolate(plane[None, None], scale_factor=DENSITY_BLOCK, mode="bilinear", align_corners=False)
              [0, 0, :height, :width] for plane in whole[0]]  # fmt: skip
    density = around[0]
    mean, square = (plane / density.clamp_min(1e-6) for plane in around[1:])
    return density, mean, (square - mean.square()).clamp_min(0.0).sqrt()
