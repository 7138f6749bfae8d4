"""Choice of the bridge: CUDA mapping where it passes its self-test, else read-back through host memory, with the reason."""

from typing import TYPE_CHECKING

from ...common.errors import DeviceError
from .bridge import Bridge, ReadBackBridge

if TYPE_CHECKING:
    from ..device.shader import Programs


def make_bridge(programs: "Programs", size: tuple[int, int], device: str) -> tuple[Bridge, str | None]:
    """The bridge for a device, and the reason why a faster one is not used (None where there is no faster one)."""
    if device != "cuda":
        return ReadBackBridge(programs.context, size), None
    from .cuda_bridge import CudaBridge  # imported here: only CUDA needs its libraries

    try:
        mapped = CudaBridge(programs, size)
    except DeviceError as error:
        return ReadBackBridge(programs.context, size), str(error)
    return mapped, mapped.problem
