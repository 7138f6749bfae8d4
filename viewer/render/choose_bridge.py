"""Which bridge carries a picture's pixels: CUDA mapping where it passes its self-test, else read-back, and why."""

from typing import TYPE_CHECKING

from viewer.errors import DeviceError
from viewer.render.bridge import Bridge, ReadBackBridge

if TYPE_CHECKING:
    from viewer.render.shader import Programs


def make_bridge(programs: "Programs", size: tuple[int, int], device: str) -> tuple[Bridge, str | None]:
    """The bridge for a device, and why a better one is not used where one could have been."""
    if device != "cuda":
        return ReadBackBridge(programs.context, size), None
    from viewer.render.cuda_bridge import CudaBridge  # here: CUDA alone needs its libraries

    try:
        mapped = CudaBridge(programs, size)
    except DeviceError as error:
        return ReadBackBridge(programs.context, size), str(error)
    return mapped, mapped.problem
