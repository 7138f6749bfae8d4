"""Projected coverage: which share of a cell's faces its points cover, which bounds the points that a picture needs.

A cell is a box, and most hold a piece of a wall or floor, which is seen face-on from some viewpoints and edge-on from others.
The faces of each cell are divided into 8 x 8 squares; the coverage of an axis is the number of squares that hold a point when
the cell is projected along it.  Surfaces are taken to be opaque.  Seen along a direction (x, y, z), a cell covers at most the
sum of the three coverages, each weighted by the component of the direction (Cauchy's projections; exact for a wall along an
axis).
"""

import itertools
from concurrent.futures import Executor

import numpy as np

from ...model.common.jit import compiled

SQUARES = 64
"""Squares of a face, the bits of a uint64."""
UNKNOWN = 255
"""In place of the coverage of a cell with too few points."""
LEAST, ENOUGH = 4 * SQUARES, 8 * SQUARES
"""Points of a cell from which its coverage is known, and points that are examined at most, those of coarse layers first: of the
squares of a closed surface 1.8 % and 0.03 % then remain empty by chance (exp(-4), exp(-8))."""


@compiled(nogil=True, inline="always")
def _bits(word):
    """The number of set bits of a uint64."""
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)


@compiled(nogil=True)
def _cover(points, offsets, layers, cells, first, last, faces):
    """Rows ``first`` to ``last`` of faces (C, 3) uint8; points, offsets, layers as in Scene, cells: C."""
    for cell in range(first, last):
        x, y, z, seen = np.uint64(0), np.uint64(0), np.uint64(0), 0
        for layer in range(layers):
            start, stop = offsets[layer * cells + cell], offsets[layer * cells + cell + 1]
            stop = min(stop, start + ENOUGH - seen)
            for i in range(start, stop):
                w0, w1 = points[i, 0], points[i, 1]
                px, py, pz = np.uint64((w0 >> 13) & 7), np.uint64(w0 >> 29), np.uint64((w1 >> 13) & 7)
                x |= np.uint64(1) << (py << np.uint64(3) | pz)
                y |= np.uint64(1) << (px << np.uint64(3) | pz)
                z |= np.uint64(1) << (px << np.uint64(3) | py)
            seen += stop - start
            if seen >= ENOUGH:
                break
        if seen >= LEAST:
            faces[cell, 0], faces[cell, 1], faces[cell, 2] = _bits(x), _bits(y), _bits(z)


def projected_coverage(points, offsets, layers: int, pool: Executor, jobs: int = 8) -> np.ndarray:
    """(C, 3) uint8 coverage of the cells' faces across x, y and z, 0..SQUARES or UNKNOWN.

    points: (N, 3) uint32 packed points; offsets: (layers * C + 1,) int64, as in Scene.
    """
    cells = (len(offsets) - 1) // layers
    faces = np.full((cells, 3), UNKNOWN, np.uint8)
    edges = [cells * i // jobs for i in range(jobs + 1)]
    work = [pool.submit(_cover, points, offsets, layers, cells, a, b, faces) for a, b in itertools.pairwise(edges)]
    for job in work:
        job.result()
    return faces
