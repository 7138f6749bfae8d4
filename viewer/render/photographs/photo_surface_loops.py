"""Compiled loops that tell where the surface of a picture is certain, and how far its measured pixels are apart.

Reference implementation: model/reference/photo_colours.py, whose constants are compiled in.  Planes are (H, W).
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import BEND, BEND_AT, BLOCK, NORMAL_AT, SPARSE
from .photo_tile_loops import AHEAD_X, AHEAD_Y, ALONG_X, ALONG_Y, SPACING, SURE, TILE, X, Y, Z

_F = np.float32
APRON = 3
"""Pixels around a tile that its surface depends on: BEND_AT and one for the least of 3 x 3, or NORMAL_AT."""
SIDE = TILE + 2 * APRON
LINE = SIDE + 2
"""Values from one row of a tile and its surroundings to the next."""
SURROUNDINGS = SIDE * LINE + 16
_INVERSES, _CERTAIN = SURROUNDINGS, 2 * SURROUNDINGS


@compiled(nogil=True)
def count_measured(measured, grid):
    """grid: (ceil(H / BLOCK), ceil(W / BLOCK)) float32, pixels between measured pixels around each block.  measured: 0 or
    more."""
    height, width = measured.shape
    rows, columns = grid.shape
    counts = np.zeros((rows + 2, columns + 2), np.int32)
    for y in range(height):
        line, row = measured[y], counts[y // BLOCK + 1]
        for x in range(width):
            row[x // BLOCK + 1] += 1 if line[x] > 127 else 0
    for j in range(rows):
        down = min((j + 2) * BLOCK, height) - max((j - 1) * BLOCK, 0)
        for i in range(columns):
            across = min((i + 2) * BLOCK, width) - max((i - 1) * BLOCK, 0)
            total = 0
            for k in range(3):
                total += counts[j + k, i] + counts[j + k, i + 1] + counts[j + k, i + 2]
            grid[j, i] = np.sqrt(_F(down * across) / _F(max(total, 1)))


@compiled(nogil=True)
def surface(depth, grid, lens, top, left, around, s):
    """Planes of a tile of photo_tile_loops: x / z, y / z, z, differences, certainty and spacing.  Returns whether the surface
    of any pixel is certain.

    around: (3 * SURROUNDINGS,) float32, working memory: depth around the tile, inverse depth, certainty."""
    height, width = depth.shape
    inside = (top >= APRON) & (left >= APRON) & (top + TILE + APRON <= height) & (left + TILE + APRON <= width)
    for j in range(SIDE):
        row, at = depth[min(max(top + j - APRON, 0), height - 1)], LINE * j
        if inside:
            part = row[left - APRON : left - APRON + SIDE]
            for i in range(SIDE):
                around[at + i] = part[i]
        else:
            for i in range(SIDE):
                around[at + i] = row[min(max(left + i - APRON, 0), width - 1)]
    for p in range(SIDE * LINE):
        z = around[p]
        around[_INVERSES + p] = _F(1.0) / z if z > _F(0.0) else _F(0.0)
    if not _certain(around):
        return False
    if not inside:
        for j in range(SIDE):
            for i in range(SIDE):
                if not (0 <= top + j - APRON < height and 0 <= left + i - APRON < width):
                    around[_CERTAIN + LINE * j + i] = _F(1.0)
    for p in range(LINE, SIDE * LINE - LINE):
        q = _CERTAIN + p
        around[_INVERSES + p] = min(min(around[q - LINE], around[q]), around[q + LINE])
    _spacings(grid, top, left, s)
    any_certain = 0
    for j in range(TILE):
        here = top + j < height
        for i in range(TILE):
            p, k = _INVERSES + LINE * (j + APRON) + APRON + i, TILE * j + i
            sure = min(min(around[p - 1], around[p]), around[p + 1])
            sure *= min((_F(SPARSE[1]) - s[SPACING + k]) * _F(1.0 / (SPARSE[1] - SPARSE[0])), _F(1.0))
            sure = sure if here & (left + i < width) else _F(0.0)
            s[SURE + k] = max(sure, _F(0.0))
            any_certain += 1 if sure > _F(0.0) else 0
    if any_certain == 0:
        return False
    fx, fy, cx, cy = lens[0], lens[1], lens[2] - _F(0.5), lens[3] - _F(0.5)
    last, lowest = _F(width - 1), _F(height - 1)
    for j in range(TILE):
        y = _F(top + j)
        v = (y - cy) / fy
        above, below = (max(y - _F(NORMAL_AT), _F(0.0)) - cy) / fy, (min(y + _F(NORMAL_AT), lowest) - cy) / fy
        for i in range(TILE):
            p, k, x = LINE * (j + APRON) + APRON + i, TILE * j + i, _F(left + np.int32(i))
            z, zl, zr = around[p], around[p - NORMAL_AT], around[p + NORMAL_AT]
            zu, zd = around[p - NORMAL_AT * LINE], around[p + NORMAL_AT * LINE]
            before, after = (max(x - _F(NORMAL_AT), _F(0.0)) - cx) / fx, (min(x + _F(NORMAL_AT), last) - cx) / fx
            s[X + k], s[Y + k], s[Z + k] = (x - cx) / fx, v, z if z > _F(0.0) else _F(1.0)
            s[ALONG_X + k], s[AHEAD_X + k] = after * zr - before * zl, zr - zl
            s[ALONG_Y + k], s[AHEAD_Y + k] = below * zd - above * zu, zd - zu
    return True


@compiled(nogil=True)
def _certain(around):
    """Affinity of inverse depth, 0..1, around a tile.  Returns whether it is above 0 anywhere."""
    any_certain = 0
    for p in range(BEND_AT * (LINE + 1), SIDE * LINE - BEND_AT * (LINE + 1)):
        q = _INVERSES + p
        middle = around[q] + around[q]
        bend = abs(around[q - BEND_AT] + around[q + BEND_AT] - middle)
        bend = max(bend, abs(around[q - BEND_AT * LINE] + around[q + BEND_AT * LINE] - middle))
        bend = max(bend, abs(around[q - BEND_AT * (LINE + 1)] + around[q + BEND_AT * (LINE + 1)] - middle))
        bend = max(bend, abs(around[q - BEND_AT * (LINE - 1)] + around[q + BEND_AT * (LINE - 1)] - middle))
        z = around[p]
        sure = min(max(_F(2.0) - bend * z * _F(1.0 / BEND), _F(0.0)), _F(1.0))
        sure = sure if z > _F(0.0) else _F(0.0)
        around[_CERTAIN + p] = sure
        any_certain += 1 if sure > _F(0.0) else 0
    return any_certain > 0


@compiled(nogil=True)
def _spacings(grid, top, left, s):
    """Pixels between measured pixels of a tile: the grid between the middles of its cells, its border repeated."""
    rows, columns = grid.shape
    column = left // BLOCK
    one, two = min(max(column - 1, 0), columns - 1), min(column, columns - 1)
    three, four = min(column + 1, columns - 1), min(column + 2, columns - 1)
    for j in range(TILE):
        y = (_F(top + j) + _F(0.5)) * _F(1.0 / BLOCK) - _F(0.5)
        up, k = int(np.floor(y)), TILE * j
        t = y - _F(up)
        upper, lower = grid[min(max(up, 0), rows - 1)], grid[min(up + 1, rows - 1)]
        a, b = upper[one] + (lower[one] - upper[one]) * t, upper[two] + (lower[two] - upper[two]) * t
        c, d = upper[three] + (lower[three] - upper[three]) * t, upper[four] + (lower[four] - upper[four]) * t
        for i in range(BLOCK // 2):
            s[SPACING + k + i] = a + (b - a) * (_F(i + BLOCK // 2) + _F(0.5)) * _F(1.0 / BLOCK)
        for i in range(BLOCK):
            s[SPACING + k + BLOCK // 2 + i] = b + (c - b) * (_F(i) + _F(0.5)) * _F(1.0 / BLOCK)
        for i in range(BLOCK // 2):
            s[SPACING + k + 3 * BLOCK // 2 + i] = c + (d - c) * (_F(i) + _F(0.5)) * _F(1.0 / BLOCK)
