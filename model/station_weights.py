"""Which scanner a colour is taken from: points weigh by how nearly their scanner looked the way the eye looks.

A wall that shines, a lamp's glare, the light on a polished floor: what a scanner photographed is true where it stood, and a
scan of several stations holds every surface as several eyes saw it.  Averaging them shows what nobody saw.  Weights by the
angle between the two lines of sight show it as the nearest eye did (view-dependent texture mapping, Debevec et al. 1998;
unstructured lumigraph rendering, Buehler et al. 2001), and a flight sees highlights move.  Wanted: where each scanner stood,
which an E57 says and LAS and PLY do not; without it all points weigh the same.

Twin of ``shaders/common_stations.glsl`` and ``shaders/trust.comp``, to the bit in float32.
"""

import torch
import torch.nn.functional as F
from torch import Tensor

from model.station_constants import FEW, HEAVIEST, TRUST_BLOCK, UNPLACED


def station_weights(x: Tensor, y: Tensor, z: Tensor, station: Tensor, places: Tensor) -> Tensor:
    """(N,) int64 1..HEAVIEST, the weight of each point.

    x, y, z: (N,) view frame, the eye at its origin.  places: (S, 3) where the scanners stood, view frame, NaN where unknown.
    station: (N,) int64 rows of ``places``; beyond them: unknown.
    With c the cosine between the directions to the eye and to the scanner, d and r the distances to them:
    30 ((1 + c |c|) / 2)^4 r^2 / (r^2 + d^2), rounded.  The last factor takes back that a near scanner leaves more points.
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
    weight = (value + 0.5).clamp(1.0, HEAVIEST + 0.5).nan_to_num(nan=1.0).long()  # NaN: the eye or the scanner itself
    return torch.where(known & ~torch.isnan(sx), weight, UNPLACED)


def trust(weight: Tensor, mask: Tensor) -> Tensor:
    """(H, W) float32 0..1 in steps of 1/255: what each kept pixel counts among those around it, 0 where none is kept.

    weight: (H, W) int64 total weight of each pixel's points.  mask: (H, W) bool.  A pixel is trusted as far as its weight,
    HEAVIEST at most, reaches the mean weight around it, in which each counts by its own weight: where one station alone saw a
    place all are trusted, however badly it stood.
    """
    own = weight.clamp(0, HEAVIEST).to(torch.float32) * mask
    first, second = _around(torch.stack([own, own * own]))
    share = ((own * first) / second.clamp_min(1e-30)).clamp_max(1.0)
    return torch.where(own > 0, (share * 255.0 + 0.5).floor() / 255.0, 0.0)


def toned(colour: Tensor, trusted: Tensor) -> tuple[Tensor, Tensor]:
    """What is trusted less, brought to the tone of what is trusted more around it, and trusted the more the fewer those are.

    colour: (3, H, W) whole numbers 0..255.  trusted: (H, W), as :func:`trust` gives it.  Returns both anew, in the same steps.
    A station that saw a floor from elsewhere saw another light on it, but the same boards: with the difference of the two
    means around taken off, its points show them, where few points of the station that looked from here do.
    """
    certain = (trusted * 255.0 + 0.5).floor().to(colour.dtype)
    rest = torch.where(certain > 0, 255.0 - certain, 0.0)
    firm = (certain * certain / 256.0 + 0.5).floor()  # else the many that are trusted a little outweigh the few
    more, less = (_around(torch.cat([colour * part, part[None]])) for part in (firm, rest))
    apart = more[:3] / more[3].clamp_min(1.0) - less[:3] / less[3].clamp_min(1.0)
    tone = (colour + (rest * apart) / 255.0).clamp(0.0, 255.0)
    settled = certain + rest * (FEW / (FEW + more[3]))
    return torch.where(certain > 0, (tone + 0.5).floor(), colour), ((settled + 0.5).floor() / 255.0).to(trusted.dtype)


def _around(pixels: Tensor) -> Tensor:
    """(C, H, W): sums over blocks, interpolated between the blocks' centres, at each pixel."""
    height, width = pixels.shape[1:]
    padded = F.pad(pixels, (0, -width % TRUST_BLOCK, 0, -height % TRUST_BLOCK))
    blocks = padded.reshape(len(pixels), padded.shape[1] // TRUST_BLOCK, TRUST_BLOCK, -1, TRUST_BLOCK).sum((2, 4))
    return _tent(blocks, height, width)


def _tent(blocks: Tensor, height: int, width: int) -> Tensor:
    """Block sums (C, ., .) interpolated between the blocks' centres, borders repeated, at each pixel."""

    def taps(pixels: int, count: int) -> tuple[Tensor, Tensor, Tensor]:
        at = (torch.arange(pixels, dtype=blocks.dtype, device=blocks.device) + 0.5) / TRUST_BLOCK - 0.5
        low = at.floor()
        return low.long().clamp(0, count - 1), (low.long() + 1).clamp(0, count - 1), at - low

    top, bottom, down = taps(height, blocks.shape[1])
    left, right, across = taps(width, blocks.shape[2])
    rows = blocks[:, top] * (1.0 - down)[:, None] + blocks[:, bottom] * down[:, None]
    return rows[:, :, left] * (1.0 - across) + rows[:, :, right] * across
