"""From a draw list to what a rasteriser dispatches: pieces of runs, each within one page of points and one cell.

Only this module knows where a point is on the GPU.  Point p is of chunk c = p >> shift, in page slot_of_chunk[c] //
slots_per_page, at index (slot_of_chunk[c] % slots_per_page << shift) + p % 2**shift of it (see viewer.render.raster.points).
Once the whole scene is resident, with chunk c in slot c, a piece may cross chunk borders within a page.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.jit import compiled

if TYPE_CHECKING:
    from ..culling.cull import DrawList
    from .points import PointPages

UNCUT = 1 << 31
"""Points of a piece, more than any page holds: pieces are cut at page borders only."""


@dataclass(frozen=True)
class PageMap:
    """Where points are.  slot_of_chunk: (C,) int32, -1 where a chunk is absent.  whole: chunk c is in slot c, and the
    ``overlap`` points after a page's last one are repeated at its end."""

    slot_of_chunk: np.ndarray
    slots_per_page: int
    shift: int
    pages: int
    whole: bool
    overlap: int = 0

    @staticmethod
    def of(pages: "PointPages", overlap: int) -> "PageMap":
        """The present state of ``pages``."""
        shift = pages.chunk_points.bit_length() - 1
        whole = pages.residency.complete
        return PageMap(pages.slot_of_chunk, pages.slots_per_page, shift, len(pages.buffers), whole, overlap if whole else 0)


@compiled(nogil=True)
def cut_runs(first, count, slot, group, groups, size, start, stop, chunks, per_page, shift, whole, overlap, columns, cursor,
             table):  # fmt: skip
    """Pieces of runs, sorted by page and group, in each by ascending point.

    first, count: (R,) int64, by ascending first.  slot: (R,) int32.  group: (V,) uint8, by slot, below ``groups``; may be
    empty, then all are group 0.  size: points a piece has at most.  start, stop: points of the scene to keep to.
    chunks, per_page, shift, whole, overlap: as in PageMap.  columns: where a piece's index in its page, its count and its
    slot go in a row of ``table`` (T, n) uint32.  cursor: (pages * groups,) int64; before, where each page and group begins
    in the table; after, where it ends.  Rows beyond T are counted and not written.  Returns how many points were left out
    because their chunk is absent.
    """
    at_index, at_count, at_slot = columns
    rows, absent, one = table.shape[0], 0, group.shape[0] == 0
    for run in range(first.shape[0]):
        at, end = max(first[run], start), min(first[run] + count[run], stop)
        while at < end:
            chunk = at >> shift
            place = chunks[chunk]
            if place < 0:
                after = min(end, (chunk + 1) << shift)
                absent += after - at
                at = after
                continue
            page = place // per_page
            index = ((place - page * per_page) << shift) + (at - (chunk << shift))
            border = (page + 1) * per_page << shift if whole else (chunk + 1) << shift
            until = min(end, border)
            key = page * groups + (0 if one else group[slot[run]])
            row = cursor[key]
            while at < until:
                points = min(size, min(end, border + overlap) - at)
                if row < rows:
                    table[row, at_index], table[row, at_count], table[row, at_slot] = index, points, slot[run]
                row += 1
                index += points
                at += points
            cursor[key] = row
    return absent


class BatchTable:
    """Pieces of a draw list as rows of uint32, kept from frame to frame.

    width: words in a row.  columns: where index, count and slot go.  fixed: {column: value} of the others, zero unless
    named.  size: points a piece has at most.  After ``fill``: rows (n, width), ``bounds`` (pages * groups + 1,) where
    each page and group begins.
    """

    def __init__(self, width: int, columns: tuple[int, int, int], size: int, fixed: dict[int, int] | None = None):
        self.columns, self.size, self._fixed = columns, size, fixed or {}
        self._table = self._made(1024, width)
        self._none = np.zeros(0, np.uint8)
        self._cursor = np.zeros(1, np.int64)
        self.bounds = np.zeros(2, np.int64)
        self.absent = 0

    def _made(self, rows: int, width: int) -> np.ndarray:
        table = np.zeros((rows, width), np.uint32)
        for column, value in self._fixed.items():
            table[:, column] = value
        return table

    @property
    def rows(self) -> np.ndarray:
        """(n, width) uint32, valid until the next fill."""
        return self._table[: self.bounds[-1]]

    def fill(self, draw: "DrawList", where: PageMap, *, group: np.ndarray | None = None, groups: int = 1, start: int = 0,
             stop: int = 1 << 62) -> np.ndarray:
        """Makes the rows of a draw list; of the points start to stop only.  group: (V,) uint8 by slot, or None."""
        keys = where.pages * groups
        if len(self.bounds) != keys + 1:
            self.bounds, self._cursor = np.zeros(keys + 1, np.int64), np.zeros(keys, np.int64)
        # One page and one group fill from row 0 at once.  Otherwise a first round counts; so does one that runs out of rows.
        self._cursor[:] = 0
        self._cut(draw, where, group, groups, start, stop, self._table if keys == 1 else self._table[:0])
        np.cumsum(self._cursor, out=self.bounds[1:])
        if self.bounds[-1] > len(self._table):
            self._table = self._made(1 << int(self.bounds[-1] - 1).bit_length(), self._table.shape[1])
        elif keys == 1:
            return self.rows
        self._cursor[:] = self.bounds[:-1]
        self._cut(draw, where, group, groups, start, stop, self._table)
        return self.rows

    def _cut(self, draw, where: PageMap, group, groups: int, start: int, stop: int, table: np.ndarray) -> None:
        self.absent = cut_runs(
            draw.first, draw.count, draw.slot, self._none if group is None else group, groups, self.size, start, stop,
            where.slot_of_chunk, where.slots_per_page, where.shift, where.whole, where.overlap, self.columns, self._cursor,
            table,
        )  # fmt: skip
