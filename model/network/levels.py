"""Sparse places: the network also sees the picture at half the size, and the two pictures are merged.

Where points are sparse, gaps are wider than most of those that the network was trained on, and it keeps one spot for each
point.  At half the size the same points lie half as far apart.  As in a Laplacian pyramid (Burt and Adelson 1983), the coarse
picture gives the low band of the sum, and a part of the high band that grows with the noise.  How much of this is applied at a
pixel follows from the distance between the points around it: dense places keep the picture of the full size to the byte.
Measured pixels follow their surroundings, beyond the network's own bound (model.network.unet.KEPT_DEVIATIONS): kept within it,
the distance of rooms without noise is up to .005 larger at one in twenty points.

Reference implementation of ``model/network/level_loops.py``, and what runs on CUDA.  Chosen and judged on seven rooms and the
street corner (assets/weights/README.md).
"""

from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor

from .network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE

LEVELS = 1
"""Coarser sizes that are seen.  A second gains 0.1 dB at one in fifty points of seven rooms, and loses up to 0.06 dB in three
of them at one in twenty."""
CLOSE, APART = 1.8, 2.6
"""Distance between points, pixels, up to which the coarser picture counts for nothing, and from which it counts in full.  From
1.4 on, 5 to 15 % more is gained in rooms with noise at one in twenty points, and many more pictures take the time."""
FEW, MANY = 0.1, 0.2
"""Share of a picture that is sparse up to which it is left as it is, for the time, and from which sparse places count in
full.  Between 0.05 and 0.1 at most 0.002 dB were gained at withheld points of plant_room and studio."""
BAND = 2
"""Pixels of the coarser picture: the low band is the mean over squares of 2 * BAND + 1 of them, taken twice."""
MOST_OF_HIGH = 0.5
"""The largest part of the high band that is taken from the coarser picture.  All of it blurs textures."""
HIGH_PER_LEVEL = 0.625
"""That part, for each unit of the noise level: MOST_OF_HIGH at a standard deviation of 0.04."""
LEAST_SIDE = 32
"""Pixels along a picture's shorter side from which a coarser one is made of it."""
SAME_SURFACE = 0.08 * DEPTH_FEATURE_SCALE
"""Depth feature by which a measured pixel may be farther than the nearest of its four and still be averaged with it: 6 %."""
AROUND = 64
"""Pixels around the sparse part of a picture of which a coarser picture is made, too: a multiple of what the network's blocks
take at half the size, so that they are those of the whole picture."""
DENSITY_BLOCK = 16
"""Side, pixels, of the blocks in which measured pixels are counted."""
HOLE_REACH = 2
"""Blocks around an empty block that tell a hole from a gap between points far apart: squares of 2 * HOLE_REACH + 1, 80 pixels.
A hole in dense surroundings, or one without a point in reach, has nothing to average: in plant_room half of a view may be hole,
where the coarser picture cost its time and lost up to 0.02 dB beside it."""
CONFIDENCE, DEPTH, NOISE = 3, 4, 5
"""Channels of the network's input."""


def sparse(confidence: Tensor) -> Tensor:
    """(B, 1, h, w) share 0..1 of the coarser picture, for each block of DENSITY_BLOCK pixels, by the distance between measured
    pixels; that of an empty block by its surroundings, and 0 where they are empty, too.  confidence: (B, 1, H, W)."""
    height, width = confidence.shape[-2:]
    kept, right, below = (confidence > 0).float(), -width % DENSITY_BLOCK, -height % DENSITY_BLOCK
    held = F.avg_pool2d(F.pad(kept, (0, right, 0, below)), DENSITY_BLOCK)
    whole = F.avg_pool2d(F.pad(torch.ones_like(kept), (0, right, 0, below)), DENSITY_BLOCK)
    around = F.avg_pool2d(F.pad(torch.cat([held, whole], 1), (HOLE_REACH,) * 4), 2 * HOLE_REACH + 1, 1)
    density = torch.where(held > 0, held / whole, around[:, :1] / around[:, 1:])
    shares = ((CLOSE**-2 - density) / (CLOSE**-2 - APART**-2)).clamp(0.0, 1.0) * (density > 0)
    return shares * ((shares.mean() - FEW) / (MANY - FEW)).clamp(0.0, 1.0)


