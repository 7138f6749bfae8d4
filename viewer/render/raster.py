"""Points to picture: two rasterisers with one result, the soft z-buffer, and the raw picture with its depth.

Both draw every point as 1x1 pixels in two passes (paper, "Point Cloud Projection"): nearest depth, then whole-number
colour sums of the points within a tolerance behind it.  ``compute`` uses a compute shader and integer atomics, ``points``
OpenGL point primitives with MIN blending; the same expressions choose the pixel in both, and the bytes are the same.
Pictures larger than a storage block are made in bands of rows.
"""

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from model.light import TO_LINEAR, TO_SRGB
from viewer.render import shader
from viewer.render.cull import DrawList, split_runs
from viewer.render.shader import BATCH, BINDINGS

if TYPE_CHECKING:
    from model.project import SoftZ
    from viewer.camera import Camera
    from viewer.render.points import PointPages

_SUM_BYTES = 16
_MAX_GROUPS = 32768
FRAME_FIELDS = np.dtype(
    [("axes", "<f4", (3, 4)), ("lens", "<f4", 4), ("size", "<u4", 4), ("soft", "<f4", 4)]
)
"""The uniform block Frame of common_project.glsl (std140)."""


def _light_tables() -> bytes:
    """The block Light of common_sums.glsl."""
    return TO_LINEAR.astype("<u4").tobytes() + TO_SRGB.tobytes()


