"""What the rasterisers that run as shaders have in common: colour sums in storage blocks, and the pass that resolves them.

Pictures larger than a storage block are made in bands of rows.
"""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.linear_light import TO_LINEAR, TO_SRGB
from ....model.reference.soft_z import MAX_AVERAGED
from ....model.reference.station_constants import HEAVIEST, UNPLACED
from ..culling.cull import DrawList
from ..culling.occlusion import History, worthwhile
from ..device import shader
from ..device.compute_pass import Pass
from ..device.gpu_buffers import GrowingBuffer
from ..device.shader import BINDINGS
from .edit_block import BLOCK as EDITS_BLOCK
from .edit_block import DEFINES as EDITED
from .raster import FRAME_FIELDS, Rasteriser
from .stations import MOST_STATIONS

if TYPE_CHECKING:
    import moderngl

    from ....model.reference.soft_z import SoftZ
    from ...picture.camera import Camera
    from ...stream.residency import Round
    from ..device.context import Device
    from .mark_pages import MarkPages
    from .points import PointPages

_SUM_BYTES, _WIDE_SUM_BYTES, _CARRY_BYTES = 8, 16, 16  # a pixel, in common_sums.glsl
_CARRY_HEAD = 16  # bytes of the indirect command of the pass over pixels with carries
_CLEAR_LANES, _CLEAR_GROUPS = 256, 1024  # invocations of a workgroup, workgroups at most: enough to fill any GPU


