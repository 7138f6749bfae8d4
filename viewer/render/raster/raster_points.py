"""The rasteriser of point primitives, with MIN blending for depth: for drivers on which compute shaders are slow.

See viewer.render.raster.raster and viewer.render.raster.raster_shader.
"""

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ..culling.cull import DrawList
from ..device import shader
from .batches import UNCUT, BatchTable
from .raster_shader import ShaderRasteriser

if TYPE_CHECKING:
    from ...stream.residency import Round
    from ..device.context import Device
    from .points import PointPages


class PointRasteriser(ShaderRasteriser):
    """OpenGL point primitives, one indirect multi-draw a page and pass."""

    kind = "points"

    def __init__(self, programs: shader.Programs, size: tuple[int, int], device: "Device"):
        super().__init__(programs, size, device)
        context = self.context
        self.nearest = context.texture((size[0], self.band_rows), 1, dtype="f4")
        self._make_resolve({"nearest": self.nearest}, {})
        self.target = context.framebuffer([self.nearest])
        self.empty = context.framebuffer([context.renderbuffer((size[0], self.band_rows), 1, dtype="f1")])
        self._default = context.detect_framebuffer(0)
        self.table = BatchTable(5, (2, 0, 3), UNCUT, {1: 1})  # moderngl steps through commands of 20 bytes
        self._arrays: list[tuple[moderngl.VertexArray, ...]] = []
        self._arrays_for: tuple = ()

    def _use_arrays(self, pages: "PointPages") -> None:
        marks = [] if self.marks is None else self.marks.buffers(pages)
        wanted = (*(b.glo for b in pages.buffers), self.cells.buffer.glo, self.cells.buffer.size, self.weighted, self.edited,
                  *(b.glo for b in marks))
        if wanted != self._arrays_for:
            self._release_arrays()
            programs = [
                self.programs.drawing("raster_points.vert", f"raster_points_{name}.frag", **self.variant, **more)
                for name, more in (("depth", {}), ("colour", {**self.weights, **self.layout}))
            ]
            programs[1]["nearest"] = 0
            self._arrays = [
                tuple(
                    self.context.vertex_array(
                        p, [(buffer, "3u", "in_point") if number or self.edited else (buffer, "2u 4x", "in_point"),
                            (self.cells.buffer, "3f 4x/i", "in_cell"), *([(marks[page], "u1", "in_mark")] if marks else [])]
                    )
                    for number, p in enumerate(programs)
                )
                for page, buffer in enumerate(pages.buffers)
            ]
            self._arrays_for = wanted

    def draw_band(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", rows: int) -> None:
        context = self.context
        self._use_arrays(pages)
        self._bind_sums()
        context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        viewport = (0, 0, self.size[0], rows)
        self.target.use()
        context.viewport = viewport
        self.target.clear(np.inf, 0.0, 0.0, 0.0)
        context.enable(moderngl.BLEND | moderngl.PROGRAM_POINT_SIZE)
        context.blend_equation = moderngl.MIN  # type: ignore[assignment]
        context.blend_func = moderngl.ONE, moderngl.ONE
        self._draw_all(pages, draw, rounds, 0)
        context.disable(moderngl.BLEND)
        context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        context.memory_barrier()
        self.empty.use()
        context.viewport = viewport
        self.empty.color_mask = (False, False, False, False)
        self.nearest.use(0)
        self._draw_all(pages, draw, rounds[::-1], 1)
        context.disable(moderngl.PROGRAM_POINT_SIZE)
        context.memory_barrier()
        self._default.use()  # this object's framebuffers are released with the picture size and must not stay bound

    def _draw_all(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", number: int) -> None:
        for part in rounds:
            self._bring(pages, draw, part)
            if self.marks is not None:
                self.marks.buffers(pages)  # of the points of this round
            bounds = self.table.bounds
            for page in range(len(pages.buffers)):
                start, stop = int(bounds[page]), int(bounds[page + 1])
                if stop > start:
                    self._arrays[page][number].render_indirect(
                        self.upload.buffer, moderngl.POINTS, count=stop - start, first=start
                    )

    def _release_arrays(self) -> None:
        for arrays in self._arrays:
            for array in arrays:
                array.release()
        self._arrays = []

    def release(self) -> None:
        super().release()
        self._release_arrays()
        attached = self.empty.color_attachments[0]
        for resource in (self.target, self.empty, attached, self.nearest):
            resource.release()
