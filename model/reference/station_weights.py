"""View-dependent blending: each point is weighted by the angle between the viewing ray and its scanner's ray.

Glossy walls, lamps and polished floors look different from each scanner position, so the mean of several stations shows a
surface as it looks from none of them.  Weights by the angle between the two rays show it as the nearest station recorded it
(view-dependent texture mapping, Debevec et al. 1998; unstructured lumigraph rendering, Buehler et al. 2001), and highlights
move with the camera.  This needs the scanner positions, which E57 files store and LAS and PLY files do not; without them all
points have the same weight.

Reference implementation of ``shaders/common_stations.glsl`` and ``shaders/confidence.comp``, bit-identical in float32.
"""

import torch
import torch.nn.functional as F
from torch import Tensor

from .station_constants import CONFIDENCE_BLOCK, CONFIDENCE_HALF_SUM, HEAVIEST, UNPLACED


def station_weights(x: Tensor, y: Tensor, z: Tensor, station: Tensor, places: Tensor) -> Tensor:
    """(N,) int64 1..HEAVIEST, the weight of each point.

    x, y, z: (N,) view frame, camera at the origin.  places: (S, 3) scanner positions, view frame, NaN where unknown.
    station: (N,) int64 rows of ``places``; numbers beyond its end mean unknown.
    With c the cosine between the directions to the camera and to the scanner, and d and r the distances to them, the weight is
    30 ((1 + c |c|) / 2)^4 r^2 / (r^2 + d^2), rounded.  The last factor compensates for the higher point density of a near
    scanner.
    """
    places = places.to(x.dtype)
    known = station < len(places)
    sx, sy, sz = places[torch.where(known, station, 0)].unbind(1)
    bx, by, bz = sx - x, sy - y, sz - z
    eye = (x * x + y * y) + z * z
    scanner = (bx * bx + by * by) + bz * bz
    along = (bx * x + by * y) + bz * z
    half = 0.5 - 0.5 * ((along / eye) * (along / scanner).abs())
    square = half * half
    value = ((2.0 * HEAVIEST) * (square * square)) * (scanner / (scanner + eye))
    weight = (value + 0.5).clamp(1.0, HEAVIEST + 0.5).nan_to_num(nan=1.0).long()  # NaN: a point at the camera or the scanner
    return torch.where(known & ~torch.isnan(sx), weight, UNPLACED)


def confidence_of(weight: Tensor, mask: Tensor) -> Tensor:
    """(H, W) float32 0..1 in steps of 1/255: confidence of each kept pixel relative to its neighbours, 0 elsewhere.

    weight: (H, W) int64 total weight of each pixel's points.  mask: (H, W) bool, the kept pixels.  Confidence is the pixel's
    weight (at most HEAVIEST) over the mean weight around it, in which each pixel counts by its own weight, at most 1.  Where
    only one station measured a surface, all its pixels therefore have full confidence, whatever their angle.
    """
    own = weight.clamp(0, HEAVIEST).to(torch.float32) * mask
    first, second = _around(torch.stack([own, own * own]))
    share = ((own * first) / second.clamp_min(1e-30)).clamp_max(1.0)
    return torch.where(own > 0, (share * 255.0 + 0.5).floor() / 255.0, 0.0)


def match_tone(colour: Tensor, confidence: Tensor) -> tuple[Tensor, Tensor]:
    """Shifts less confident pixels to the tone of the more confident pixels around them, and raises the confidence of pixels
    that have few more confident neighbours.

    colour: (3, H, W) integers 0..255.  confidence: (H, W) of :func:`confidence_of`.  Returns both, updated, in the same steps.
    Two stations record different light on one floor, but the same boards.  With the difference of the two local means removed,
    the less confident station's points supply the texture where the more confident station has few points.
    """
    certain = (confidence * 255.0 + 0.5).floor().to(colour.dtype)
    rest = torch.where(certain > 0, 255.0 - certain, 0.0)
    firm = (certain * certain / 256.0 + 0.5).floor()  # squared: many pixels of low confidence must not outweigh few of high
    more, less = (_around(torch.cat([colour * part, part[None]])) for part in (firm, rest))
    apart = more[:3] / more[3].clamp_min(1.0) - less[:3] / less[3].clamp_min(1.0)
    tone = (colour + (rest * apart) / 255.0).clamp(0.0, 255.0)
    raised = certain + rest * (CONFIDENCE_HALF_SUM / (CONFIDENCE_HALF_SUM + more[3]))
    return torch.where(certain > 0, (tone + 0.5).floor(), colour), ((raised + 0.5).floor() / 255.0).to(confidence.dtype)


def _around(pixels: Tensor) -> Tensor:
    """(C, H, W): sums over blocks, interpolated between the blocks' centres, at each pixel."""
    side, (height, width) = CONFIDENCE_BLOCK, pixels.shape[1:]
    padded = F.pad(pixels, (0, -width % side, 0, -height % side))
    blocks = padded.reshape(len(pixels), padded.shape[1] // side, side, -1, side).sum((2, 4))
    return _tent(blocks, height, width)


def _tent(blocks: Tensor, height: int, width: int) -> Tensor:
    """Block sums (C, h, w) interpolated linearly between the blocks' centres at each pixel; borders are repeated."""

    def taps(pixels: int, count: int) -> tuple[Tensor, Tensor, Tensor]:
        at = (torch.arange(pixels, dtype=blocks.dtype, device=blocks.device) + 0.5) / CONFIDENCE_BLOCK - 0.5
        low = at.floor()
        return low.long().clamp(0, count - 1), (low.long() + 1).clamp(0, count - 1), at - low

    top, bottom, down = taps(height, blocks.shape[1])
    left, right, across = taps(width, blocks.shape[2])
    rows = blocks[:, top] * (1.0 - down)[:, None] + blocks[:, bottom] * down[:, None]
    return rows[:, :, left] * (1.0 - across) + rows[:, :, right] * across
