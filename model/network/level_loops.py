"""Compiled loops of the merging of a coarser picture on a CPU: what :mod:`model.network.levels`, the reference implementation,
computes in some forty torch calls, each of which reads and writes the whole picture."""

import numpy as np
import torch

from ..common.jit import compiled
from ..common.process.processors import in_rows
from .levels import (  # fmt: skip
    APART,
    CLOSE,
    CONFIDENCE,
    DENSITY_BLOCK,
    DEPTH,
    FEW,
    HIGH_PER_LEVEL,
    HOLE_REACH,
    MANY,
    MOST_OF_HIGH,
    NOISE,
    SAME_SURFACE,
    low_band,
)
from .network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE

_F = np.float32
_LEAST_ROWS = 64
"""Fewest rows of a thread."""


@compiled(nogil=True)
def _halve(packed, made, first, last):
    """Rows ``first`` to ``last`` of :func:`model.network.levels.halved`: made (h, w, C) from packed (H, W, C), float32."""
    height, width, channels = packed.shape
    four = np.empty((4, channels), np.float32)
    weights = np.empty(4, np.float32)
    for v in range(first, last):
        for u in range(made.shape[1]):
            nearest = _F(2.0 * DEPTH_FEATURE_LIMIT)
            for k in range(4):
                y, x = min(2 * v + k // 2, height - 1), min(2 * u + k % 2, width - 1)
                four[k] = packed[y, x]
                if four[k, CONFIDENCE] > 0:
                    nearest = min(nearest, four[k, DEPTH])
            total, points = _F(0.0), 0
            for k in range(4):
                near = four[k, DEPTH] <= nearest + _F(SAME_SURFACE)
                weights[k] = four[k, CONFIDENCE] if near else _F(0.0)
                total += weights[k]
                points += weights[k] > 0
            for k in range(4):
                weights[k] = weights[k] / total if total > 0 else _F(0.25)
            for c in range(channels):
                made[v, u, c] = ((weights[0] * four[0, c] + weights[1] * four[1, c])
                                 + (weights[2] * four[2, c] + weights[3] * four[3, c]))
            made[v, u, CONFIDENCE] = total / _F(points) if points else _F(0.0)
            made[v, u, DEPTH] = min(made[v, u, DEPTH] + _F(DEPTH_FEATURE_SCALE), _F(DEPTH_FEATURE_LIMIT))
            made[v, u, NOISE] /= _F(np.sqrt(max(points, 1)))


@compiled(nogil=True)
def _change(picture, coarse, change, first, last):
    """Rows ``first`` to ``last`` of what the coarser picture differs by: change (3, h, w).  picture: (H, W, 4).  coarse:
    (h, w, 4)."""
    height, width = picture.shape[0], picture.shape[1]
    for v in range(first, last):
        above, below = picture[2 * v], picture[min(2 * v + 1, height - 1)]
        for u in range(coarse.shape[1]):
            a, b = 2 * u, min(2 * u + 1, width - 1)
            for c in range(3):
                change[c, v, u] = coarse[v, u, c] - _F(0.25) * ((above[a, c] + above[b, c]) + (below[a, c] + below[b, c]))


@compiled(nogil=True)
def _merge(packed, picture, coarse, low, shares, first, last):
    """Rows ``first`` to ``last`` of picture (H, W, 4), merged in place.  packed: (H, W, C).  coarse: (h, w, 4).
    low: (3, h, w).  shares: of :func:`sparse_blocks`."""
    rows, columns = coarse.shape[0], coarse.shape[1]
    width, blocks_down, blocks_across = picture.shape[1], shares.shape[0], shares.shape[1]
    for y in range(first, last):
        v, beside = y // 2, min(max(y // 2 + 2 * (y % 2) - 1, 0), rows - 1)
        place = max((y + 0.5) / DENSITY_BLOCK - 0.5, 0.0)
        top = int(place)
        bottom, down = min(top + 1, blocks_down - 1), _F(place - top)
        for x in range(width):
            across = max((x + 0.5) / DENSITY_BLOCK - 0.5, 0.0)
            left = int(across)
            right, along = min(left + 1, blocks_across - 1), _F(across - left)
            upper = shares[top, left] + along * (shares[top, right] - shares[top, left])
            lower = shares[bottom, left] + along * (shares[bottom, right] - shares[bottom, left])
            share = upper + down * (lower - upper)
            if share <= 0:
                continue
            u, next_to = x // 2, min(max(x // 2 + 2 * (x % 2) - 1, 0), columns - 1)
            high = min(max(packed[y, x, NOISE] * _F(HIGH_PER_LEVEL), _F(0.0)), _F(MOST_OF_HIGH))
            for c in range(3):
                smooth = _F(0.0625) * ((_F(9.0) * low[c, v, u] + _F(3.0) * low[c, v, next_to])
                                       + (_F(3.0) * low[c, beside, u] + low[c, beside, next_to]))
                other = _F(0.0625) * ((_F(9.0) * coarse[v, u, c] + _F(3.0) * coarse[v, next_to, c])
                                      + (_F(3.0) * coarse[beside, u, c] + coarse[beside, next_to, c]))
                value = picture[y, x, c]
                value += share * (smooth + high * (other - value - smooth))
                picture[y, x, c] = min(max(value, _F(0.0)), _F(1.0))


def sparse_blocks(packed: np.ndarray) -> np.ndarray:
    """(h, w) float32 of :func:`model.network.levels.sparse`.  packed: (H, W, C) float32."""
    (height, width), side = packed.shape[:2], DENSITY_BLOCK
    rows, columns = -(-height // side), -(-width // side)
    kept, inside = np.zeros((2, rows * side, columns * side), np.uint8)
    np.greater(packed[..., CONFIDENCE], 0, out=kept[:height, :width], casting="unsafe")
    inside[:height, :width] = 1

    def counts(pixels: np.ndarray) -> np.ndarray:
        down = pixels.reshape(rows, side, -1).sum(1, dtype=np.uint8)  # of bytes first: a tenth of the time of a loop
        return down.reshape(rows, columns, side).sum(2, dtype=np.int32)

    def around(blocks: np.ndarray) -> np.ndarray:
        sums = np.pad(blocks, HOLE_REACH)
        for axis in (0, 1):
            sums = np.lib.stride_tricks.sliding_window_view(sums, 2 * HOLE_REACH + 1, axis).sum(-1)
        return sums

    held, whole = counts(kept), counts(inside)
    density = np.where(held > 0, held / whole, around(held) / around(whole))
    shares = np.clip((CLOSE**-2 - density) / (CLOSE**-2 - APART**-2), 0.0, 1.0).astype(np.float32) * (density > 0)
    many = (float(shares.mean()) - FEW) / (MANY - FEW)
    return shares * np.float32(min(max(many, 0.0), 1.0))


def halved_pixels(packed: np.ndarray) -> np.ndarray:
    """(h, w, C) float32 of :func:`model.network.levels.halved`.  packed: (H, W, C) float32."""
    made = np.empty((*(-(-side // 2) for side in packed.shape[:2]), packed.shape[2]), np.float32)
    in_rows(len(made), _LEAST_ROWS, _halve, packed, made)
    return made


def merge(packed: np.ndarray, picture: np.ndarray, coarse: np.ndarray, shares: np.ndarray) -> None:
    """Merges picture (H, W, 4) in place with the coarser one, (h, w, 4).  All float32; packed, shares: as above."""
    change = np.empty((3, *coarse.shape[:2]), np.float32)
    in_rows(len(coarse), _LEAST_ROWS, _change, picture, coarse, change)
    low = low_band(torch.from_numpy(change)[None])[0].numpy()
    in_rows(len(picture), _LEAST_ROWS, _merge, packed, picture, coarse, low, shares)
