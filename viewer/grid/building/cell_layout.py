"""Which cells a grid has: those of pass 1, merged until they hold about TARGET points.  Frame: file coordinates."""

from dataclasses import dataclass

import numpy as np

from .. import density_layers as layers
from .count_points import CellCounts
from .histogram import merge

TARGET = 8192
"""Points of a cell on average, within a factor of two, since cell sizes are powers of two.  Half or twice changes the
CPU time of building by at most 13 % (six real scans of 0.1 to 1 million points)."""
_BULK = 0.95
"""Share of the points that determines the cell size, so that outlier points do not.  Of the same scans 0.9 halves the cells'
side in one, 0.975 changes none."""
_LEAST_CELLS = 8
"""Cells that the bulk of a small scan is divided into.  Half or twice changes none of the same scans."""


@dataclass
class Layout:
    """The place of every point.  cells (C, 3) int32 from 0 in Morton order, of ``cell_size``, relative to ``base`` (3,)
    float64 whole numbers; offsets (layers * C + 1,) int64 as in Scene."""

    cells: np.ndarray
    offsets: np.ndarray
    base: np.ndarray
    cell_size: float
    layers: int


def choose_layout(counted: CellCounts, at_most: float = np.inf, lattice: layers.Lattice | None = None) -> Layout:
    """Merges the cells of pass 1 until they hold about TARGET points (or are few), or are as large as ``at_most``.

    Merging from fine to coarse and stopping at the first size that fits makes the choice independent of the grid's origin.
    lattice: the cells have its size, which is not below that of pass 1, and there are as many layers.
    """
    cells, counts, base, size = counted.cells, counted.counts, counted.base, counted.cell_size
    enough = min(TARGET / 2, _BULK * counted.count / _LEAST_CELLS)
    fixed = None if lattice is None else lattice.cell_size
    while size < fixed if fixed else (2 * size <= at_most and _typical(counts) < enough):
        coarse = np.floor(base / 2)
        cells = (np.floor((cells + base) / 2) - coarse).astype(np.int32)
        cells, counts = merge(cells, counts)
        base, size = coarse, 2 * size
    low = cells.min(axis=0)
    order = layers.morton_order(cells - low)
    depth = layers.layer_count(counted.count) if lattice is None else lattice.layers
    offsets = np.zeros(depth * len(cells) + 1, np.int64)
    np.cumsum(layers.layer_sizes(counts[order], depth).reshape(-1), out=offsets[1:])
    return Layout(np.ascontiguousarray((cells - low)[order]), offsets, base + low, size, depth)


def _typical(counts: np.ndarray) -> float:
    """Points per cell over the fullest cells that together hold the bulk of the points."""
    fullest = np.sort(counts.sum(axis=1))[::-1].cumsum()
    bulk = _BULK * fullest[-1]
    return bulk / (np.searchsorted(fullest, bulk) + 1)
