"""How much memory the device that draws has, and how much of it the points may take."""

import logging
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ....model.common.process.processors import sharing_processes
from ....model.common.system import available_memory
from .context import describe_device
from .gl_functions import integers

if TYPE_CHECKING:
    import moderngl

UNKNOWN_BUDGET = 1 << 30
"""Bytes of points where the driver does not report the device's memory: 89 million points.  A choice."""
POINTS_SHARE = 2
"""One part in so many of the free memory goes to points; the rest is for pictures, the network and other programs.  A choice,
the same as for main memory; where it is too much, it is halved."""
_LEAST_FREE = 64 << 20  # bytes; less is taken for a driver that does not know, as with memory shared with the processor
_KIB = 1024
_NVX_TOTAL, _NVX_AVAILABLE = 0x9048, 0x9049  # GL_NVX_gpu_memory_info: dedicated and available memory in KiB
_ATI_FREE = 0x87FB  # GL_ATI_meminfo, VBO_FREE_MEMORY_ATI: free memory, and three more, in KiB

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FreeMemory:
    """free: bytes, None where nothing says.  source: what said so.  total: bytes, None where unknown."""

    free: int | None
    source: str
    total: int | None = None


def free_memory(context: "moderngl.Context", *, software: bool | None = None) -> FreeMemory:
    """Memory of the device that draws.  software: OpenGL runs on the processor (None: ask)."""
    device = describe_device(context)
    if device.software if software is None else software:
        return FreeMemory(available_memory(), "free main memory")
    if "GL_NVX_gpu_memory_info" in context.extensions:
        total, free = (_KIB * integers(context, name, 1)[0] for name in (_NVX_TOTAL, _NVX_AVAILABLE))
        if free >= _LEAST_FREE:
            return FreeMemory(free, "GL_NVX_gpu_memory_info", total or None)
    if "GL_ATI_meminfo" in context.extensions:
        free = _KIB * integers(context, _ATI_FREE, 4)[0]
        if free >= _LEAST_FREE:
            return FreeMemory(free, "GL_ATI_meminfo")
    torch = sys.modules.get("torch")  # not imported for this: a raw picture does not need it
    if "nvidia" in device.vendor.lower() and torch is not None and torch.cuda.is_initialized():
        free, total = torch.cuda.mem_get_info()
        return FreeMemory(int(free), "torch.cuda.mem_get_info", int(total))
    return FreeMemory(None, "the driver does not say")


def point_budget(context: "moderngl.Context", *, software: bool | None = None) -> tuple[int, str]:
    """Bytes that the points may take, and where the figure comes from."""
    memory = free_memory(context, software=software)
    if memory.free is None:
        return UNKNOWN_BUDGET, f"{memory.source}: fixed"
    share = POINTS_SHARE * sharing_processes()
    return memory.free // share, f"1/{share} of the free memory ({memory.source})"
