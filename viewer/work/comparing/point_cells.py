"""Points sorted into cells, so that loops find those near a place.

Frame: both clouds of a comparison are moved by one offset, so that coordinates are small and positive; float64, file units.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ....model.common.process.processors import in_rows
from ...common.errors import InputError
from .cell_search import AXIS_BITS, cell_keys, fill_table, gathered, order_in_cells, runs

_LEAST_ROWS = 1 << 16
"""Points a thread takes at least: some 2 ms of work."""
_LEAST_CELLS = 1 << 10
_BLOCK = 1 << 17
"""Points of a block of cells: ``np.repeat`` keeps the interpreter's lock, for some 5 ms of so many."""


@dataclass(frozen=True, eq=False)
class Cells:
    """side: of a cell, file units.  points: (n, 3) float64, sorted by cell, in a cell by x, y and z.  order: (n,)
    int64, the number of each in the cloud.  keys: (c,) int64 ascending, of the cells that hold points.
    first: (c + 1,) int64, where each begins in ``points``.  table: hash table of the keys.  blocks, block_first,
    block_table: the same of the blocks; they begin at a cell.  sizes: (3,) int64, cells along the axes.
    """

    side: float
    points: np.ndarray
    order: np.ndarray
    keys: np.ndarray
    first: np.ndarray
    table: np.ndarray
    blocks: np.ndarray
    block_first: np.ndarray
    block_table: np.ndarray
    sizes: np.ndarray

    @property
    def search(self) -> tuple:
        """The arguments of loops that search these cells, from ``side`` on."""
        return (self.side, self.sizes, self.points, self.keys, self.first, self.table, self.blocks, self.block_first,
                self.block_table)  # fmt: skip

    def in_blocks(self) -> Iterator[slice]:
        """All cells, in slices of about _BLOCK points, or of one cell that has more."""
        starts = np.searchsorted(self.first[:-1], np.arange(0, len(self.points), _BLOCK))
        edges = np.unique([*starts, len(self.keys)]).tolist()
        return (slice(a, b) for a, b in pairwise(edges))

    def counts(self, some: slice) -> np.ndarray:
        """(c,) int64: points of each of some cells."""
        return np.diff(self.first[some.start : some.stop + 1])

    def around(self, place: np.ndarray, reach: int = 1) -> np.ndarray:
        """(m, 3) the points in the cell of a place and those up to ``reach`` cells away."""
        middle = np.floor(place / self.side).astype(np.int64)
        low, high = np.maximum(middle - reach, 0), np.minimum(middle + reach + 1, self.sizes)
        found = [np.zeros((0, 3))]
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    key = _key_of(x, y, z)
                    at = int(np.searchsorted(self.keys, key))
                    if at < len(self.keys) and self.keys[at] == key:
                        found.append(self.points[self.first[at] : self.first[at + 1]])
        return np.concatenate(found)


def _key_of(x: int, y: int, z: int) -> int:
    """cell_search.key_of for the interpreter."""
    block = ((x >> 3) << 18 | y >> 3) << 18 | z >> 3
    return block << 9 | (x & 7) << 6 | (y & 7) << 3 | (z & 7)


def box_of(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates, (3,) each, of (n, 3) points: an axis at a time, an eighth of the time of
    ``xyz.min(axis=0)``."""
    low, high = np.empty(3), np.empty(3)
    for axis in range(3):
        low[axis], high[axis] = xyz[:, axis].min(), xyz[:, axis].max()
    return low, high


def cells_of(xyz: np.ndarray, side: float) -> Cells:
    """Sorts (n, 3) float64 points, none below 0, into cells of a side.

    Raises InputError where they reach farther than 2**21 cells along an axis.
    """
    sizes = (box_of(xyz)[1] if len(xyz) else np.zeros(3)) / side + 1
    if sizes.max() >= 2**AXIS_BITS:
        raise InputError(f"the points reach farther than {2**AXIS_BITS:,} search cells of {side:g}",
                         remedy="leave out what lies far away")
    keys = np.empty(len(xyz), np.int64)
    in_rows(len(xyz), _LEAST_ROWS, cell_keys, xyz, side, keys)
    order = np.argsort(keys)
    points = np.empty_like(xyz)
    in_rows(len(xyz), _LEAST_ROWS, gathered, xyz, order, points)
    cells, first, table = _indexed(keys, order)
    in_rows(len(cells), _LEAST_CELLS, order_in_cells, points, order, first)
    blocks, block_first, block_table = _indexed(cells >> 9, np.arange(len(cells)))
    return Cells(side, points, order, cells, first, table, blocks, block_first, block_table, sizes.astype(np.int64))


def _indexed(keys: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Different keys, where each begins in ``order``, and their hash table."""
    found, first = np.empty(len(keys), np.int64), np.empty(len(keys) + 1, np.int64)
    count = runs(keys, order, found, first)
    found, first = found[:count].copy(), first[: count + 1].copy()
    table = np.empty(1 << max(int(2 * count).bit_length(), 4), np.int32)
    fill_table(found, table)
    return found, first, table
