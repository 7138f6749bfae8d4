"""Points to picture: two rasterisers with one result, the soft z-buffer, and the raw picture with its depth.

Both draw every point as 1x1 pixels in two passes (paper, "Point Cloud Projection"): nearest depth, then whole-number
colour sums of the points within a tolerance behind it.  ``compute`` uses a compute shader and integer atomics, ``points``
OpenGL point primitives with MIN blending; the same expressions choose the pixel in both, and the bytes are the same.
Pictures larger than a storage block are made in bands of rows; points that do not fit the GPU together come in rounds, depth
first to last, colours last to first.
"""

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from model.light import TO_LINEAR, TO_SRGB
from viewer.render import shader
from viewer.render.batches import UNCUT, BatchTable, PageMap
from viewer.render.cull import DrawList
from viewer.render.occlusion import MAX_GROUPS, HiddenCells, History, worthwhile
from viewer.render.shader import BATCH, BINDINGS

if TYPE_CHECKING:
    from model.project import SoftZ
    from viewer.camera import Camera
    from viewer.cloud.residency import Round
    from viewer.render.points import PointPages

_SUM_BYTES = 16
FRAME_FIELDS = np.dtype(
    [("axes", "<f4", (3, 4)), ("lens", "<f4", 4), ("size", "<u4", 4), ("soft", "<f4", 4)]
)
"""The uniform block Frame of common_project.glsl (std140)."""


def _light_tables() -> bytes:
    """The block Light of common_sums.glsl."""
    return TO_LINEAR.astype("<u4").tobytes() + TO_SRGB.tobytes()