class ShaderRasteriser(Rasteriser):
    """Owns the programs and buffers of one picture size."""

    from_keys: int | None = None  # 1: nearest depths are inverted bits in a buffer, not a texture

    def __init__(self, programs: shader.Programs, size: tuple[int, int], device: "Device"):
        context = programs.context
        super().__init__(context, size)
        width, height = size
        self.band_rows = max(1, min(height, (device.storage_limit - _CARRY_HEAD) // (_CARRY_BYTES * width)))
        # On a GPU two 32-bit sums share a 64-bit word where it can add to one: carries, each an atomic operation more, are then
        # as good as never needed.  Software OpenGL has no such atomics, and its sums of 16 bits take half the memory traffic.
        self.wide_sums = device.atomics_64 and not device.software
        self.sums = context.buffer(reserve=(_WIDE_SUM_BYTES if self.wide_sums else _SUM_BYTES) * width * self.band_rows)
        self.carries = context.buffer(reserve=_CARRY_HEAD + _CARRY_BYTES * width * self.band_rows)
        self._clean = False  # whether the carries are zero, to which resolve.comp resets them
        self._clear = None if device.software else Pass(programs, "clearing", "clear.comp", buffers=("KEYS",),
                                                          uniforms=("count",), CLEAR_LANES=_CLEAR_LANES)  # fmt: skip
        self.frame = context.buffer(reserve=FRAME_FIELDS.itemsize, dynamic=True)
        self.cells = GrowingBuffer(context, orphans=not device.software)
        self.upload = GrowingBuffer(context, orphans=not device.software)
        self.to_linear = context.texture((len(TO_LINEAR), 1), 1, TO_LINEAR.astype("<u2").tobytes(), dtype="u2")
        self.to_srgb = context.texture((64, 64), 1, TO_SRGB.tobytes(), dtype="u1")
        # In software the resolve pass takes half the time from copies in textures: 39 and 20 ms of processor time for 960x720.
        self._copied_sums = context.texture((width, self.band_rows), 2, dtype="u4") if device.software else None
        self.stations = context.buffer(reserve=16 * MOST_STATIONS, dynamic=True)
        self.programs = programs
        self.edits = context.buffer(reserve=EDITS_BLOCK.itemsize, dynamic=True)

    def _make_resolve(self, depths: "dict[str, moderngl.Texture]", keys: "dict[str, moderngl.Buffer]") -> None:
        """Makes the two passes that resolve the sums.  depths, keys: where the nearest depths are, by the shader's name."""
        self._depths = depths if self._copied_sums is None else {**depths, "copied_sums": self._copied_sums}
        self._resolved = {"SUMS": self.sums, "CARRY": self.carries, **keys}
        resolve = partial(Pass, self.programs, "resolved sums", "resolve.comp", outputs=("colour", "depth", "weight"),
                          inputs=tuple(self._depths), buffers=tuple(self._resolved), FROM_KEYS=self.from_keys,
                          MAX_AVERAGED=MAX_AVERAGED, **self.layout)  # fmt: skip
        self._resolve = resolve(SUMS_COPIED=None if self._copied_sums is None else 1)
        self._carried = resolve(CARRIED=1)

    def run(self, pages: "PointPages", draw: DrawList, camera: "Camera", soft: "SoftZ", rounds: "list[Round]", *,
            history: History | None = None, stations: np.ndarray | None = None, edits: bytes | None = None,
            marks: "MarkPages | None" = None) -> bool:
        width, height = self.size
        record = self._record
        self._begin(draw, camera, soft, weighted=stations is not None, edited=edits is not None, marks=marks)
        self.cells.write(draw.cell_view)
        self.frame.bind_to_uniform_block(BINDINGS["FRAME"])
        if stations is not None:
            self.stations.write(stations)
            self.stations.bind_to_uniform_block(BINDINGS["STATIONS"])
        if edits is not None:
            self.edits.write(edits)
            self.edits.bind_to_uniform_block(BINDINGS["EDITS"])
        hiding = history is not None and self.can_hide and len(rounds) == 1 and worthwhile(draw, self.size)
        for first_row in range(0, height, self.band_rows):
            rows = min(self.band_rows, height - first_row)
            record["size"] = (width, height, first_row, rows)
            self.frame.write(record.tobytes())
            self.zero(self.sums, *(() if self._clean else (self.carries,)))
            if not self._clean:  # for the first band; later bands are not larger
                self.carries.write(np.array([0, shader.groups(width, rows)[1], 1, 0], np.uint32))
            self._clean = False
            if hiding and history is not None:
                self.draw_hiding(pages, draw, rounds[0], history)
            else:
                self.draw_band(pages, draw, rounds, rows)
            self.resolve(rows)
            self._clean = True
        return hiding

    def resolve(self, rows: int) -> None:
        """Makes colour, depth and weight of the sums of ``rows`` rows, and zeroes the carries."""
        self._bind_tables()
        self._copy()
        made = self.colour, self.depth, self.weight
        self._resolve.run(*made, inputs=self._depths, buffers=self._resolved, over=(self.size[0], rows))
        self._carried.run_indirect(self.carries, *made, inputs=self._depths, buffers=self._resolved)

    def _copy(self) -> None:
        """Copies what the resolve pass reads to textures, in software."""
        if self._copied_sums is not None:
            self._copied_sums.write(self.sums)

    def zero(self, *buffers: "moderngl.Buffer") -> None:
        """Sets buffers to zero: on a GPU by a shader; in software by moderngl, which maps them.  Mapping is fastest there, and
        on a GPU would wait for all work that uses them."""
        for buffer in buffers:
            if self._clear is None:
                buffer.clear()
                continue
            words = buffer.size // 4
            self._clear.run_groups(min(-(-words // _CLEAR_LANES), _CLEAR_GROUPS), buffers={"KEYS": buffer}, count=words)
        if self._clear is not None:
            self.context.memory_barrier()

    @property
    def layout(self) -> dict[str, object]:
        """Constants of the programs that read or write the sums."""
        return {"WIDE_SUMS": 1 if self.wide_sums else None}

    @property
    def weights(self) -> dict[str, object]:
        """Constants of the programs that differ where points have weights."""
        return {"WEIGHTED": 1, "HEAVIEST": HEAVIEST, "UNPLACED": UNPLACED} if self.weighted else {}

    @property
    def variant(self) -> dict[str, object]:
        """Constants of the programs that differ where edits remove or recolour points."""
        return {**EDITED, "MARKED": None if self.marks is None else 1} if self.edited else {}

    def _bind_sums(self) -> None:
        self.sums.bind_to_storage_buffer(BINDINGS["SUMS"])
        self.carries.bind_to_storage_buffer(BINDINGS["CARRY"])
        self._bind_tables()

    def _bind_tables(self) -> None:
        self.to_linear.use(shader.UNITS["TO_LINEAR"])
        self.to_srgb.use(shader.UNITS["TO_SRGB"])

    def _bring(self, pages: "PointPages", draw: DrawList, part: "Round", group: np.ndarray | None = None) -> bool:
        """As in the base class; also uploads the table."""
        news = super()._bring(pages, draw, part, group)
        if news:
            self.upload.write(self.table.rows)
        return news

    def draw_band(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", rows: int) -> None:
        """Draws all rounds into the band that the Frame block describes."""
        raise NotImplementedError

    def draw_hiding(self, pages: "PointPages", draw: DrawList, part: "Round", history: History) -> None:
        """The same without hidden cells, for the whole picture in one band."""
        raise NotImplementedError

    def release(self) -> None:
        super().release()
        grown = self.cells.buffer, self.upload.buffer
        for resource in (self.edits, self.sums, self.carries, self.frame, self.stations,
                         self.to_linear, self.to_srgb, self._copied_sums, *grown):
            if resource is not None:
                resource.release()
