"""Where in its cell a cell's points lie: the box of sixteenths that holds them all.

A wall fills a thin slice of the cells it crosses.  What is certain of a cell, whether it touches the picture, how near it
comes, whether all of it hides behind something, is judged by this box instead of the cell's own.
"""

import numpy as np

SHARE_BITS = 4
SHARES = 1 << SHARE_BITS
"""Of a cell's side."""
WHOLE = np.array([0, 0, 0, SHARES - 1, SHARES - 1, SHARES - 1], np.uint8)
"""The box of a cell of which nothing is known."""


def boxes_of(marks: np.ndarray) -> np.ndarray:
    """(C, 6) uint8 of every cell: the first sixteenth that holds a point along x, y and z, and the last.

    marks: (threads, C) int64, from viewer.grid.kernels.pack_points: bit SHARES * axis + sixteenth is set where there is one.
    """
    together = np.bitwise_or.reduce(marks, axis=0)
    boxes = np.empty((len(together), 6), np.uint8)
    for axis in range(3):
        held = together >> SHARES * axis & (1 << SHARES) - 1
        held[held == 0] = (1 << SHARES) - 1
        boxes[:, axis] = np.frexp((held & -held).astype(np.float64))[1] - 1  # the exponent: the number of the lowest bit set
        boxes[:, 3 + axis] = np.frexp(held.astype(np.float64))[1] - 1  # of the highest
    return boxes
