"""Compiled loops that tell where the surface of a picture is certain, and how far its measured pixels are apart.

Reference implementation: model/reference/photo_colours.py.  Planes are (H, W).
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import BEND, BEND_AT, BLOCK

_F = np.float32


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
def certain_rows(depth, certain, first, last):
    """Affinity of inverse depth, 0..1, of rows ``first`` to ``last``; the least of 3 x 3 is taken later."""
    height, width = depth.shape
    for y in range(first, last):
        above, here, below = depth[max(y - BEND_AT, 0)], depth[y], depth[min(y + BEND_AT, height - 1)]
        for x in range(width):
            z = here[x]
            if not z > _F(0.0):
                certain[y, x] = _F(0.0)
                continue
            left, right = max(x - BEND_AT, 0), min(x + BEND_AT, width - 1)
            middle = _F(2.0) / z
            bend = abs(_inverse(here[left]) + _inverse(here[right]) - middle)
            bend = max(bend, abs(_inverse(above[x]) + _inverse(below[x]) - middle))
            bend = max(bend, abs(_inverse(above[left]) + _inverse(below[right]) - middle))
            bend = max(bend, abs(_inverse(above[right]) + _inverse(below[left]) - middle))
            certain[y, x] = min(max(_F(2.0) - bend * z * _F(1.0 / BEND), _F(0.0)), _F(1.0))


@compiled(nogil=True)
def least_rows(certain, least, first, last):
    """The least of 3 x 3 pixels of ``certain``, of rows ``first`` to ``last``."""
    height, width = certain.shape
    line = np.empty(width, np.float32)
    for y in range(first, last):
        above, here, below, made = certain[max(y - 1, 0)], certain[y], certain[min(y + 1, height - 1)], least[y]
        for x in range(width):
            line[x] = min(min(above[x], here[x]), below[x])
        made[0], made[width - 1] = line[0], line[width - 1]
        inner, left, right, middle = made[1:-1], line[:-2], line[2:], line[1:-1]
        for x in range(len(inner)):
            inner[x] = min(min(left[x], right[x]), middle[x])
        if width > 1:
            made[0], made[width - 1] = min(line[0], line[1]), min(line[width - 1], line[width - 2])


@compiled(nogil=True, inline="always")
def _inverse(z):
    return _F(1.0) / z if z > _F(0.0) else _F(0.0)
