"""The bounding box of a cell's points, in sixteenths of the cell.

A wall fills a thin slice of the cells it crosses.  Culling uses this box instead of the cell: for the view frustum, the nearest
depth and occlusion.
"""

import numpy as np

SHARE_BITS = 4
SHARES = 1 << SHARE_BITS
"""Parts of a cell's side: the largest power of two of which the marks of three axes fit 64 bits."""
WHOLE = np.array([0, 0, 0, SHARES - 1, SHARES - 1, SHARES - 1], np.uint8)
"""The box of a cell about which nothing is known."""


def boxes_of(marks: np.ndarray) -> np.ndarray:
    """(C, 6) uint8 for every cell: the first sixteenth that holds a point along x, y and z, and the last.

    marks: (threads, C) int64, of viewer.grid.building.pack_kernels.pack_points: bit SHARES * axis + sixteenth is set where a
    point lies.
    """
    together = np.bitwise_or.reduce(marks, axis=0)
    boxes = np.empty((len(together), 6), np.uint8)
    for axis in range(3):
        held = together >> SHARES * axis & (1 << SHARES) - 1
        held[held == 0] = (1 << SHARES) - 1
        boxes[:, axis] = np.frexp((held & -held).astype(np.float64))[1] - 1  # the exponent: the number of the lowest bit set
        boxes[:, 3 + axis] = np.frexp(held.astype(np.float64))[1] - 1  # of the highest
    return boxes
