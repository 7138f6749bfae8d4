"""Which rasteriser draws, where ``--raster auto`` leaves it open: on a GPU measured on the first picture, otherwise the CPU's.

Every candidate makes the same picture, so that the choice changes nothing but the time.
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
