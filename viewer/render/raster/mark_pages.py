"""The marks of points (viewer.grid.records.point_marks) where rasterisers draw them: a byte beside each point of the pages.

In main memory for the compiled loops, and on the GPU once a rasteriser of shaders asks for them.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..device.shader import BATCH

if TYPE_CHECKING:
    import moderngl

    from ...grid.records.point_marks import PointMarks
    from .points import PointPages

_POINT_BYTES = 12


class MarkPages:
    """Owns the bytes of the pages of one scene.  marks: the last that were asked for."""

    def __init__(self, context: "moderngl.Context"):
        self._context = context
        self.marks: PointMarks | None = None
        self._pages: PointPages | None = None
        self._chunks = np.empty(0, np.int32)  # whose marks each slot has, -1: none
        self._arrays: list[np.ndarray] = []
        self._buffers: list[moderngl.Buffer] = []
        self._stale: set[int] = set()

    def use(self, marks: "PointMarks") -> "MarkPages":
        """The marks of the pictures that follow."""
        if marks is not self.marks:
            self.marks = marks
            self._chunks[:] = -1
        return self

    def follow(self, pages: "PointPages") -> None:
        """Gives the points that are in the pages now their marks.  Called before they are drawn."""
        if pages is not self._pages:
            self.release()
            self._pages, self._chunks = pages, np.full(pages.residency.slots, -1, np.int32)
        for buffer in pages.buffers[len(self._arrays) :]:
            self._arrays.append(np.zeros(-(-buffer.size // _POINT_BYTES) + 3 & ~3, np.uint8))
        there = pages.residency.chunk_of_slot
        for slot in np.flatnonzero((self._chunks != there) & (there >= 0)).tolist():
            self._put(pages, int(there[slot]), slot)
        self._chunks[:] = there

    def _put(self, pages: "PointPages", chunk: int, slot: int) -> None:
        assert self.marks is not None
        first, (page, place) = chunk * pages.chunk_points, divmod(slot, pages.slots_per_page)
        some = self.marks.of_point[first : first + pages.chunk_points]
        at = place * pages.chunk_points
        self._arrays[page][at : at + len(some)] = some
        self._stale.add(page)
        if page > 0 and place == 0 and pages.residency.holds_all:  # points repeated at the end of the page before
            self._arrays[page - 1][pages.size : pages.size + len(some[:BATCH])] = some[:BATCH]
            self._stale.add(page - 1)

    def array(self, page: int) -> np.ndarray:
        """(n,) uint8: the marks of a page's points."""
        return self._arrays[page]

    def buffer(self, page: int) -> "moderngl.Buffer":
        """The same on the GPU, a whole number of words."""
        while len(self._buffers) < len(self._arrays):
            number = len(self._buffers)
            self._buffers.append(self._context.buffer(self._arrays[number].tobytes()))
            self._stale.discard(number)
        if page in self._stale:
            self._buffers[page].write(self._arrays[page])
            self._stale.discard(page)
        return self._buffers[page]

    def buffers(self, pages: "PointPages") -> "list[moderngl.Buffer]":
        """Those of all pages, with the marks of the points that are in them now."""
        self.follow(pages)
        return [self.buffer(page) for page in range(len(pages.buffers))]

    def release(self) -> None:
        for buffer in self._buffers:
            buffer.release()
        self._buffers, self._arrays, self._pages = [], [], None
        self._stale.clear()
