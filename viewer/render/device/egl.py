"""EGL devices and their CUDA numbers: EGL and CUDA number the GPUs of a machine differently.

NVIDIA's EGL reports a device's CUDA number, as this process counts them (CUDA_VISIBLE_DEVICES taken into account), through
EGL_NV_device_cuda; other drivers, Mesa's among them, have no such devices.  Through ctypes, since nothing here wraps it.
"""

import ctypes
import ctypes.util
import os
import sys
from typing import Protocol

EXTENSION = "EGL_NV_device_cuda"
_EXTENSIONS, _CUDA_DEVICE_NV, _DEVICE_EXT = 0x3055, 0x323A, 0x322C  # names of the EGL headers
_MOST = 64
"""EGL devices that are queried at most."""


class Devices(Protocol):
    """EGL's devices, in its own order."""

    def all(self) -> list[int]: ...
    def extensions(self, device: int) -> str: ...
    def cuda(self, device: int) -> int | None: ...


class EglDevices:
    """The machine's EGL devices.  Raises OSError where there is no EGL, AttributeError where it cannot list devices."""

    def __init__(self):
        egl = ctypes.CDLL(ctypes.util.find_library("EGL") or "libEGL.so.1")
        address = egl.eglGetProcAddress
        address.restype, address.argtypes = ctypes.c_void_p, [ctypes.c_char_p]

        def function(name: str, result, *arguments):
            found = address(name.encode())
            if not found:
                raise AttributeError(f"EGL has no {name}")
            return ctypes.CFUNCTYPE(result, *arguments)(found)

        self._library = egl  # keeps it loaded
        pointer, number = ctypes.c_void_p, ctypes.c_int
        self._list = function("eglQueryDevicesEXT", ctypes.c_uint, number, ctypes.POINTER(pointer), ctypes.POINTER(number))
        self._string = function("eglQueryDeviceStringEXT", ctypes.c_char_p, pointer, number)
        self._current_display = function("eglGetCurrentDisplay", pointer)
        self._display_attribute = function("eglQueryDisplayAttribEXT", ctypes.c_uint, pointer, number,
                                           ctypes.POINTER(ctypes.c_ssize_t))
        self._attribute = function("eglQueryDeviceAttribEXT", ctypes.c_uint, pointer, number, ctypes.POINTER(ctypes.c_ssize_t))

    def of_current_display(self) -> int | None:
        """The device of the display that is current on this thread, None where there is none."""
        display = self._current_display()
        value = ctypes.c_ssize_t(0)
        return value.value if display and self._display_attribute(display, _DEVICE_EXT, ctypes.byref(value)) else None

    def all(self) -> list[int]:
        found, count = (ctypes.c_void_p * _MOST)(), ctypes.c_int()
        if not self._list(_MOST, found, ctypes.byref(count)):
            return []
        return [found[i] or 0 for i in range(count.value)]

    def extensions(self, device: int) -> str:
        return (self._string(device, _EXTENSIONS) or b"").decode(errors="replace")

    def cuda(self, device: int) -> int | None:
        value = ctypes.c_ssize_t(-1)
        return value.value if self._attribute(device, _CUDA_DEVICE_NV, ctypes.byref(value)) and value.value >= 0 else None


def cuda_numbers(devices: Devices | None = None) -> list[int | None]:
    """For each EGL device in EGL's order its CUDA number, None where it has none.  Empty where EGL cannot tell."""
    try:
        devices = devices or EglDevices()
        found = []
        for device in devices.all():
            known = EXTENSION in devices.extensions(device).split()  # the query is invalid for others
            found.append(devices.cuda(device) if known else None)
        return found
    except (OSError, AttributeError):
        return []


def current_cuda_device(devices: "EglDevices | None" = None) -> int | None:
    """CUDA number of the EGL device that the current context draws on; None without EGL or such a number."""
    try:
        devices = devices or EglDevices()
        device = devices.of_current_display()
        return devices.cuda(device) if device and EXTENSION in devices.extensions(device).split() else None
    except (OSError, AttributeError):
        return None


def current_cuda_number() -> int:
    """The CUDA device that torch uses, or would use by default where it is not imported yet."""
    torch = sys.modules.get("torch")
    return torch.cuda.current_device() if torch is not None and torch.cuda.is_initialized() else 0


def device_order(devices: Devices | None = None) -> list[int | None]:
    """Indices of EGL's devices in the order to try them: torch's CUDA device, then the others as EGL has them.

    [None], glcontext's own choice, where EGL cannot list them or GLCONTEXT_DEVICE_INDEX decides.
    """
    if os.environ.get("GLCONTEXT_DEVICE_INDEX"):
        return [None]
    numbers = cuda_numbers(devices)
    mine = _matching(numbers)
    return sorted(range(len(numbers)), key=lambda index: index != mine) or [None]


def _matching(numbers: list[int | None]) -> int | None:
    """A CUDA number that several EGL devices report (some drivers do) matches none of them."""
    wanted = current_cuda_number()
    return numbers.index(wanted) if numbers.count(wanted) == 1 else None