class _Grown:
    """A buffer that only ever grows, so that a steady frame allocates nothing."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self.buffer = context.buffer(reserve=4096, dynamic=True)

    def write(self, data: np.ndarray) -> moderngl.Buffer:
        raw = np.ascontiguousarray(data)
        if raw.nbytes > self.buffer.size:
            self.buffer.orphan(1 << int(raw.nbytes - 1).bit_length())
        if raw.nbytes:
            self.buffer.write(raw)
        return self.buffer


class Rasteriser:
    """Owns programs and targets for one picture size; ``run`` fills ``colour`` (RGBA8) and ``depth`` (R32F, +inf where
    empty), row 0 at the top."""

    kind = ""
    from_keys: int | None = None  # nearest depths come as inverted bits in a buffer, not in a texture

    def __init__(self, programs: shader.Programs, size: tuple[int, int], storage_limit: int):
        context = programs.context
        self.context, self.size = context, size
        width, height = size
        self.band_rows = max(1, min(height, storage_limit // (_SUM_BYTES * width)))
        self.colour = context.texture(size, 4, dtype="f1")
        self.depth = context.texture(size, 1, dtype="f4")
        self.sums = context.buffer(reserve=_SUM_BYTES * width * self.band_rows)
        self.frame = context.buffer(reserve=FRAME_FIELDS.itemsize, dynamic=True)
        self.cells = _Grown(context)
        self.light = context.buffer(_light_tables())
        self._record = np.zeros((), FRAME_FIELDS)
        self.resolve = programs.compute("resolve.comp", FROM_KEYS=self.from_keys)

    def run(self, pages: "PointPages", draw: DrawList, camera: "Camera", soft: "SoftZ") -> None:
        """Rasterises a draw list."""
        width, height = self.size
        record = self._record
        record["axes"][:, :3] = draw.axes
        record["lens"] = (camera.fx, camera.fy, camera.cx, camera.cy)
        record["soft"] = (1.0 + soft.relative, soft.absolute, 0.5 if soft.rounded else 0.0, float(soft.linear))
        self.cells.write(draw.cell_view)
        self.prepare(pages, draw)
        self.frame.bind_to_uniform_block(BINDINGS["FRAME"])
        self.sums.bind_to_storage_buffer(BINDINGS["SUMS"])
        self.light.bind_to_storage_buffer(BINDINGS["LIGHT"])
        for first_row in range(0, height, self.band_rows):
            rows = min(self.band_rows, height - first_row)
            record["size"] = (width, height, first_row, rows)
            self.frame.write(record.tobytes())
            self.sums.clear()
            self.draw_band(pages, rows)
            self.colour.bind_to_image(0, read=False, write=True)
            self.depth.bind_to_image(1, read=False, write=True)
            self.resolve.run(*shader.groups(width, rows))
            self.context.memory_barrier()

    def prepare(self, pages: "PointPages", draw: DrawList) -> None:
        """Uploads the draw list."""
        raise NotImplementedError

    def draw_band(self, pages: "PointPages", rows: int) -> None:
        """Draws all pages into the band that the Frame block describes."""
        raise NotImplementedError

    def release(self) -> None:
        for resource in (self.colour, self.depth, self.sums, self.frame, self.cells.buffer, self.light):
            resource.release()


class ComputeRasteriser(Rasteriser):
    """Compute shaders, one workgroup a batch of points (after Schuetz et al. 2021)."""

    kind = "compute"
    from_keys = 1

    def __init__(self, programs: shader.Programs, size: tuple[int, int], storage_limit: int):
        super().__init__(programs, size, storage_limit)
        context = self.context
        self.keys = context.buffer(reserve=4 * size[0] * self.band_rows)
        self.batches = _Grown(context)
        self._passes = [programs.compute(f"raster_{name}.comp") for name in ("depth", "colour")]
        self._bounds = np.zeros(1, np.int64)

    def prepare(self, pages: "PointPages", draw: DrawList) -> None:
        first, count, run = split_runs(draw.first, draw.count, BATCH, aligned=False)
        self._bounds = pages.bounds(first)
        table = np.zeros((len(first), 4), np.uint32)
        table[:, 0], table[:, 1], table[:, 2] = first % pages.size, count, draw.slot[run]
        self.batches.write(table)

    def draw_band(self, pages: "PointPages", rows: int) -> None:
        self.keys.clear()
        self.batches.buffer.bind_to_storage_buffer(BINDINGS["BATCHES"])
        self.cells.buffer.bind_to_storage_buffer(BINDINGS["CELLS"])
        self.keys.bind_to_storage_buffer(BINDINGS["KEYS"])
        for step in self._passes:
            for page, buffer in enumerate(pages.buffers):
                start, stop = int(self._bounds[page]), int(self._bounds[page + 1])
                if stop == start:
                    continue
                buffer.bind_to_storage_buffer(BINDINGS["POINTS"])
                step["first_batch"], step["batch_count"] = start, stop - start
                across = min(stop - start, _MAX_GROUPS)
                step.run(across, -(-(stop - start) // across), 1)
            self.context.memory_barrier()

    def release(self) -> None:
        super().release()
        for resource in (self.keys, self.batches.buffer):
            resource.release()


class PointRasteriser(Rasteriser):
    """OpenGL point primitives, one indirect multi-draw a page and pass."""

    kind = "points"

    def __init__(self, programs: shader.Programs, size: tuple[int, int], storage_limit: int):
        super().__init__(programs, size, storage_limit)
        context = self.context
        self.nearest = context.texture((size[0], self.band_rows), 1, dtype="f4")
        self.target = context.framebuffer([self.nearest])
        self.empty = context.framebuffer([context.renderbuffer((size[0], self.band_rows), 1, dtype="f1")])
        self._default = context.detect_framebuffer(0)
        self.commands = _Grown(context)
        self._programs = [
            programs.drawing("raster_points.vert", f"raster_points_{name}.frag") for name in ("depth", "colour")
        ]
        self._programs[1]["nearest"] = 0
        self.resolve["nearest"] = 0
        self._bounds = np.zeros(1, np.int64)
        self._arrays: list[tuple[moderngl.VertexArray, ...]] = []
        self._arrays_for: tuple = ()

    def prepare(self, pages: "PointPages", draw: DrawList) -> None:
        first, count, run = split_runs(draw.first, draw.count, pages.size, aligned=True)
        self._bounds = pages.bounds(first)
        table = np.zeros((len(first), 5), np.uint32)  # moderngl steps through commands of 20 bytes
        table[:, 0], table[:, 1], table[:, 2], table[:, 3] = count, 1, first % pages.size, draw.slot[run]
        self.commands.write(table)
        wanted = (*(b.glo for b in pages.buffers), self.cells.buffer.glo, self.cells.buffer.size)
        if wanted != self._arrays_for:
            self._release_arrays()
            self._arrays = [
                tuple(
                    self.context.vertex_array(
                        p, [(buffer, "3u", "in_point") if number else (buffer, "2u 4x", "in_point"),
                            (self.cells.buffer, "3f 4x/i", "in_cell")]
                    )
                    for number, p in enumerate(self._programs)
                )
                for buffer in pages.buffers
            ]
            self._arrays_for = wanted

    def draw_band(self, pages: "PointPages", rows: int) -> None:
        context = self.context
        context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        viewport = (0, 0, self.size[0], rows)
        self.target.use()
        context.viewport = viewport
        self.target.clear(np.inf, 0.0, 0.0, 0.0)
        context.enable(moderngl.BLEND | moderngl.PROGRAM_POINT_SIZE)
        context.blend_equation = moderngl.MIN  # type: ignore[assignment]
        context.blend_func = moderngl.ONE, moderngl.ONE
        self._draw(pages, 0)
        context.disable(moderngl.BLEND)
        context.blend_equation = moderngl.FUNC_ADD  # type: ignore[assignment]
        context.memory_barrier()
        self.empty.use()
        context.viewport = viewport
        self.empty.color_mask = (False, False, False, False)
        self.nearest.use(0)
        self._draw(pages, 1)
        context.disable(moderngl.PROGRAM_POINT_SIZE)
        context.memory_barrier()
        self._default.use()  # ours must not stay bound: they are released with the picture size
        self.nearest.use(0)

    def _draw(self, pages: "PointPages", number: int) -> None:
        for page in range(len(pages.buffers)):
            start, stop = int(self._bounds[page]), int(self._bounds[page + 1])
            if stop > start:
                self._arrays[page][number].render_indirect(
                    self.commands.buffer, moderngl.POINTS, count=stop - start, first=start
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
        for resource in (self.target, self.empty, attached, self.nearest, self.commands.buffer):
            resource.release()


RASTERISERS: dict[str, type[Rasteriser]] = {"compute": ComputeRasteriser, "points": PointRasteriser}
