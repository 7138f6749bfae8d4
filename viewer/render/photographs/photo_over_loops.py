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
    columns, byte = sums.shape[1], np.int32(255)
    pixels = np.zeros((4, columns * BLOCK), np.int32)  # sums of a column of a row of blocks
    red, green, blue, total = pixels[0], pixels[1], pixels[2], pixels[3]
    for row in range(first, last):
        pixels[:] = 0
        for y in range(row * BLOCK, min((row + 1) * BLOCK, height)):
            above, below = colours[y], filled[y]
            for x in range(width):
                photo, under = np.int32(above[x]), np.int32(below[x])
                part = photo >> np.int32(24) & byte
                red[x] += part * ((photo & byte) - (under & byte))
                green[x] += part * ((photo >> np.int32(8) & byte) - (under >> np.int32(8) & byte))
                blue[x] += part * ((photo >> np.int32(16) & byte) - (under >> np.int32(16) & byte))
                total[x] += part
        for column in range(columns):
            r = g = b = t = np.int32(0)
            for x in range(column * BLOCK, column * BLOCK + BLOCK):
                r, g, b, t = r + red[x], g + green[x], b + blue[x], t + total[x]
            cell = sums[row, column]
            cell[0], cell[1], cell[2], cell[3] = _F(r), _F(g), _F(b), _F(t)


@compiled(nogil=True)
def over_rows(filled, colours, sums, made, share, first, last):
    """Writes to made (H, W), and to share (H, W) uint8 how much of each pixel is from photographs, in the rows that lie between
    the middles of rows of blocks, ``first`` to ``last`` of them."""
    height, width = filled.shape
    rows, columns, byte, half = sums.shape[0], sums.shape[1], np.int32(255), _F(0.5)
    alike, around = np.empty(columns + 1, np.bool_), np.ones((columns + 1) * BLOCK, np.float32)
    counts = around[BLOCK // 2 : BLOCK // 2 + width]
    for row in range(first, last):  # blocks row - 1 and row
        upper, lower, all_alike = sums[max(row - 1, 0)], sums[min(row, rows - 1)], True
        for column in range(columns + 1):
            one, two = max(column - 1, 0), min(column, columns - 1)
            alike[column] = _agrees(upper[one]) and _agrees(upper[two]) and _agrees(lower[one]) and _agrees(lower[two])
            all_alike &= alike[column]
        around[:] = _F(1.0)
        for y in range(max(row * BLOCK - BLOCK // 2, 0), min(row * BLOCK + BLOCK // 2, height)):
            if not all_alike:
                down = (_F(y - row * BLOCK + BLOCK // 2) + half) * _F(1.0 / BLOCK)
                for column in range(columns + 1):
                    if alike[column]:
                        continue
                    one, two = max(column - 1, 0), min(column, columns - 1)
                    part = around[column * BLOCK : column * BLOCK + BLOCK]
                    _between(upper[one], upper[two], lower[one], lower[two], down, part)
            above, below, out, parts = colours[y], filled[y], made[y], share[y]
            for x in range(width):
                photo, under = np.int32(above[x]), np.int32(below[x])
                part = _F(photo >> np.int32(24) & byte) * _F(1 / 255) * counts[x]
                red, green, blue = _F(under & byte), _F(under >> np.int32(8) & byte), _F(under >> np.int32(16) & byte)
                red += (_F(photo & byte) - red) * part
                green += (_F(photo >> np.int32(8) & byte) - green) * part
                blue += (_F(photo >> np.int32(16) & byte) - blue) * part
                colour = np.int32(red + half) | np.int32(green + half) << np.int32(8) | np.int32(blue + half) << np.int32(16)
                out[x] = np.uint32(under & np.int32(-0x1000000) | colour)
            for x in range(width):
                part = _F(np.int32(above[x]) >> np.int32(24) & byte) * _F(1 / 255) * counts[x]
                parts[x] = np.uint8(np.int32(part * _F(255.0) + half))


@compiled(nogil=True, inline="always")
def _agrees(cell):
    return max(max(abs(cell[0]), abs(cell[1])), abs(cell[2])) <= _F(CONTRADICTED[0]) * cell[3]


@compiled(nogil=True)
def _between(one, two, three, four, down, counts):
    """How much photographs count at the BLOCK pixels of a row between the middles of four blocks."""
    r1, g1, b1, t1, r2, g2, b2, t2 = one[0], one[1], one[2], one[3], two[0], two[1], two[2], two[3]
    r3, g3, b3, t3, r4, g4, b4, t4 = three[0], three[1], three[2], three[3], four[0], four[1], four[2], four[3]
    for i in range(BLOCK):
        along = (_F(i) + _F(0.5)) * _F(1.0 / BLOCK)
        w1, w2, w3, w4 = (_F(1.0) - along) * (_F(1.0) - down), along * (_F(1.0) - down), (_F(1.0) - along) * down, along * down
        total = w1 * t1 + w2 * t2 + w3 * t3 + w4 * t4
        worst = max(abs(w1 * r1 + w2 * r2 + w3 * r3 + w4 * r4), abs(w1 * g1 + w2 * g2 + w3 * g3 + w4 * g4))
        worst = max(worst, abs(w1 * b1 + w2 * b2 + w3 * b3 + w4 * b4))
        apart = worst / max(total, _F(1e-6))
        share = (_F(CONTRADICTED[1]) - apart) * _F(1.0 / (CONTRADICTED[1] - CONTRADICTED[0]))
        counts[i] = min(max(share, _F(0.0)), _F(1.0))
