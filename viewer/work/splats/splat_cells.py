"""An octree of cells over points, each with the moments of its points.

Frame: relative to the lowest corner of the points, file units.
"""

from dataclasses import dataclass

import numpy as np

from ....model.common.linear_light import to_linear
from ....model.common.process.processors import in_rows
from ..comparing.cell_search import fill_table, runs
from .splat_cell_loops import COLOURS, MOMENTS, cell_moments, merged_moments, morton_keys

AXIS_BITS = 21
"""Bits of a cell's number along an axis: three of them fill the 63 bits of a positive key."""
_LEAST_ROWS = 1 << 13
"""Cells that a thread takes at least."""
_CODES = np.arange(256) / 255.0


@dataclass(frozen=True, eq=False)
class Level:
    """Cells of one side.

    side: file units.  keys: (c,) int64, Morton keys, ascending.  places: (c, MOMENTS), colours: (c, COLOURS) float32, see
    splat_cell_loops.  child: (c + 1,) int64, where the cells of each begin in the level below; None on the finest level.
    """

    side: float
    keys: np.ndarray
    places: np.ndarray
    colours: np.ndarray
    child: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.keys)

    def table(self) -> np.ndarray:
        """Hash table of the keys, for cell_search.place_of."""
        table = np.empty(1 << max(int(2 * len(self)).bit_length(), 4), np.int32)
        fill_table(self.keys, table)
        return table


def levels_of(xyz: np.ndarray, coloured: np.ndarray, side: float, most: int) -> list[Level]:
    """The levels of an octree, from the finest to one cell that holds all points.

    xyz: (n, 3) float64, none below 0, at least one.  coloured: (n, 4) uint8 sRGB and 1 where the point has a colour.  side:
    of the finest cells, doubled until there are at most ``most`` of them and 2**21 along each axis.
    """
    side = max(side, float(xyz.max()) / (2**AXIS_BITS - 2))
    keys = np.empty(len(xyz), np.int64)
    in_rows(len(xyz), _LEAST_ROWS, morton_keys, xyz, side, keys)
    order = np.argsort(keys)
    while True:
        found, first = _runs(keys, order)
        if len(found) <= most:
            break
        keys >>= 3  # the order of keys stays that of their larger cells
        side *= 2
    places, colours = np.empty((len(found), MOMENTS), np.float32), np.empty((len(found), COLOURS), np.float32)
    in_rows(len(found), _LEAST_ROWS, cell_moments, xyz, to_linear(_CODES), _CODES, coloured, order, first, found, side, places,
            colours)  # fmt: skip
    levels = [Level(side, found, places, colours)]
    while len(levels[-1]) > 1:
        levels.append(_above(levels[-1]))
    return levels


def _above(below: Level) -> Level:
    keys = below.keys >> 3
    found, child = _runs(keys, np.arange(len(keys)))
    places, colours = np.empty((len(found), MOMENTS), np.float32), np.empty((len(found), COLOURS), np.float32)
    in_rows(len(found), _LEAST_ROWS, merged_moments, below.keys, below.side, below.places, below.colours, child, found, places,
            colours)  # fmt: skip
    return Level(2 * below.side, found, places, colours, child)


def _runs(keys: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different keys and where each begins in ``order``."""
    found, first = np.empty(len(keys), np.int64), np.empty(len(keys) + 1, np.int64)
    count = runs(keys, order, found, first)
    return found[:count].copy(), first[: count + 1].copy()
