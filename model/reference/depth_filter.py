"""The depth filter: keeps the pixels of the foremost surface.  Reference implementation of the passes ``filter_*.comp``.

``auto`` is our filter.  It works on inverse depth w = 1/z (0 where empty), in which a plane is affine.  A pyramid stores the
nearest point of each block (maximum of w) and the number of level-0 pixels that support the block's front surface.  At every
level a pixel is hidden if the eight blocks around its own hold something clearly nearer in every direction: at least one of
each two consecutive blocks of the ring.  "Clearly" allows a relative tolerance and the slope of the surface around.  A level
decides only where the surface in front is so sparse that a gap of one finer block may be chance, or where the block holds that
surface itself; where the surface is dense, a gap is a real opening.  Where the points in front are few but clumped in few finer
blocks, they are thin things or of several surfaces: there, and at coarse levels, only what is much farther is hidden.  At a
silhouette the nearer surface lies on one side only, so the background beside it is kept at any level.  Beyond the picture's
border nothing is known; at the levels MIRRORED the picture is mirrored there, because otherwise hidden points in the outermost
pixels would be kept.  No threshold has a unit.

``paper-code`` follows the published program, ``paper-text`` the paper's description (Vanherck et al. 2025, "Depth
filtering"), ``npbg++`` the visibility test of Rakhimov et al. 2022.
"""

from functools import partial

import torch
import torch.nn.functional as F
from torch import Tensor

from .filter_constants import (  # fmt: skip
    CLUMPED,
    EDGE,
    EMPTY,
    LEVELS,
    MIRRORED,
    NPBG_DEPTH,
    PARENT_RATIO,
    SAME_SURFACE,
    STEEPEST,
    SUPPORT,
    SUPPORT_SHARED,
    TWIST,
    hiding_limits,
)
from .pyramid import RING, bilinear, clamped, mirrored_neighbours, neighbours, parents, quads


def keep_mask(depth: Tensor, preset: str = "auto", *, strength: float = 1.0, levels: int | None = None,
              metre: float = 1.0) -> Tensor:
    """(H, W) bool: True where the pixel holds a point of the foremost surface.

    depth: (H, W), view-space z in file units, +inf where empty.  preset: a key of LEVELS, or ``off``.  strength: multiplies the
    preset's depth tolerance; smaller keeps fewer points.  levels: pyramid levels, None: the preset's.  metre: file units in a
    metre, for the presets whose thresholds are metres.  Raises KeyError for an unknown preset.
    """
    if preset == "off":
        return torch.isfinite(depth)
    levels = LEVELS[preset] if levels is None else levels
    if preset == "auto":
        return _auto(depth, strength, levels)
    if preset == "npbg++":
        return _npbg(depth, strength, levels, metre)
    return _parents(depth, strength, levels, metre, published=preset == "paper-code")


def _near_pyramid(depth: Tensor, levels: int) -> tuple[list[Tensor], list[Tensor], list[Tensor]]:
    """For each level: inverse depth of the nearest point in each block; number of level-0 pixels on its surface; and number of
    its four children that hold them (at level 0 the pixel itself)."""
    near = [torch.where(torch.isfinite(depth), 1.0 / depth, torch.zeros_like(depth))]
    support = [(near[0] > 0).to(depth.dtype)]
    children = [support[0]]
    for _ in range(levels):
        a, b, c, d = quad = quads(near[-1], 0.0)
        top = torch.maximum(torch.maximum(a, b), torch.maximum(c, d))
        bottom = torch.minimum(torch.minimum(a, b), torch.minimum(c, d))
        slope = torch.minimum((a - b).abs(), (c - d).abs()) + torch.minimum((a - c).abs(), (b - d).abs())
        planar = (bottom > 0) & (((a - b) - (c - d)).abs() <= TWIST * top) & (slope <= STEEPEST * top)
        limit = top * (1.0 - SAME_SURFACE) - torch.where(planar, slope, torch.zeros_like(slope))
        counts = quads(support[-1], 0.0)
        zero = torch.zeros_like(top)
        on = [torch.where(w >= limit, n, zero) for w, n in zip(quad, counts, strict=True)]
        support.append(sum(on, zero))
        children.append(sum(((n > 0).to(depth.dtype) for n in on), zero))
        near.append(top)
    return near, support, children


def _hiding_threshold(near: Tensor, support: Tensor, children: Tensor, strength: float, level: int) -> Tensor:
    """Inverse depth below which a pixel inside each block is hidden by the blocks around; 0 where the level does not decide."""
    around = mirrored_neighbours if level in MIRRORED else partial(neighbours, empty=0.0)
    ring, counts, occupied = around(near), around(support), around(children)
    front = torch.maximum(ring[0], ring[1])
    for k in range(1, 8):
        front = torch.minimum(front, torch.maximum(ring[k], ring[(k + 1) % 8]))
    east, south_east, south, south_west, west, north_west, north, north_east = ring
    slope = _slope(((east, west), (north_east, north_west), (south_east, south_west)))
    slope = slope + _slope(((south, north), (south_west, north_west), (south_east, north_east)))
    limit = front * (1.0 - SAME_SURFACE)
    shared = near >= limit
    zero = torch.zeros_like(support)
    count, held = torch.where(shared, support, zero), torch.where(shared, children, zero)
    for w, n, o in zip(ring, counts, occupied, strict=True):
        count = count + torch.where(w >= limit, n, zero)
        held = held + torch.where(w >= limit, o, zero)
    # Points at random in 36 children (nine blocks of four) occupy ``held`` of them when they are -36 ln(1 - held / 36), about
    # held + held^2 / 56.  At levels 0 and 1 a child is a pixel, and points are never clumped.
    clumped = 56.0 * count >= CLUMPED * (56.0 * held + held * held)
    share, slope_share, share_clumped = hiding_limits(level, strength)
    threshold = torch.where(clumped, front * share_clumped, front * share) - slope * slope_share
    sparse = (count < 36.0 * SUPPORT) | (shared & (count < 36.0 * SUPPORT_SHARED))
    return torch.where(sparse, threshold.clamp_min(0.0), torch.zeros_like(threshold))


