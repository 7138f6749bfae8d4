"""Averaging in sparse places: how much a measured pixel counts in the fill.  Reference implementation of ``averaging.comp``.

Where points lie far apart in the picture, pull-push shows each as a spot of its own colour.  Of a scan with noisy colours most
of what such a spot shows is noise, so a pixel's weight is lowered there: pull-push then completes it from its neighbours, and
the gap around it too.  The weight is that of a mean of n points, n growing with the noise.  Where points are dense nothing
changes, because there the network, or the eye, averages them; nor in scans of little noise.

A surface needs n points to fill a gap then, so its spacing counts as sqrt(n) times wider where gaps are filled from the
background (:func:`model.reference.averaging_constants.widening`).
"""

import torch
import torch.nn.functional as F
from torch import Tensor

from .averaging_constants import AVERAGED, BLOCK, DENSE, SPARSE, UNIT


def averaging_weight(confidence: Tensor, sigma: Tensor) -> Tensor:
    """(H, W) weight 0..1 of each pixel in the fill.

    confidence: (H, W) 0..1, 0 where nothing is measured.  sigma: (H, W) standard deviation of a pixel's mean colour, full
    brightness = 1.
    """
    apart = 1.0 / _density(confidence > 0).clamp_min(1e-6)  # square of the distance between points, pixels
    sparse = ((apart - DENSE**2) * (1.0 / (SPARSE**2 - DENSE**2))).clamp(0.0, 1.0)
    return confidence / (1.0 + sparse * (AVERAGED / UNIT**2) * sigma.square())


def _density(kept: Tensor) -> Tensor:
    """(H, W) share of measured pixels around each: of blocks, interpolated between their centres, borders repeated."""
    height, width = kept.shape
    padded = F.pad(torch.stack([kept.float(), torch.ones(height, width)]), (0, -width % BLOCK, 0, -height % BLOCK))
    held, pixels = F.avg_pool2d(padded, BLOCK)
    whole = (held / pixels)[None, None]
    return F.interpolate(whole, scale_factor=BLOCK, mode="bilinear", align_corners=False)[0, 0, :height, :width]
