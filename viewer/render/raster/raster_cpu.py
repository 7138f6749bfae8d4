"""The rasteriser for software OpenGL: compiled loops on all processors that read the points from OpenGL's own memory.

See viewer.render.raster.raster.  On two threads llvmpipe takes 59 ns per point for the compute rasteriser, these loops 11 ns,
and the bytes are the same (viewer/bench/README.md): they read a point's words once, project eight points at a time, and add a
colour with one atomic operation.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.linear_light import LEVELS, TO_LINEAR, TO_SRGB
from ....model.common.process.processors import everywhere
from ..culling.cull import DrawList
from ..culling.occlusion import History
from ..device.shader import BATCH
from .batches import BatchTable
from .point_loops import Edited
from .raster import Rasteriser
from .raster_loops import Drawn, Sums, View, colour_sums, nearest_depths, resolve_pixels

if TYPE_CHECKING:
    import moderngl

    from ....model.reference.soft_z import SoftZ
    from ...picture.camera import Camera
    from ...stream.residency import Round
    from ..device.context import Device
    from ..device.shader import Programs
    from .mark_pages import MarkPages
    from .points import PointPages

_TABLES = {
    True: (TO_LINEAR.astype(np.uint64), TO_SRGB),
    False: (np.arange(256, dtype=np.uint64), np.arange(LEVELS, dtype=np.uint16).astype(np.uint8)),
}
"""By whether colours are averaged in linear light: sRGB level to summed level, and back."""
_UNMARKED = np.empty(0, np.uint8)
_EQUAL, _UNEDITED = np.empty((0, 4), np.float32), Edited.of(None)


@contextmanager
def mapped(buffer: "moderngl.Buffer") -> Iterator[np.ndarray]:
    """(n,) uint32: the memory of a buffer, for reading inside the block only.  In software OpenGL it is not copied.

    The array does not count as a user of the mapping: a pool's thread may drop its last reference a moment after the block.
    """
    with memoryview(buffer.mglo) as view:
        address = np.frombuffer(view, np.uint32).ctypes.data
        yield np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_uint32)), (view.nbytes // 4,))


class CpuRasteriser(Rasteriser):
    """Owns arrays for one picture size, 37 bytes a pixel, of which 16 are used only where sums overflow.

    colours: (H * W,) uint32 RGBA8, depths: (H * W,) float32, and weights: (H * W,) uint8, of the last picture, as in the
    textures.
    """

    kind = "cpu"
    overlap = BATCH

    def __init__(self, programs: "Programs", size: tuple[int, int], device: "Device"):
        super().__init__(programs.context, size)
        pixels = size[0] * size[1]
        self.table = BatchTable(4, (0, 1, 2), BATCH)
        self._sums = self._cleared()
        self._clean = True
        self.colours, self.depths = np.empty(pixels, np.uint32), np.empty(pixels, np.float32)
        self.weights = np.empty(pixels, np.uint8)

    def _cleared(self) -> Sums:
        pixels = self.size[0] * self.size[1]
        return Sums(np.zeros(pixels, np.uint32), np.zeros(pixels, np.uint64), np.zeros(4 * pixels, np.uint32),
                    np.zeros(1, np.uint32))

    def run(self, pages: "PointPages", draw: DrawList, camera: "Camera", soft: "SoftZ", rounds: "list[Round]", *,
            history: History | None = None, stations: np.ndarray | None = None, edits: bytes | None = None,
            marks: "MarkPages | None" = None) -> bool:
        width, height = self.size
        self._begin(draw, camera, soft, weighted=stations is not None, edited=edits is not None, marks=marks)
        if not self._clean:  # an earlier picture ended in an error
            self._sums = self._cleared()
        self._clean, sums, edited = False, self._sums, _UNEDITED if edits is None else Edited.of(edits)
        relative, absolute, corner, _ = self._record["soft"]
        view = View(self._record["axes"], self._record["lens"], width, height, corner, relative, absolute)
        to_linear, to_srgb = _TABLES[soft.linear]
        placed = _EQUAL if stations is None else stations
        for loop, order, more in (
            (nearest_depths, rounds, (view, sums.keys, edited)),
            (colour_sums, rounds[::-1], (view, sums, to_linear, soft.unlit, placed, edited)),
        ):
            for part in order:
                self._bring(pages, draw, part)
                self._draw(pages, draw, loop, more)
        everywhere(resolve_pixels, sums, np.zeros(1, np.int64), width, to_srgb, self.colours, self.depths.view(np.uint32),
                   self.weights)  # fmt: skip
        sums.carried[0], self._clean = 0, True
        self.colour.write(self.colours)
        self.depth.write(self.depths)
        self.weight.write(self.weights)
        return False

    def _draw(self, pages: "PointPages", draw: DrawList, loop, arguments: tuple) -> None:
        rows, bounds = self.table.rows, self.table.bounds
        for page, buffer in enumerate(pages.buffers):
            start, stop = int(bounds[page]), int(bounds[page + 1])
            if stop > start:
                with mapped(buffer) as words:
                    marks = _UNMARKED if self.marks is None else self.marks.array(page)
                    everywhere(loop, Drawn(rows, start, stop, draw.cell_view, words, np.zeros(1, np.int64), marks), *arguments)
