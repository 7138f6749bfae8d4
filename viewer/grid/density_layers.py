"""Density layers and the order of cells: the number of layers, the points of each, cells along the Morton curve.

A point's layer is drawn from a seeded hash of its running number, so it depends only on the order of the file.  Each layer
holds seven eighths of the points of itself and all coarser layers.  The points of one layer and cell, a run, lie in PARTS
parts.  Each part takes every PARTS-th point in the order of the file, and the parts are in bit-reversed order, so that the
first few are spread as evenly as the whole run.  Layers that double would give the same choice of densities in more and shorter
runs, each of which is a GPU workgroup.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..common.errors import InputError

COARSEST = 1 << 15
"""Points of the coarsest layer, at least an eighth of this; chosen by hand."""
STEP = 3
"""A layer and all coarser ones hold 2**STEP times the points of the coarser ones; chosen by hand."""
MAX_LAYERS = 6
"""Layers of the largest scans; six cover 2**15 times the points of the coarsest.  Limited by the 16 geometric values of
viewer.grid.building.kernels."""
PARTS = 64
"""Parts of a run.  The first part of a layer adds 7/8 / PARTS to the 1/8 of the coarser layers: 11 % more points.  Half would
add 22 %, more than the 20 % by which drawing points may exceed its time (viewer.window.planning.adaptive_lod)."""
EARLIER_PARTS = 8
"""Parts of a run in folders that earlier versions converted, whose layers double."""


@dataclass(frozen=True)
class Lattice:
    """What the grids of a place have in common, so that they can be joined (viewer.grid.place).

    cell_size: file units, a power of two; None: as the points of the file ask for.  layers: number of density layers.
    """

    cell_size: float | None = None
    layers: int = MAX_LAYERS


class TooWideForCells(InputError):
    """A file has more occupied cells of the size of a place than a grid may have.  cell_size: the smallest that it can have."""

    def __init__(self, file: Path, size: float, cell_size: float):
        super().__init__(f"is too wide for cells of {size:g}, which the other files have", file=file,
                         remedy="open it by itself")
        self.cell_size = cell_size


def _reversed(parts: int) -> np.ndarray:
    """0, 1, ... parts - 1 with their bits reversed."""
    number, bits = np.arange(parts), parts.bit_length() - 1
    return sum(((number >> bit & 1) << (bits - 1 - bit) for bit in range(bits)), np.zeros(parts, np.int64))


def part_extra(parts: int) -> np.ndarray:
    """(parts, parts + 1): in a run of n points part p begins at (n // parts) p + extra[n % parts, p]; p = parts is the end.
    parts: a power of two; 1: runs are not divided."""
    first = _reversed(parts)
    return np.array([[(first[:part] < rest).sum() for part in range(parts + 1)] for rest in range(parts)])


PART_OF = np.argsort(_reversed(PARTS))
"""(PARTS,): the part of a run's point i, by i % PARTS."""
PART_EXTRA = part_extra(PARTS)


def layer_count(points: int) -> int:
    """Number of layers for a scan: with L layers the coarsest holds about points / 2**(STEP (L - 1)) of them."""
    return int(np.clip(1 + np.ceil(np.log2(max(points, 1) / COARSEST) / STEP), 1, MAX_LAYERS))


def layer_sizes(counts: np.ndarray, layers: int) -> np.ndarray:
    """Points by layer and cell, (L, C) int64, from counts by cell and geometric value, (C, G) int64.

    STEP geometric values make a layer, from 0 in the finest; values beyond the coarsest layer are added to it.
    """
    sizes = np.empty((layers, len(counts)), np.int64)
    for layer in range(1, layers):
        first = STEP * (layers - 1 - layer)
        sizes[layer] = counts[:, first : first + STEP].sum(axis=1)
    sizes[0] = counts[:, STEP * (layers - 1) :].sum(axis=1)
    return sizes


def morton_order(cells: np.ndarray) -> np.ndarray:
    """(C,) indices that sort cells (C, 3) int32, not negative, along the 3-D Morton curve (x is the lowest bit)."""
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
