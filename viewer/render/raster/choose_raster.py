"""Which rasteriser draws, where ``--raster auto`` leaves it open: on a GPU measured on the first picture, otherwise the CPU's.

In software OpenGL every candidate makes the same bytes.  On a GPU two may differ in a few pixels (DIFFERING_PIXELS of
viewer.render.device.device_class), so that a choice by timing is part of how a picture was made: pictures keep it, and
``render --like`` repeats it.
"""

from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING

from ..device.device_class import Workgroup, workgroups
from .raster import Rasteriser
from .raster_compute import ComputeRasteriser
from .raster_cpu import CpuRasteriser
from .raster_points import PointRasteriser

if TYPE_CHECKING:
    import numpy as np

    from ....model.reference.soft_z import SoftZ
    from ...picture.camera import Camera
    from ..culling.cull import DrawList
    from ..device.context import Device
    from ..device.shader import Programs
    from .points import PointPages

RASTERISERS: "dict[str, Callable[[Programs, tuple[int, int], Device], Rasteriser]]" = {
    "compute": ComputeRasteriser, "points": PointRasteriser, "cpu": CpuRasteriser,
}
_ROUNDS = 4
"""Pictures that each candidate draws, in turn; the fastest counts, so that the first, which compiles, does not."""


def make_rasteriser(kind: str, workgroup: Workgroup | None, programs: "Programs", size: tuple[int, int],
                    device: "Device") -> Rasteriser:
    """A rasteriser of this kind for a picture size (width, height).  workgroup: of the compute one; None: the default."""
    if kind == "compute":
        return ComputeRasteriser(programs, size, device, workgroup)
    return RASTERISERS[kind](programs, size, device)


class RasterChoice:
    """The rasteriser of one renderer where the settings leave it open.

    raster: a key of RASTERISERS, or auto.  timed: the kind that was chosen by timing, here or for the pictures that are to be
    repeated; "" where none was.
    """

    def __init__(self, raster: str, device: "Device"):
        self._kind, self._device, self.timed = raster, device, ""
        self._workgroup: Workgroup | None = None

    def repeat(self, kind: str) -> None:
        """Draws with the kind that timing chose for other pictures; "": with the one that is fastest here.  In software OpenGL
        all make the same bytes, and its own is kept."""
        if kind and self._kind == "auto" and not self._device.software:
            self._kind = self.timed = kind

    def rasteriser(self, wanted: str, made: dict[str, Rasteriser], programs: "Programs", size: tuple[int, int],
                   measured: Callable[[], Rasteriser]) -> Rasteriser:
        """The rasteriser of a picture size.  wanted: as in the settings.  made: by kind, those that there are; added to.
        measured: makes the fastest, where that is to be found out; its kind is then fixed."""
        wanted = wanted if wanted != "auto" else self._kind
        if wanted == "auto" and self._device.software:
            wanted = self._kind = "cpu"
        if wanted == "auto":
            best = measured()
            wanted = self._kind = self.timed = best.kind
            self._workgroup = best.workgroup if isinstance(best, ComputeRasteriser) else None
            made[wanted] = best
        if wanted not in made:
            made[wanted] = make_rasteriser(wanted, self._workgroup, programs, size, self._device)
        return made[wanted]


def fastest(programs: "Programs", size: tuple[int, int], device: "Device", pages: "PointPages", draw: "DrawList",
            camera: "Camera", soft: "SoftZ", stations: "np.ndarray | None", *, streaming: bool) -> Rasteriser:
    """Draws a draw list with every candidate and returns the one that took least; waits for the GPU."""
    context = programs.context
    rounds = pages.prepare(draw.first, draw.count, streaming=streaming)  # all of them draw the same points
    if len(rounds) > 1:  # of a scan that does not fit, only resident points: reading the rest would be what is measured
        rounds = pages.prepare(draw.first, draw.count, streaming=True)
    made: list[Rasteriser] = [ComputeRasteriser(programs, size, device, shape) for shape in workgroups(device.kind)]
    made.append(PointRasteriser(programs, size, device))
    least = [float("inf")] * len(made)
    for _ in range(_ROUNDS):
        for number, rasteriser in enumerate(made):
            context.finish()
            start = perf_counter()
            rasteriser.run(pages, draw, camera, soft, rounds, stations=stations)
            context.finish()
            least[number] = min(least[number], perf_counter() - start)
    best = made.pop(least.index(min(least)))
    for rasteriser in made:
        rasteriser.release()
    return best
