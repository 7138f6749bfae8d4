"""Compiled loops of the merging of a coarser picture on a CPU: what :mod:`model.network.levels`, the reference implementation,
computes in some forty torch calls, each of which reads and writes the whole picture."""

import numpy as np
import torch

from ..common.jit import compiled
from ..common.process.processors import in_rows
from .levels import (  # fmt: skip
    APART,
    BAND,
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
)
from .network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE

_F = np.float32
_LEAST_ROWS = 64
"""Fewest rows of a thread."""


@compiled(nogil=True)
def _halve(packed, made, first, last):
    """Rows ``first`` to ``last`` of :func:`model.network.levels.halved`: made (C, h, w) from packed (C, H, W), float32."""
    channels, height, width = packed.shape
    wide = made.shape[2]
    rows, weights = np.empty((2, channels, 2 * wide), np.float32), np.empty((4, wide), np.float32)
    near, points = np.empty(wide, np.float32), np.empty(wide, np.float32)
    for v in range(first, last):
        for k in range(2):
            for c in range(channels):
                rows[k, c, :width] = packed[c, min(2 * v + k, height - 1)]
                rows[k, c, 2 * wide - 1] = rows[k, c, width - 1]  # the last column repeated, where their number is odd
        near[:] = _F(2.0 * DEPTH_FEATURE_LIMIT)
        for k in range(4):
            depth, kept = rows[k // 2, DEPTH][k % 2 :], rows[k // 2, CONFIDENCE][k % 2 :]
            for u in range(wide):
                near[u] = min(near[u], depth[2 * u]) if kept[2 * u] > _F(0.0) else near[u]
        total = made[CONFIDENCE, v]
        total[:], points[:] = _F(0.0), _F(0.0)
        for k in range(4):
            depth, kept, weight = rows[k // 2, DEPTH][k % 2 :], rows[k // 2, CONFIDENCE][k % 2 :], weights[k]
            for u in range(wide):
                weight[u] = kept[2 * u] if depth[2 * u] <= near[u] + _F(SAME_SURFACE) else _F(0.0)
                total[u] += weight[u]
                points[u] += _F(1.0) if weight[u] > _F(0.0) else _F(0.0)
        for k in range(4):
            weight = weights[k]
            for u in range(wide):
                weight[u] = weight[u] / total[u] if total[u] > _F(0.0) else _F(0.25)
        one, two, three, four = weights[0], weights[1], weights[2], weights[3]
        for c in range(channels):
            if c == CONFIDENCE:
                continue
            upper, lower, out = rows[0, c], rows[1, c], made[c, v]
            for u in range(wide):
                out[u] = ((one[u] * upper[2 * u] + two[u] * upper[2 * u + 1])
                          + (three[u] * lower[2 * u] + four[u] * lower[2 * u + 1]))
        depth, level = made[DEPTH, v], made[NOISE, v]
        for u in range(wide):
            some = max(points[u], _F(1.0))
            total[u] = total[u] / some if points[u] > _F(0.0) else _F(0.0)
            depth[u] = min(depth[u] + _F(DEPTH_FEATURE_SCALE), _F(DEPTH_FEATURE_LIMIT))
            level[u] /= np.sqrt(some)


@compiled(nogil=True)
def _change(picture, coarse, change, first, last):
    """Rows ``first`` to ``last`` of what the coarser picture differs by: change (3, h, w).  picture: (3, H, W).  coarse:
    (3, h, w)."""
    height, width = picture.shape[1], picture.shape[2]
    even, odd = width // 2, width % 2
    for v in range(first, last):
        for c in range(3):
            above, below = picture[c, 2 * v], picture[c, min(2 * v + 1, height - 1)]
            fine, out = coarse[c, v], change[c, v]
            for u in range(even):
                out[u] = fine[u] - _F(0.25) * ((above[2 * u] + above[2 * u + 1]) + (below[2 * u] + below[2 * u + 1]))
            if odd:
                a, b = above[width - 1], below[width - 1]
                out[even] = fine[even] - _F(0.25) * ((a + a) + (b + b))


@compiled(nogil=True)
def _share_row(shares, y, left, along, row):
    """The share of each pixel of row y: between the middles of blocks."""
    place = max((y + 0.5) / DENSITY_BLOCK - 0.5, 0.0)
    top = int(place)
    upper, lower, down = shares[top], shares[min(top + 1, shares.shape[0] - 1)], _F(place - top)
    last = shares.shape[1] - 1
    for x in range(len(row)):
        a, b = left[x], min(left[x] + 1, last)
        high, low = upper[a] + along[x] * (upper[b] - upper[a]), lower[a] + along[x] * (lower[b] - lower[a])
        row[x] = high + down * (low - high)


@compiled(nogil=True)
def _between_row(plane, v, beside, wide, row):
    """A row of a finer picture between the pixels of a coarser one, (h, w), edges repeated: row (2 w,).  wide: scratch,
    (2, w + 2)."""
    count = plane.shape[1]
    for k in range(2):
        line, own = wide[k], plane[v if k == 0 else beside]
        line[1 : count + 1] = own
        line[0], line[count + 1] = own[0], own[count - 1]
    a, left, right = wide[0, 1 : count + 1], wide[0, :count], wide[0, 2:]
    b, left_below, right_below = wide[1, 1 : count + 1], wide[1, :count], wide[1, 2:]
    for u in range(count):
        row[2 * u] = _F(0.0625) * ((_F(9.0) * a[u] + _F(3.0) * left[u]) + (_F(3.0) * b[u] + left_below[u]))
        row[2 * u + 1] = _F(0.0625) * ((_F(9.0) * a[u] + _F(3.0) * right[u]) + (_F(3.0) * b[u] + right_below[u]))


@compiled(nogil=True)
def _merge(noise, picture, coarse, low, shares, first, last):
    """Rows ``first`` to ``last`` of picture (3, H, W), merged in place.  noise: (H, W).  coarse, low: (3, h, w).
    shares: of :func:`sparse_blocks`."""
    rows, width = coarse.shape[1], picture.shape[2]
    left, along, share = np.empty(width, np.int32), np.empty(width, np.float32), np.empty(width, np.float32)
    smooth, other = np.empty(2 * coarse.shape[2], np.float32), np.empty(2 * coarse.shape[2], np.float32)
    wide = np.empty((2, coarse.shape[2] + 2), np.float32)
    for x in range(width):
        across = max((x + 0.5) / DENSITY_BLOCK - 0.5, 0.0)
        left[x] = int(across)
        along[x] = across - left[x]
    for y in range(first, last):
        _share_row(shares, y, left, along, share)
        v, beside, level = y // 2, min(max(y // 2 + 2 * (y % 2) - 1, 0), rows - 1), noise[y]
        for c in range(3):
            _between_row(low[c], v, beside, wide, smooth)
            _between_row(coarse[c], v, beside, wide, other)
            row = picture[c, y]
            for x in range(width):
                high = min(max(level[x] * _F(HIGH_PER_LEVEL), _F(0.0)), _F(MOST_OF_HIGH))
                value = row[x] + share[x] * (smooth[x] + high * (other[x] - row[x] - smooth[x]))
                row[x] = min(max(value, _F(0.0)), _F(1.0)) if share[x] > _F(0.0) else row[x]


@compiled(nogil=True)
def _box_rows(source, made, edge, first, last):
    """Rows ``first`` to ``last`` of means over squares of 2 * BAND + 1: made (3, h, w) from source (3, h, w) with ``edge``
    pixels repeated around it, less 2 * BAND in each direction."""
    height, width, side = source.shape[1], source.shape[2], 2 * BAND + 1
    line, count = np.empty(width + 2 * edge, np.float32), made.shape[2]
    for c in range(3):
        for y in range(first, last):
            out = made[c, y]
            out[:] = _F(0.0)
            for k in range(side):
                line[edge : edge + width] = source[c, min(max(y + k - edge, 0), height - 1)]
                line[:edge], line[edge + width :] = line[edge], line[edge + width - 1]
                for j in range(side):  # in torch's order, for the same bits
                    part = line[j : j + count]
                    for x in range(count):
                        out[x] += part[x]
            for x in range(count):
                out[x] /= _F(side * side)


@compiled(nogil=True)
def _apart(pixels, planes, first, last):
    """Rows ``first`` to ``last`` of planes (3, H, W) from pixels (H, W, 4)."""
    for y in range(first, last):
        row, red, green, blue = pixels[y], planes[0, y], planes[1, y], planes[2, y]
        for x in range(len(red)):
            red[x], green[x], blue[x] = row[x, 0], row[x, 1], row[x, 2]


def planes(pixels: torch.Tensor) -> np.ndarray:
    """(3, H, W) float32 of (H, W, 4) half: by torch alone this takes four times as long."""
    values = pixels.float().contiguous().numpy()
    made = np.empty((3, *values.shape[:2]), np.float32)
    in_rows(len(values), _LEAST_ROWS, _apart, values, made)
    return made


def low_band(x: np.ndarray) -> np.ndarray:
    """(3, h, w) of :func:`model.network.levels.low_band`."""
    (_, height, width), beside = x.shape, 2 * BAND
    once, made = np.empty((3, height + beside, width + beside), np.float32), np.empty(x.shape, np.float32)
    in_rows(height + beside, _LEAST_ROWS, _box_rows, x, once, beside)
    in_rows(height, _LEAST_ROWS, _box_rows, once, made, 0)
    return made


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
    """(C, h, w) float32 of :func:`model.network.levels.halved`.  packed: (C, H, W) float32."""
    channels, height, width = packed.shape
    made = np.empty((channels, -(-height // 2), -(-width // 2)), np.float32)
    in_rows(made.shape[1], _LEAST_ROWS, _halve, packed, made)
    return made


def merge(noise: np.ndarray, picture: np.ndarray, coarse: np.ndarray, shares: np.ndarray) -> None:
    """Merges picture (3, H, W) in place with the coarser one, (3, h, w).  All float32; noise: (H, W), the network's input;
    shares: as above."""
    change = np.empty(coarse.shape, np.float32)
    in_rows(coarse.shape[1], _LEAST_ROWS, _change, picture, coarse, change)
    low = low_band(change)
    in_rows(picture.shape[1], _LEAST_ROWS, _merge, noise, picture, coarse, low, shares)