class Rasteriser:
    """Owns programs and targets for one picture size; ``run`` fills ``colour`` (RGBA8) and ``depth`` (R32F, +inf where
    empty), row 0 at the top."""

    kind = ""
    from_keys: int | None = None  # nearest depths come as inverted bits in a buffer, not in a texture
    overlap = 0  # points behind a page's end that a batch may take in

    table: BatchTable
    hider: "HiddenCells | None" = None

    def __init__(self, programs: shader.Programs, size: tuple[int, int], storage_limit: int):
        context = programs.context
        self.context, self.size = context, size
        width, height = size
        self.band_rows = max(1, min(height, storage_limit // (_SUM_BYTES * width)))
        self.colour = context.texture(size, 4, dtype="f1")
        self.depth = context.texture(size, 1, dtype="f4")
        self.sums = context.buffer(reserve=_SUM_BYTES * width * self.band_rows)
        self.carries = context.buffer(reserve=4 * width * self.band_rows)
        self.frame = context.buffer(reserve=FRAME_FIELDS.itemsize, dynamic=True)
        self.cells = shader.Grown(context)
        self.upload = shader.Grown(context)
        self._loaded: Round | None = None
        self.light = context.buffer(_light_tables())
        self._record = np.zeros((), FRAME_FIELDS)
        self.resolve = programs.compute("resolve.comp", FROM_KEYS=self.from_keys)

    def run(self, pages: "PointPages", draw: DrawList, camera: "Camera", soft: "SoftZ", *, streaming: bool = False,
            history: History | None = None) -> bool:
        """Rasterises a draw list.

        streaming: with the points that are on the GPU, the others come later.  history: hidden cells may be left out, where
        this rasteriser can and it is worth it.  Returns whether history was used.
        """
        width, height = self.size
        record = self._record
        record["axes"][:, :3] = draw.axes
        record["axes"][0, 3] = soft.unlit
        record["lens"] = (camera.fx, camera.fy, camera.cx, camera.cy)
        record["soft"] = (1.0 + soft.relative, soft.absolute, 0.5 if soft.rounded else 0.0, float(soft.linear))
        self.cells.write(draw.cell_view)
        rounds = pages.prepare(draw.first, draw.count, streaming=streaming)
        self._loaded = None
        self.frame.bind_to_uniform_block(BINDINGS["FRAME"])
        hiding = history is not None and self.can_hide and len(rounds) == 1 and worthwhile(draw, self.size)
        for first_row in range(0, height, self.band_rows):
            rows = min(self.band_rows, height - first_row)
            record["size"] = (width, height, first_row, rows)
            self.frame.write(record.tobytes())
            self.sums.clear()
            self.carries.clear()
            if hiding and history is not None:
                self.draw_hiding(pages, draw, rounds[0], history)
            else:
                self.draw_band(pages, draw, rounds, rows)
            self._bind_sums()
            self.colour.bind_to_image(0, read=False, write=True)
            self.depth.bind_to_image(1, read=False, write=True)
            self.resolve.run(*shader.groups(width, rows))
            self.context.memory_barrier()
        return hiding

    @property
    def can_hide(self) -> bool:
        """Whether this rasteriser can leave out hidden cells at this picture size."""
        return False

    def _bind_sums(self) -> None:
        self.sums.bind_to_storage_buffer(BINDINGS["SUMS"])
        self.carries.bind_to_storage_buffer(BINDINGS["CARRY"])
        self.light.bind_to_storage_buffer(BINDINGS["LIGHT"])

    def _bring(self, pages: "PointPages", draw: DrawList, part: "Round", group: np.ndarray | None = None) -> None:
        """Has the points of a round on the GPU and its batches in ``table``."""
        if part is self._loaded:
            return
        if not pages.residency.holds_all:
            pages.load(part)
        where = PageMap.of(pages, self.overlap)
        groups = 1 if group is None else 2
        self.upload.write(self.table.fill(draw, where, group=group, groups=groups, start=part.start, stop=part.stop))
        self._loaded = part

    def draw_band(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", rows: int) -> None:
        """Draws all rounds into the band that the Frame block describes."""
        raise NotImplementedError

    def draw_hiding(self, pages: "PointPages", draw: DrawList, part: "Round", history: History) -> None:
        """The same without cells that are hidden, for the whole picture."""
        raise NotImplementedError

    def remember(self, history: History) -> None:
        """After the filter has run on what draw_hiding drew: notes what is seen, for the next frame."""
        raise NotImplementedError

    def release(self) -> None:
        grown = self.cells.buffer, self.upload.buffer
        for resource in (self.colour, self.depth, self.sums, self.carries, self.frame, self.light, *grown):
            resource.release()


class ComputeRasteriser(Rasteriser):
    """Compute shaders, one workgroup a batch of points (after Schuetz et al. 2021)."""

    kind = "compute"
    from_keys = 1
    overlap = BATCH

    def __init__(self, programs: shader.Programs, size: tuple[int, int], storage_limit: int):
        super().__init__(programs, size, storage_limit)
        self.keys = self.context.buffer(reserve=4 * size[0] * self.band_rows)
        self.table = BatchTable(4, (0, 1, 2), BATCH)
        self._programs = programs
        self._passes = [programs.compute(f"raster_{name}.comp") for name in ("depth", "colour")]
        self._hiding: list[moderngl.ComputeShader] = []

    def _bind(self) -> None:
        self.upload.buffer.bind_to_storage_buffer(BINDINGS["BATCHES"])
        self.cells.buffer.bind_to_storage_buffer(BINDINGS["CELLS"])
        self.keys.bind_to_storage_buffer(BINDINGS["KEYS"])
        self._bind_sums()

    def draw_band(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", rows: int) -> None:
        self.keys.clear()
        for step, order in zip(self._passes, (rounds, rounds[::-1]), strict=True):
            for part in order:
                self._bring(pages, draw, part)
                self._bind()
                for page in range(len(pages.buffers)):
                    self._draw(step, pages, page, int(self.table.bounds[page]), int(self.table.bounds[page + 1]))
                self.context.memory_barrier()

    def _draw(self, step: moderngl.ComputeShader, pages: "PointPages", page: int, start: int, stop: int) -> None:
        if stop == start:
            return
        pages.buffers[page].bind_to_storage_buffer(BINDINGS["POINTS"])
        step["first_batch"], step["batch_count"] = start, stop - start
        across = min(stop - start, MAX_GROUPS)
        step.run(across, -(-(stop - start) // across), 1)

    @property
    def can_hide(self) -> bool:
        return self.band_rows >= self.size[1]

    def draw_hiding(self, pages: "PointPages", draw: DrawList, part: "Round", history: History) -> None:
        if self.hider is None:
            self.hider = HiddenCells(self._programs, self.size)
            self._hiding = [self._programs.compute(f"raster_{name}.comp", APPENDED=1) for name in ("depth", "colour")]
        hider, count = self.hider, len(pages.buffers)
        known = history.memory.recall(history.scene, draw, hider)
        np.subtract(1, known, out=known)  # group 0: seen last time; group 1: to be tested
        self._bring(pages, draw, part, known)
        bounds = self.table.bounds
        np.subtract(1, known, out=known)
        hider.start(known, count, int(bounds[-1]))
        self.keys.clear()
        for step, appended in zip(self._passes, self._hiding, strict=True):
            self._bind()
            for page in range(count):
                self._draw(step, pages, page, int(bounds[2 * page]), int(bounds[2 * page + 1]))
            self.context.memory_barrier()
            if step is self._passes[0]:
                hider.look(self.keys, self.depth)
                hider.build(self.depth, history)
                hider.test(self.cells.buffer)
                hider.append(self.upload.buffer, bounds)
                self._bind()
            for page, buffer in enumerate(pages.buffers):
                if bounds[2 * page + 2] > bounds[2 * page + 1]:
                    hider.draw(appended, buffer, page, int(bounds[2 * page + 1]))
            self.context.memory_barrier()

    def remember(self, history: History) -> None:
        assert self.hider is not None
        self.hider.build(self.depth, history)
        self.hider.test(self.cells.buffer, final=True)

    def release(self) -> None:
        super().release()
        self.keys.release()
        if self.hider is not None:
            self.hider.release()


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
        self.table = BatchTable(5, (2, 0, 3), UNCUT, {1: 1})  # moderngl steps through commands of 20 bytes
        self._programs = [
            programs.drawing("raster_points.vert", f"raster_points_{name}.frag") for name in ("depth", "colour")
        ]
        self._programs[1]["nearest"] = 0
        self.resolve["nearest"] = 0
        self._arrays: list[tuple[moderngl.VertexArray, ...]] = []
        self._arrays_for: tuple = ()

    def _use_arrays(self, pages: "PointPages") -> None:
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
        self._default.use()  # ours must not stay bound: they are released with the picture size
        self.nearest.use(0)

    def _draw_all(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", number: int) -> None:
        for part in rounds:
            self._bring(pages, draw, part)
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


RASTERISERS: dict[str, type[Rasteriser]] = {"compute": ComputeRasteriser, "points": PointRasteriser}
