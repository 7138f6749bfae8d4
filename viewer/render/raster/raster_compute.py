"""The compute rasteriser: workgroups that draw batches of points with integer atomics (after Schuetz et al. 2021).

See viewer.render.raster.raster and raster_shader.  Only this rasteriser supports occlusion culling
(viewer.render.culling.occlusion).
"""

from typing import TYPE_CHECKING

import moderngl

from ....model.common.process.processors import usable_processors
from ..culling.cull import DrawList
from ..culling.occlusion import LAG, LAST, History, OcclusionPasses, batches_of
from ..device import shader
from ..device.compute_pass import rows_of_groups
from ..device.device_class import Workgroup, workgroups
from ..device.shader import BATCH, BINDINGS, STRETCH
from .batches import BatchTable
from .raster_shader import ShaderRasteriser

if TYPE_CHECKING:
    from ...stream.residency import Round
    from ..device.context import Device
    from .points import PointPages


class ComputeRasteriser(ShaderRasteriser):
    """Compute shaders with atomics.  workgroup: its shape; None: the default of the device's class."""

    kind = "compute"
    from_keys = 1
    overlap = BATCH

    def __init__(self, programs: shader.Programs, size: tuple[int, int], device: "Device", workgroup: Workgroup | None = None):
        super().__init__(programs, size, device)
        self.workgroup = workgroup = workgroup or workgroups(device.kind)[0]
        self.keys = self.context.buffer(reserve=4 * size[0] * self.band_rows)
        self._copied_keys = self.context.texture((size[0], self.band_rows), 1, dtype="u4") if device.software else None
        self._make_resolve({} if self._copied_keys is None else {"copied_keys": self._copied_keys}, {"KEYS": self.keys})
        self.table = BatchTable(4, (0, 1, 2), BATCH)
        self._rows, self._lag = workgroup.rows, LAG[device.software]
        self._shared = {"LANES": workgroup.lanes, "ROWS": self._rows, "STRETCH": STRETCH,
                        "THREADS": usable_processors() if device.software else None}
        self._steps: dict[tuple[bool, bool, bool, int | None], list[moderngl.ComputeShader]] = {}

    def _passes(self, appended: int | None = None) -> list[moderngl.ComputeShader]:
        """Programs of depth and colour.  appended: 1 for the list of batches that occlusion culling adds."""
        key = self.weighted, self.edited, self.marks is not None, appended
        if key not in self._steps:
            self._steps[key] = [
                self.programs.compute(f"raster_{name}.comp", APPENDED=appended, **self._shared, **self.variant, **more)
                for name, more in (("depth", {}), ("colour", {**self.weights, **self.layout}))
            ]
        return self._steps[key]

    def _bind(self) -> None:
        self.upload.buffer.bind_to_storage_buffer(BINDINGS["BATCHES"])
        self.cells.buffer.bind_to_storage_buffer(BINDINGS["CELLS"])
        self.keys.bind_to_storage_buffer(BINDINGS["KEYS"])
        self._bind_sums()

    def _copy(self) -> None:
        super()._copy()
        if self._copied_keys is not None:
            self._copied_keys.write(self.keys)

    def draw_band(self, pages: "PointPages", draw: DrawList, rounds: "list[Round]", rows: int) -> None:
        self.zero(self.keys)
        for step, order in zip(self._passes(), (rounds, rounds[::-1]), strict=True):
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
        self._bind_marks(page)
        step["first_batch"], step["batch_count"] = start, stop - start
        step.run(*rows_of_groups(-(-(stop - start) // self._rows)))

    def _bind_marks(self, page: int) -> None:
        if self.marks is not None:
            self.marks.buffer(page).bind_to_storage_buffer(BINDINGS["MARKS"])

    @property
    def can_hide(self) -> bool:
        return self.band_rows >= self.size[1]

    def draw_hiding(self, pages: "PointPages", draw: DrawList, part: "Round", history: History) -> None:
        if self.hider is None:
            self.hider = OcclusionPasses(self.programs, self.size, self._rows, self._lag)
        hider, count = self.hider, len(pages.buffers)
        rounds = history.memory.recall(history.scene, draw, hider)
        self._bring(pages, draw, part, rounds)
        hider.start(rounds, count, int(self.table.bounds[-1]))
        self.zero(self.keys)
        passes, more = self._passes(), self._passes(appended=1)
        self._draw_round(passes[0], pages, hider, 0)
        tested = [number for number in range(1, LAST + 1) if number == LAST or (rounds == number).any()]
        for number in tested:
            hider.build(self.keys, history)
            hider.test(self.cells.buffer, number)
            hider.append(self.upload.buffer, self.table.bounds, number)
            self._draw_round(more[0], pages, hider, number)
        self._draw_round(passes[1], pages, hider, 0)
        for number in tested:
            self._draw_round(more[1], pages, hider, number)
        hider.end()

    def _draw_round(self, step: moderngl.ComputeShader, pages: "PointPages", hider: OcclusionPasses, number: int) -> None:
        """Runs a pass on what a round draws, 0: without a test."""
        self._bind()
        for page, buffer in enumerate(pages.buffers):
            start, stop = batches_of(self.table.bounds, page, number)
            if number == 0:
                self._draw(step, pages, page, start, stop)
            elif stop > start:
                self._bind_marks(page)
                hider.draw(step, buffer, page, number, start)
        self.context.memory_barrier()

    def release(self) -> None:
        super().release()
        self.keys.release()
        if self._copied_keys is not None:
            self._copied_keys.release()
        if self.hider is not None:
            self.hider.release()
