"""Hole or background: how opaque each empty pixel is to be.  Reference implementation of the passes of ``surround_*.comp``.

A gap of a few pixels is a hole where, in blocks of 2 or 4 pixels, of each two consecutive neighbours at least one holds a
measured pixel.  A larger one is a hole where something is measured in each of sixteen directions: in a window that grows
with its distance, at any of several distances, so that a hole may be nearer to one of its sides.  The largest is a share of
the picture's side, so that pictures of any size are answered alike.  In the open the picture does not decide alone: the ray of
such a gap must touch a part of the world that holds points, and a ray that meets the middle of a surface is a hole whatever is
around it (model/ray_march.py).  That is asked at cells of 4 pixels; smoothed and interpolated at pixels, the answer has no
corners of its own, and its edge is soft.  Each window meets the one beside it, so that no gap wide enough to see through goes
unseen; beyond the picture what lies at its border goes on.

In blocks of up to 64 pixels, as before, the answer had these blocks' corners (a square of leaves beside a statue), and a
margin along the border of a picture stayed empty wherever points were sparse.  Eight directions, or of each two consecutive
ones only one, filled what one sees through between pipes.
"""

import torch
import torch.nn.functional as F
from torch import Tensor

from model.hole_constants import (
    AROUND,
    BACKGROUND_BELOW,
    COVER_SLOPE,
    FINE_LEVELS,
    MOST,
    OPAQUE,
    SMOOTH,
    fine_levels,
    strides,
    window_reach,
)  # fmt: skip
from model.pyramid import RING, clamped, parents, quads, shifted
from model.ray_march import RAY_BLOCK, TOUCHED, WITHIN


def coverage(mask: Tensor, met: Tensor | None = None) -> Tensor:
    """(H, W) float32 0..1, in steps of 1 / OPAQUE: how opaque each pixel is to be; 1 where measured, 0 in the background.

    mask: (H, W) bool, the measured pixels.  met: (h, w) uint8 of :func:`model.ray_march.march`, one for RAY_BLOCK pixels a
    side; None: the picture decides alone.
    """
    height, width = mask.shape
    held = _blocks(mask)
    inside = torch.zeros_like(held[-1])
    for level in reversed(held[1 : 1 + fine_levels(width, height)]):
        inside = torch.maximum(parents(inside, *level.shape), _between_neighbours(level))
    level = ((_around(held[-1], mask, met) - BACKGROUND_BELOW) * COVER_SLOPE).clamp(0.0, OPAQUE)
    soft = torch.floor(level + 0.5) / OPAQUE
    return torch.where(mask | (parents(inside, height, width) > 0), torch.ones(()), soft)


def surrounded(mask: Tensor, met: Tensor | None = None) -> Tensor:
    """(H, W) bool: pixels that are more opaque than not.  mask, met: as in :func:`coverage`."""
    return coverage(mask, met) > 0.5


def far_inside(mask: Tensor, met: Tensor | None = None) -> Tensor:
    """(H, W) bool: pixels, measured or not, near which all cells are holes or lie within a surface.

    Nothing can be seen through there: the network may open an outline, but no such pixel.
    """
    return _around(_blocks(mask)[-1], mask, met) == MOST


def _blocks(mask: Tensor) -> list[Tensor]:
    """The mask, and 1 for each block of 2x2, of 4x4 pixels that holds a measured one."""
    held = [mask.to(torch.float32)]
    for _ in range(FINE_LEVELS):
        a, b, c, d = quads(held[-1], 0.0)
        held.append(torch.maximum(torch.maximum(a, b), torch.maximum(c, d)))
    return held


def _around(cells: Tensor, mask: Tensor, met: Tensor | None) -> Tensor:
    """(H, W), of MOST: how many of the cells around a pixel are holes."""
    holes = _seen_around(cells, strides(mask.shape[1], mask.shape[0]))
    if met is not None:
        shift = RAY_BLOCK >> FINE_LEVELS
        ray = met.repeat_interleave(shift, 0).repeat_interleave(shift, 1)[: cells.shape[0], : cells.shape[1]]
        holes = torch.where(ray == WITHIN, torch.ones(()), torch.where(ray == TOUCHED, holes, torch.zeros(())))
    return _at_pixels(holes, mask)


def _between_neighbours(level: Tensor) -> Tensor:
    """(h, w) 1 where of each two consecutive neighbours of the eight at least one is held; nothing is beyond the border."""
    ring = [shifted(level, dx, dy, 0.0) for dx, dy in RING]
    pairs = [torch.maximum(ring[k], ring[(k + 1) % 8]) for k in range(8)]
    return torch.stack(pairs).amin(0)


def _seen_around(cells: Tensor, distances: list[int]) -> Tensor:
    """(h, w) 1 where something is seen in each direction, at any of the distances."""
    seen = torch.zeros(len(AROUND), *cells.shape)
    for stride in distances:
        reach = window_reach(stride)
        window = F.max_pool2d(cells[None, None], 2 * reach + 1, stride=1, padding=reach)[0, 0]
        here = [clamped(window, dx * stride, dy * stride) for dx, dy in AROUND]
        seen = torch.maximum(seen, torch.stack(here))
    return seen.amin(0)


def _at_pixels(cells: Tensor, mask: Tensor) -> Tensor:
    """(H, W) of (h, w): smoothed, then bilinear at the pixels' centres, of MOST."""
    for axis in (1, 0):
        taps = range(-(len(SMOOTH) // 2), len(SMOOTH) // 2 + 1)
        moved = [clamped(cells, tap, 0) if axis else clamped(cells, 0, tap) for tap in taps]
        cells = torch.stack([tap * weight for tap, weight in zip(moved, SMOOTH, strict=True)]).sum(0)
    return _four_times(_four_times(cells, -2), -1)[: mask.shape[0], : mask.shape[1]]


def _four_times(cells: Tensor, axis: int) -> Tensor:
    """Linear between the cells' centres, 4 pixels a cell along an axis, the border repeated."""
    before, after = (clamped(cells, side, 0) if axis == -1 else clamped(cells, 0, side) for side in (-1, 1))
    parts = [(before, 3 / 8), (before, 1 / 8), (after, 1 / 8), (after, 3 / 8)]
    pixels = torch.stack([cells * (1 - share) + beside * share for beside, share in parts], axis if axis == -1 else -2)
    return pixels.flatten(-2) if axis == -1 else pixels.flatten(-3, -2)
