"""Which cells a grid has: those of the survey, merged until they hold about TARGET points.  Frame: file coordinates."""

from dataclasses import dataclass

import numpy as np

from viewer.grid import density_layers as layers
from viewer.grid.count_points import Survey
from viewer.grid.histogram import merge

TARGET = 8192
"""Points a cell should hold on average; within a factor of two, since cell sizes are powers of two."""
_BULK = 0.95  # share of the points that decides on the cell size, so that scattered outliers do not


@dataclass
class Layout:
    """Where every point goes.  cells (C, 3) int32 from 0 in Morton order, of ``cell_size``, relative to ``base`` (3,)
    float64 whole numbers; offsets (layers * C + 1,) int64 as in Scene."""

    cells: np.ndarray
    offsets: np.ndarray
    base: np.ndarray
    cell_size: float
    layers: int


def choose_layout(survey: Survey, at_most: float = np.inf) -> Layout:
    """Merges the survey's cells until they hold about TARGET points (or are few), or are as large as ``at_most``.

    Going from fine to coarse and stopping at once keeps the choice independent of where the grid's zero lies.
    """
    cells, counts, base, size = survey.cells, survey.counts, survey.base, survey.cell_size
    enough = min(TARGET / 2, _BULK * survey.count / 8)
    while 2 * size <= at_most and _typical(counts) < enough:
        coarse = np.floor(base / 2)
        cells = (np.floor((cells + base) / 2) - coarse).astype(np.int32)
        cells, counts = merge(cells, counts)
        base, size = coarse, 2 * size
    low = cells.min(axis=0)
    order = layers.morton_order(cells - low)
    depth = layers.layer_count(survey.count)
    offsets = np.zeros(depth * len(cells) + 1, np.int64)
    np.cumsum(layers.layer_sizes(counts[order], depth).reshape(-1), out=offsets[1:])
    return Layout(np.ascontiguousarray((cells - low)[order]), offsets, base + low, size, depth)


def _typical(counts: np.ndarray) -> float:
    """Points per cell over the fullest cells that together hold the bulk of the points."""
    fullest = np.sort(counts.sum(axis=1))[::-1].cumsum()
    bulk = _BULK * fullest[-1]
    return bulk / (np.searchsorted(fullest, bulk) + 1)
