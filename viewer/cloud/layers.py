"""Density layers and the order of cells: how many layers, which points in which, cells along the Morton curve.

A point's layer is drawn from a seeded hash of its running number, so it depends on nothing but the file's order.  The points
of one layer and cell, a run, lie in PARTS parts: each takes every PARTS-th of them in the file's order, part after part from
between those before it, so that the first few parts are spread as evenly as the whole.
"""

import numpy as np

COARSEST = 1 << 15
"""Points the coarsest layer should hold."""
MAX_LAYERS = 16
PARTS = 8
_FIRST_OF_PART = np.array([0, 4, 2, 6, 1, 5, 3, 7])  # bits reversed
PART_OF = np.argsort(_FIRST_OF_PART)
"""(PARTS,): the part of a run's point i, by i % PARTS."""
PART_EXTRA = np.array([[(_FIRST_OF_PART[:part] < rest).sum() for part in range(PARTS + 1)] for rest in range(PARTS)])
"""(PARTS, PARTS + 1): in a run of n points part p begins at (n // PARTS) p + PART_EXTRA[n % PARTS, p]; p = PARTS: the end."""


def layer_count(points: int) -> int:
    """Number of layers for a scan: with L layers the coarsest holds points / 2**(L-1) of them."""
    return int(np.clip(1 + np.round(np.log2(max(points, 1) / COARSEST)), 1, MAX_LAYERS))


def layer_sizes(counts: np.ndarray, layers: int) -> np.ndarray:
    """Points by layer and cell, (L, C) int64, from counts by cell and geometric value, (C, G) int64.

    Value 0, half of all points, is the finest layer; what lies beyond the coarsest joins it.
    """
    sizes = np.empty((layers, len(counts)), np.int64)
    for layer in range(1, layers):
        sizes[layer] = counts[:, layers - 1 - layer]
    sizes[0] = counts[:, layers - 1 :].sum(axis=1)
    return sizes


def morton_order(cells: np.ndarray) -> np.ndarray:
    """(C,) indices that sort cells (C, 3) int32, none negative, along the 3-D Morton curve (x the lowest bit)."""
    cells = cells.astype(np.uint64)
    x, y, z = cells.T
    mask, shift = np.uint64(0x1FFFFF), np.uint64(21)
    low = _spread(x & mask) | _spread(y & mask) << np.uint64(1) | _spread(z & mask) << np.uint64(2)
    high = _spread(x >> shift) | _spread(y >> shift) << np.uint64(1) | _spread(z >> shift) << np.uint64(2)
    return np.lexsort((low, high))


def _spread(bits: np.ndarray) -> np.ndarray:
    """Puts two zero bits between the lowest 21 bits of each uint64."""
    for shift, mask in (
        (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249),
    ):  # fmt: skip
        bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
    return bits
