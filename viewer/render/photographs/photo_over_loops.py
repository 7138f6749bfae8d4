"""Compiled loops that lay the photographs' colours over the filled picture; reference implementation: over_filled of
model/reference/photo_colours.py.

Pictures are (H, W) uint32, RGBA8.  Where no block around a pixel is contradicted, the mean of none of them can be.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import BLOCK, CONTRADICTED

_F = np.float32


@compiled(nogil=True)
def block_sums(filled, colours, sums, first, last):
    """Writes to sums (rows, columns, 4) float32, of the blocks in rows ``first`` to ``last``, the photographs' colours less the
    filled picture's, times the share of 255, and the share."""
    height, width = filled.shape
    for row in range(first, last):
        for column in range(sums.shape[1]):
            red = green = blue = total = 0
            for y in range(row * BLOCK, min((row + 1) * BLOCK, height)):
                for x in range(column * BLOCK, min((column + 1) * BLOCK, width)):
                    photo, under = np.int64(colours[y, x]), np.int64(filled[y, x])
                    part = photo >> 24
                    red += part * ((photo & 255) - (under & 255))
                    green += part * ((photo >> 8 & 255) - (under >> 8 & 255))
                    blue += part * ((photo >> 16 & 255) - (under >> 16 & 255))
                    total += part
            cell = sums[row, column]
            cell[0], cell[1], cell[2], cell[3] = _F(red), _F(green), _F(blue), _F(total)


@compiled(nogil=True)
def over_rows(filled, colours, sums, made, share, first, last):
    """Writes to made (H, W), and to share (H, W) uint8 how much of each pixel is from photographs, in the rows that lie between
    the middles of rows of blocks, ``first`` to ``last`` of them."""
    height, width = filled.shape
    rows, columns = sums.shape[0], sums.shape[1]
    for row in range(first, last):  # blocks row - 1 and row
        for column in range(columns + 1):
            one, two = sums[max(row - 1, 0), max(column - 1, 0)], sums[max(row - 1, 0), min(column, columns - 1)]
            three, four = sums[min(row, rows - 1), max(column - 1, 0)], sums[min(row, rows - 1), min(column, columns - 1)]
            alike = _agrees(one) and _agrees(two) and _agrees(three) and _agrees(four)
            for y in range(max(row * BLOCK - BLOCK // 2, 0), min(row * BLOCK + BLOCK // 2, height)):
                down = (_F(y - row * BLOCK + BLOCK // 2) + _F(0.5)) * _F(1.0 / BLOCK)
                for x in range(max(column * BLOCK - BLOCK // 2, 0), min(column * BLOCK + BLOCK // 2, width)):
                    photo, under = colours[y, x], filled[y, x]
                    part = _F(np.int32(photo >> np.uint32(24))) * _F(1 / 255)
                    if part > _F(0.0) and not alike:
                        along = (_F(x - column * BLOCK + BLOCK // 2) + _F(0.5)) * _F(1.0 / BLOCK)
                        part *= _uncontradicted(one, two, three, four, along, down)
                    share[y, x] = np.uint8(np.int32(part * _F(255.0) + _F(0.5)))
                    colour = under & np.uint32(0xFF000000)
                    for shift in range(0, 24, 8):
                        a, b = _F(np.int32(under >> np.uint32(shift) & np.uint32(255))), np.int32(photo >> np.uint32(shift))
                        mixed = a + (_F(b & np.int32(255)) - a) * part
                        colour |= np.uint32(np.int32(mixed + _F(0.5))) << np.uint32(shift)
                    made[y, x] = colour


@compiled(nogil=True, inline="always")
def _agrees(cell):
    return max(max(abs(cell[0]), abs(cell[1])), abs(cell[2])) <= _F(CONTRADICTED[0]) * cell[3]


@compiled(nogil=True, inline="always")
def _uncontradicted(one, two, three, four, along, down):
    w1, w2, w3, w4 = (_F(1.0) - along) * (_F(1.0) - down), along * (_F(1.0) - down), (_F(1.0) - along) * down, along * down
    worst, total = _F(0.0), w1 * one[3] + w2 * two[3] + w3 * three[3] + w4 * four[3]
    for k in range(3):
        worst = max(worst, abs(w1 * one[k] + w2 * two[k] + w3 * three[k] + w4 * four[k]))
    apart = worst / max(total, _F(1e-6))
    return min(max((_F(CONTRADICTED[1]) - apart) * _F(1.0 / (CONTRADICTED[1] - CONTRADICTED[0])), _F(0.0)), _F(1.0))
