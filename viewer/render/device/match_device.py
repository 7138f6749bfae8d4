"""Which CUDA device is the GPU that OpenGL draws on, where a machine has several: two cards, a laptop's two GPUs, EGL without a
display.  Buffers can be mapped only where both are the same, so torch is told to use that one.

Asked in order of certainty: the device's UUID (GL_EXT_memory_object), the CUDA runtime (cudaGLGetDevices), EGL's CUDA number
(EGL_NV_device_cuda), and the name of the renderer where only one CUDA device has it.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from .context import sharing_problem
from .egl import current_cuda_device
from .gl_functions import device_uuids

if TYPE_CHECKING:
    import moderngl

MOST_DEVICES = 16
"""CUDA devices that cudaGLGetDevices may return: as many as the largest single machines have."""


@dataclass(frozen=True)
class CudaDevice:
    """One device as torch counts them.  uuid: 16 bytes, empty where unknown."""

    index: int
    name: str
    uuid: bytes = b""


@dataclass(frozen=True)
class OpenGLDevice:
    """What is known of the device behind an OpenGL context.

    renderer: the driver's string.  uuids: 16 bytes each.  runtime: CUDA devices that cudaGLGetDevices names, None where it
    could not be asked.  egl: the CUDA number of the context's EGL device, or None.
    """

    renderer: str
    uuids: tuple[bytes, ...] = ()
    runtime: tuple[int, ...] | None = None
    egl: int | None = None


@dataclass(frozen=True)
class Match:
    """index: the CUDA device that OpenGL draws on, None where none does or nothing tells.  how: for a person, in one line."""

    index: int | None
    how: str


def match(drawing: OpenGLDevice, devices: list[CudaDevice]) -> Match:
    """The CUDA device of an OpenGL device."""
    if not devices:
        return Match(None, "there is no CUDA device")

    def found(index: int, by: str) -> Match:
        name = next(device.name for device in devices if device.index == index)
        return Match(index, f"OpenGL draws on CUDA device {index} of {len(devices)} ({name}), by {by}")

    known = [device for device in devices if device.uuid]
    if drawing.uuids and known:
        same = [device.index for device in known if device.uuid in drawing.uuids]
        if same:
            return found(same[0], "UUID")
        if len(known) == len(devices):
            return Match(None, f"OpenGL draws on {drawing.renderer}, which is no CUDA device, by UUID")
    indices = {device.index for device in devices}
    if drawing.runtime is not None:
        same = [index for index in drawing.runtime if index in indices]
        if same:
            return found(same[0], "cudaGLGetDevices")
        return Match(None, f"OpenGL draws on {drawing.renderer}, which is no CUDA device, by cudaGLGetDevices")
    if drawing.egl in indices and drawing.egl is not None:
        return found(drawing.egl, "EGL_NV_device_cuda")
    named = [device.index for device in devices if device.name and device.name.lower() in drawing.renderer.lower()]
    if len(named) == 1:
        return found(named[0], "the renderer's name")
    if len(named) > 1:
        return Match(None, f"{len(named)} CUDA devices are named like OpenGL's {drawing.renderer}; nothing distinguishes them")
    return Match(None, f"no CUDA device is named like OpenGL's {drawing.renderer}")


def cuda_devices() -> list[CudaDevice]:
    """torch's CUDA devices; CUDA must work."""
    import torch

    found = []
    for index in range(torch.cuda.device_count()):
        properties = torch.cuda.get_device_properties(index)
        uuid = getattr(properties, "uuid", None)  # torch 2.4 and later
        found.append(CudaDevice(index, properties.name, bytes(getattr(uuid, "bytes", b""))))
    return found


def opengl_device(context: "moderngl.Context") -> OpenGLDevice:
    """What OpenGL, CUDA's runtime and EGL say about the current context's device."""
    # CUDA's runtime may crash where another vendor's OpenGL draws, and is not asked there
    runtime = _by_runtime() if sharing_problem(context) is None else None
    return OpenGLDevice(str(context.info["GL_RENDERER"]), tuple(device_uuids(context)), runtime, current_cuda_device())


def _by_runtime() -> tuple[int, ...] | None:
    """CUDA devices of the current OpenGL context by the CUDA runtime; None where it cannot be asked."""
    try:
        from cuda.bindings import runtime  # type: ignore[import-not-found]
    except ImportError:
        return None
    status, count, devices = runtime.cudaGLGetDevices(MOST_DEVICES, runtime.cudaGLDeviceList.cudaGLDeviceListAll)
    if int(status) != 0 or devices is None:  # no device, or an older runtime: nothing is known for certain
        return None
    return tuple(int(device) for device in devices[: int(count)])


def use_matching_device(context: "moderngl.Context") -> Match:
    """Makes torch use the CUDA device that OpenGL draws on, where one is found and another is in use."""
    import torch

    made = match(opengl_device(context), cuda_devices())
    if made.index is not None and made.index != torch.cuda.current_device():
        torch.cuda.set_device(made.index)
    return made


def on_same_device(device: str) -> Callable[[], AbstractContextManager[object]]:
    """Makes contexts in which any thread uses the CUDA device that the calling one uses now.  device: cuda or cpu.

    CUDA's current device belongs to a thread, and a new thread begins with device 0.
    """
    if device == "cpu":
        return nullcontext
    import torch

    return partial(torch.cuda.device, torch.cuda.current_device())


def other_gpu(context: "moderngl.Context") -> str:
    """To be added to a failure to map: that OpenGL draws on another GPU than torch computes on; else nothing."""
    import torch

    made = match(opengl_device(context), cuda_devices())
    mine = torch.cuda.current_device()
    if made.index == mine:
        return ""
    return f"; {made.how}, torch computes on CUDA device {mine}"