def halved(x: Tensor) -> Tensor:
    """The network's input at half the size: (B, C, h, w).

    x: (B, C, H, W) float32, the channels of model.network.network_layout.  A pixel is the weighted mean of those of its four
    that belong to the nearest measured surface, and of all four where none is measured.
    """
    even = _even(x)
    parts = [even[..., row::2, column::2] for row in (0, 1) for column in (0, 1)]
    far = torch.full_like(parts[0][:, DEPTH], 2.0 * DEPTH_FEATURE_LIMIT)
    depths = [torch.where(part[:, CONFIDENCE] > 0, part[:, DEPTH], far) for part in parts]
    limit = torch.stack(depths).amin(0) + SAME_SURFACE
    weights = torch.stack([part[:, CONFIDENCE] * (part[:, DEPTH] <= limit) for part in parts])
    total, points = weights.sum(0), (weights > 0).sum(0)
    weights = torch.where(total > 0, weights / total.clamp_min(1e-6), 0.25)
    made = torch.stack([weight[:, None] * part for weight, part in zip(weights, parts, strict=True)]).sum(0)
    made[:, CONFIDENCE] = torch.where(total > 0, total / points.clamp_min(1), 0.0)
    made[:, DEPTH] = (made[:, DEPTH] + DEPTH_FEATURE_SCALE).clamp_max(DEPTH_FEATURE_LIMIT)  # the focal length is halved, too
    made[:, NOISE] *= points.clamp_min(1).to(x.dtype).rsqrt()
    return made


def region(blocks: Tensor, height: int, width: int) -> tuple[slice, slice]:
    """Rows and columns of the part of a picture that a coarser one changes, with AROUND pixels around it.  blocks: (h, w) of
    :func:`sparse`, not 0 everywhere."""
    found = []
    for axis, side in ((1, height), (0, width)):
        held = torch.nonzero(blocks.any(dim=axis)).flatten()
        first, last = int(held[0]) * DENSITY_BLOCK - AROUND, (int(held[-1]) + 1) * DENSITY_BLOCK + AROUND
        found.append(slice(max(first, 0), min(last, side)))
    return found[0], found[1]


def merged(network: Callable[[Tensor], Tensor], x: Tensor, levels: int = LEVELS) -> Tensor:
    """The network's picture of ``x`` with what it sees at ``levels`` coarser sizes: (1, 3 or more, H, W).

    network: (1, C, H, W) -> (1, 3 or more, H, W): red, green, blue, and channels that are kept as they are.  x: its input.
    On a CPU the coarser picture is made only of the part that is sparse; on CUDA of all, because the answer would have to be
    waited for.
    """
    full, (height, width) = network(x), x.shape[-2:]
    if levels == 0 or min(height, width) < LEAST_SIDE:
        return full
    blocks = sparse(x[:, CONFIDENCE : CONFIDENCE + 1])
    rows, columns = slice(0, height), slice(0, width)
    if x.device.type == "cpu":
        if not bool(blocks.any()):
            return full
        rows, columns = region(blocks[0, 0], height, width)
    share = F.interpolate(blocks, scale_factor=DENSITY_BLOCK, mode="bilinear", align_corners=False)[..., rows, columns]
    picture, wide = full[:, :3, rows, columns].float(), x[..., rows, columns].float()
    coarse = merged(network, halved(wide).to(x.dtype), levels - 1)[:, :3].float()
    high = (wide[:, NOISE : NOISE + 1] * HIGH_PER_LEVEL).clamp(0.0, MOST_OF_HIGH)
    low = low_band(coarse - F.avg_pool2d(_even(picture), 2))
    low, coarse = (F.interpolate(plane, scale_factor=2, mode="bilinear", align_corners=False) for plane in (low, coarse))
    low, coarse = (plane[..., : wide.shape[2], : wide.shape[3]] for plane in (low, coarse))
    made = full.clone()
    made[:, :3, rows, columns] = (picture + share * (low + high * (coarse - picture - low))).clamp(0.0, 1.0).to(full.dtype)
    return made


def low_band(x: Tensor) -> Tensor:
    """(B, C, h, w) smoothed over BAND, edges repeated."""
    side = 2 * BAND + 1
    return F.avg_pool2d(F.avg_pool2d(F.pad(x, (2 * BAND,) * 4, mode="replicate"), side, 1), side, 1)


def _even(x: Tensor) -> Tensor:
    """(B, C, H, W) with even sides, the last row and column repeated."""
    return F.pad(x, (0, x.shape[-1] & 1, 0, x.shape[-2] & 1), mode="replicate")