def _slope(pairs) -> Tensor:
    """Smallest difference per block between opposite neighbours that are both occupied; EMPTY where no pair is."""
    best = torch.full_like(pairs[0][0], EMPTY)
    for a, b in pairs:
        best = torch.where((a > 0) & (b > 0), torch.minimum(best, (a - b).abs() * 0.5), best)
    return best


def _auto(depth: Tensor, strength: float, levels: int) -> Tensor:
    pyramid = list(zip(*_near_pyramid(depth, levels), strict=True))
    threshold = _hiding_threshold(*pyramid[-1], strength, levels)
    for i in range(levels - 1, -1, -1):
        own = _hiding_threshold(*pyramid[i], strength, i)
        threshold = torch.maximum(own, parents(threshold, *own.shape))
    near = pyramid[0][0]
    return (near > 0) & (near >= threshold)


def _parents(depth: Tensor, strength: float, levels: int, metre: float, *, published: bool) -> Tensor:
    """Both presets of the paper: compares child with parent from coarse to fine, and refills dropped children."""
    ratio = 1.0 + PARENT_RATIO * strength
    nearest = [torch.where(torch.isfinite(depth), depth, torch.full_like(depth, EMPTY))]
    for _ in range(levels):
        a, b, c, d = quads(nearest[-1], EMPTY)
        nearest.append(torch.minimum(torch.minimum(a, b), torch.minimum(c, d)))
    coarse = nearest[-1]
    keep = coarse < EMPTY
    for fine in reversed(nearest[:-1]):
        edge, farthest = (_edge_published if published else _edge_described)(coarse, metre)
        reference = torch.where(edge, farthest, coarse)
        keep = (fine < EMPTY) & (fine <= ratio * parents(reference, *fine.shape))
        fill = bilinear(coarse, *fine.shape) if published else _bilinear_known(coarse, *fine.shape)
        coarse = torch.where(keep, fine, fill)
    return keep


def _edge_published(coarse: Tensor, metre: float) -> tuple[Tensor, Tensor]:
    """Edges as in the published code: absolute threshold, positive side only, empty pixels treated as a huge depth."""
    laplacian = (clamped(coarse, -1, 0) + clamped(coarse, 1, 0)) + (clamped(coarse, 0, -1) + clamped(coarse, 0, 1))
    padded = F.pad(coarse[None, None], (1, 1, 1, 1), mode="replicate")
    return laplacian - 4.0 * coarse > EDGE * metre, F.max_pool2d(padded, 3, 1)[0, 0]


def _edge_described(coarse: Tensor, metre: float) -> tuple[Tensor, Tensor]:
    """Edges as described in the paper: both sides, relative to depth, empty pixels ignored."""
    laplacian, farthest = torch.zeros_like(coarse), coarse
    for dx, dy in RING:
        neighbour = clamped(coarse, dx, dy)
        known = neighbour < EMPTY
        if dx == 0 or dy == 0:
            laplacian = laplacian + torch.where(known, neighbour - coarse, torch.zeros_like(coarse))
        farthest = torch.where(known, torch.maximum(farthest, neighbour), farthest)
    return (coarse < EMPTY) & (laplacian.abs() > EDGE * coarse), farthest


def _bilinear_known(coarse: Tensor, height: int, width: int) -> Tensor:
    known = (coarse < EMPTY).to(coarse.dtype)
    weight = bilinear(known, height, width)
    value = bilinear(coarse * known, height, width)
    return torch.where(weight > 0, value / weight.clamp_min(0.0625), torch.full_like(value, EMPTY))


def _npbg(depth: Tensor, strength: float, levels: int, metre: float) -> Tensor:
    """One level: keeps scores exp(zmin - z) above a fixed value, with zmin the nearest depth of the pixel's block."""
    nearest = torch.where(torch.isfinite(depth), depth, torch.full_like(depth, EMPTY))
    fine = nearest
    for _ in range(levels):
        a, b, c, d = quads(nearest, EMPTY)
        nearest = torch.minimum(torch.minimum(a, b), torch.minimum(c, d))
    for _ in range(levels):
        nearest = nearest.repeat_interleave(2, -2).repeat_interleave(2, -1)
    nearest = nearest[..., : depth.shape[-2], : depth.shape[-1]]
    return (fine < EMPTY) & (fine - nearest <= NPBG_DEPTH * strength * metre)
