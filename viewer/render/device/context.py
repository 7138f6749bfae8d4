"""OpenGL contexts: a headless one through EGL, or the window's; and the properties of the device behind a context."""

import ctypes.util
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ....model.common.system import after_fork_in_child
from ...common.errors import DeviceError
from ...common.limited_memory import lacks_room
from .device_class import device_class
from .driver_messages import messages_logged
from .egl import device_order
from .shader import EXTENDED_VERSION, EXTENSIONS

if TYPE_CHECKING:
    import moderngl

REQUIRED = 430
"""OpenGL version times 100: the first with compute shaders and storage buffers."""
_SOFTWARE_BUFFER = 1 << 30
"""Bytes of a buffer that llvmpipe's shaders reach, measured: see Device.buffer_limit."""
_DRIVER = 256 << 20
"""Bytes of address space that a driver needs at least.  Measured with llvmpipe (LLVM 15): with 192 MiB left eglInitialize
fails, the error told here; with 256 and 512 it works, and LLVM ends the process for lack of memory; a small picture takes
659."""
_SOFTWARE = ("llvmpipe", "softpipe", "swr")  # in the renderer's name, lower case


@dataclass(frozen=True)
class Device:
    """renderer, vendor, version: the driver's strings.  software: it runs on the CPU.  storage_limit: bytes in one
    shader storage block.  texture_limit: pixels along a side.  atomics_64: shaders can add to 64-bit words of a buffer."""

    renderer: str
    vendor: str
    version: str
    software: bool
    storage_limit: int
    texture_limit: int
    atomics_64: bool = False

    @property
    def kind(self) -> str:
        """The class of device, a key of device_class.WORKGROUPS."""
        return device_class(self.vendor, self.renderer, software=self.software)

    @property
    def buffer_limit(self) -> int:
        """Bytes of one buffer that a shader can address.  llvmpipe reports 128 MiB, less than the network needs at 4096x2160,
        but addresses more: measured up to 1 GiB.  From 4 GiB on its sizes wrap around."""
        return max(self.storage_limit, _SOFTWARE_BUFFER) if self.software else self.storage_limit


class _Process:
    """opengl: whether a context was made in this process.  forked: whether this process is a copy of one that had made one."""

    opengl = False
    forked = False

    def copied(self) -> None:
        self.forked, self.opengl = self.forked or self.opengl, False


_process = _Process()
after_fork_in_child(_process.copied)


def check_not_forked() -> None:
    """Raises DeviceError in a process that was forked from one with OpenGL: the driver's threads are missing, and it would wait
    for them without end."""
    if _process.forked:
        raise DeviceError("this process was forked after a picture had been made, and OpenGL does not survive that",
                          remedy='start processes with multiprocessing.set_start_method("spawn"), or '
                                 'mp_context=multiprocessing.get_context("spawn") of an executor')


def create_context(*, headless: bool = True) -> "moderngl.Context":
    """An OpenGL 4.3 context: standalone through EGL, or that of the current window.  Raises DeviceError (exit code 3), and
    MemoryError where the address space is limited and has no room for a driver.

    With several GPUs the headless one is made on torch's CUDA device, so that its buffers can be mapped.
    """
    import moderngl

    check_not_forked()

    try:
        with messages_logged():
            context = _standalone() if headless else moderngl.create_context(require=REQUIRED)
    except Exception as error:  # moderngl and glcontext raise plain Exception for every cause
        if lacks_room(_DRIVER):  # a driver that cannot be loaded says nothing of memory
            raise MemoryError("no memory to load a graphics driver") from None
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DeviceError(f"OpenGL 4.3 is needed and could not be had ({reason})",
                          remedy="install a driver, or Mesa's software one (apt install libegl1 libgl1-mesa-dri), "
                                 "and see `pointglass doctor`") from None
    _process.opengl = True
    context.gc_mode = None  # type: ignore[assignment]  # every resource here has an owner that releases it
    return context


def _standalone() -> "moderngl.Context":
    """On torch's CUDA device; where that device cannot draw, on the first that can, and the bridge reads back."""
    import moderngl

    # libGL, glcontext's default, needs X's libraries, which a machine without a display may lack
    settings = {"standalone": True, "backend": "egl", "require": REQUIRED, "libgl": ctypes.util.find_library("OpenGL")}
    failures: list[Exception] = []
    for index in device_order():
        try:
            return moderngl.create_context(**settings, device_index=index)  # type: ignore[arg-type]
        except Exception as error:
            failures.append(error)
    raise failures[0]


LOST = "the graphics driver was reset; start pointglass again"
CONTEXT_LOST = "GL_CONTEXT_LOST"  # as moderngl calls the error


def context_lost(context: "moderngl.Context") -> bool:
    """Whether the driver has reset this context and lost its contents.  Only a window's context asks for this notification
    (viewer.window.shell.app); a headless one fails in other ways."""
    return context.error == CONTEXT_LOST


def describe_device(context: "moderngl.Context") -> Device:
    """The device behind a context, for choices that depend on it and for every figure that is shown."""
    info = context.info
    renderer = str(info["GL_RENDERER"])
    return Device(
        renderer=renderer,
        vendor=str(info["GL_VENDOR"]),
        version=str(info["GL_VERSION"]),
        software=any(name in renderer.lower() for name in _SOFTWARE),
        storage_limit=int(info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]),
        texture_limit=int(info["GL_MAX_TEXTURE_SIZE"]),
        atomics_64=set(EXTENSIONS["WIDE_SUMS"]) <= context.extensions and context.version_code >= EXTENDED_VERSION,
    )


def sharing_problem(context: "moderngl.Context") -> str | None:
    """Why this OpenGL cannot share buffers with CUDA, found out without calling CUDA; None for NVIDIA's own driver.

    CUDA may crash instead of refusing when it is given a buffer of another driver (for example Mesa, where NVIDIA's driver was
    installed without OpenGL): github.com/mp3guy/ElasticFusion/issues/222.
    """
    device = describe_device(context)
    if "nvidia" in device.vendor.lower():
        return None
    return (f"{device.renderer} draws, and only NVIDIA's OpenGL shares buffers with CUDA; in a container it needs "
            "NVIDIA_DRIVER_CAPABILITIES=all")
