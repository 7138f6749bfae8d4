"""Hole or background: the opacity of each empty pixel.  Reference implementation of the passes of ``hole_*.comp``.

A small gap is a hole where, in blocks of 2 or 4 pixels, of each two consecutive neighbours in the ring of eight at least one
holds a measured pixel.  A larger gap is a hole where measured pixels exist in all 16 directions within a radius: in each
direction a window at one of several distances must hold one, and windows grow with their distance.  The radius is a share of
the picture's side, so that the result does not depend on resolution.  Where the scan is open, the gap's viewing ray must also
pass through an occupied part of the scene, and a ray that meets the middle of a surface marks a hole whatever is around it
(model/reference/ray_march.py).  The test is made at cells of 4 pixels, smoothed and interpolated to pixels, which gives soft
edges without block corners.  Adjacent windows overlap or touch, so that no direction is left out.  Beyond the picture its
border is repeated.

Variants that were tried and dropped: blocks of up to 64 pixels showed their corners (a square of leaves beside a statue) and
left a margin along the picture's border empty where points were sparse; 8 directions, or one of each two consecutive
directions, filled the openings between pipes.
"""

import torch
import torch.nn.functional as F
from torch import Tensor

from .hole_constants import (  # fmt: skip
    BACKGROUND_BELOW,
    COVER_SLOPE,
    DIRECTIONS,
    FINE_LEVELS,
    KERNEL,
    KERNEL_SUM,
    OPACITY_LEVELS,
    fine_levels,
    strides,
    window_reach,
)
from .pyramid import clamped, neighbours, parents, quads
from .ray_march import IN_SURFACE, RAY_BLOCK, TOUCHED


def coverage(mask: Tensor, met: Tensor | None = None) -> Tensor:
    """(H, W) float32 0..1, in steps of 1 / OPACITY_LEVELS: opacity of each pixel, 1 where measured, 0 in the background.

    mask: (H, W) bool, the measured pixels.  met: (h, w) uint8 of :func:`model.reference.ray_march.march`, one for RAY_BLOCK
    pixels a side; None: only the picture is used.
    """
    height, width = mask.shape
    held = _blocks(mask)
    inside = torch.zeros_like(held[-1])
    for level in reversed(held[1 : 1 + fine_levels(width, height)]):
        inside = torch.maximum(parents(inside, *level.shape), _between_neighbours(level))
    level = ((_around(held[-1], mask, met) - BACKGROUND_BELOW) * COVER_SLOPE).clamp(0.0, OPACITY_LEVELS)
    soft = torch.floor(level + 0.5) / OPACITY_LEVELS
    return torch.where(mask | (parents(inside, height, width) > 0), torch.ones(()), soft)


def opaque_pixels(mask: Tensor, met: Tensor | None = None) -> Tensor:
    """(H, W) bool: pixels of more than half opacity.  mask, met: as in :func:`coverage`."""
    return coverage(mask, met) > 0.5


def far_inside(mask: Tensor, met: Tensor | None = None) -> Tensor:
    """(H, W) bool: pixels, measured or not, whose neighbouring cells are all holes or inside a surface.

    No background can be visible there.  The network may open a surface at its outline, but not at these pixels.
    """
    return _around(_blocks(mask)[-1], mask, met) == KERNEL_SUM


def _blocks(mask: Tensor) -> list[Tensor]:
    """The mask as float, then 1 for each block of 2x2 and of 4x4 pixels that holds a measured pixel."""
    held = [mask.to(torch.float32)]
    for _ in range(FINE_LEVELS):
        a, b, c, d = quads(held[-1], 0.0)
        held.append(torch.maximum(torch.maximum(a, b), torch.maximum(c, d)))
    return held


def _around(cells: Tensor, mask: Tensor, met: Tensor | None) -> Tensor:
    """(H, W) smoothed count, out of KERNEL_SUM, of the hole cells around each pixel."""
    holes = _enclosed(cells, strides(mask.shape[1], mask.shape[0]))
    if met is not None:
        shift = RAY_BLOCK >> FINE_LEVELS
        ray = met.repeat_interleave(shift, 0).repeat_interleave(shift, 1)[: cells.shape[0], : cells.shape[1]]
        holes = torch.where(ray == IN_SURFACE, torch.ones(()), torch.where(ray == TOUCHED, holes, torch.zeros(())))
    return _at_pixels(holes, mask)


def _between_neighbours(level: Tensor) -> Tensor:
    """(h, w) 1 where of each two consecutive neighbours in the ring of eight one is occupied; outside the picture none is."""
    ring = neighbours(level, 0.0)
    pairs = [torch.maximum(ring[k], ring[(k + 1) % 8]) for k in range(8)]
    return torch.stack(pairs).amin(0)


def _enclosed(cells: Tensor, distances: list[int]) -> Tensor:
    """(h, w) 1 where each of the 16 directions has an occupied window at one of the distances."""
    seen = torch.zeros(len(DIRECTIONS), *cells.shape)
    for stride in distances:
        reach = window_reach(stride)
        window = F.max_pool2d(cells[None, None], 2 * reach + 1, stride=1, padding=reach)[0, 0]
        here = [clamped(window, dx * stride, dy * stride) for dx, dy in DIRECTIONS]
        seen = torch.maximum(seen, torch.stack(here))
    return seen.amin(0)


def _at_pixels(cells: Tensor, mask: Tensor) -> Tensor:
    """(H, W) from (h, w): smoothed by KERNEL, then bilinear at the pixels' centres; 0..KERNEL_SUM."""
    for axis in (1, 0):
        taps = range(-(len(KERNEL) // 2), len(KERNEL) // 2 + 1)
        moved = [clamped(cells, tap, 0) if axis else clamped(cells, 0, tap) for tap in taps]
        cells = torch.stack([tap * weight for tap, weight in zip(moved, KERNEL, strict=True)]).sum(0)
    return _four_times(_four_times(cells, -2), -1)[: mask.shape[0], : mask.shape[1]]


def _four_times(cells: Tensor, axis: int) -> Tensor:
    """Linear interpolation between the cells' centres along an axis, 4 pixels a cell; the border is repeated."""
    before, after = (clamped(cells, side, 0) if axis == -1 else clamped(cells, 0, side) for side in (-1, 1))
    parts = [(before, 3 / 8), (before, 1 / 8), (after, 1 / 8), (after, 3 / 8)]
    pixels = torch.stack([cells * (1 - share) + beside * share for beside, share in parts], axis if axis == -1 else -2)
    return pixels.flatten(-2) if axis == -1 else pixels.flatten(-3, -2)
