"""GPU buffers copied for the host and read some frames later, so that neither waits for the other.

Each copy goes into the next of a few buffers that stay mapped (GL_ARB_buffer_storage), with a fence behind it; reading it waits
for its fence alone.  To read the source buffer itself would wait for everything submitted before.
"""

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import DeviceLostError
from .device_failure import DeviceMemoryError
from .gl_functions import gl_function

if TYPE_CHECKING:
    import moderngl

TIMEOUT = 10.0
"""Seconds after which a fence that is not reached means that the GPU hangs or was lost.  Windows resets a GPU after 2 s by
default, Linux's amdgpu after 10 s."""

_READ, _WRITE = 0x8F36, 0x8F37  # GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER
_MAP = 0x0001 | 0x0040 | 0x0080  # GL_MAP_READ_BIT, _PERSISTENT_BIT, _COHERENT_BIT
_COMMANDS_COMPLETE, _FLUSH_FIRST = 0x9117, 1  # GL_SYNC_GPU_COMMANDS_COMPLETE, GL_SYNC_FLUSH_COMMANDS_BIT
_REACHED = (0x911A, 0x911C)  # GL_ALREADY_SIGNALED, GL_CONDITION_SATISFIED
_LEAST = 1 << 16  # bytes of a slot


class _Functions:
    """The OpenGL functions used here, of one context."""

    def __init__(self, context: "moderngl.Context"):
        uint, size, pointer = ctypes.c_uint, ctypes.c_ssize_t, ctypes.c_void_p
        names = ctypes.POINTER(uint)
        self.generate = gl_function(context, "glGenBuffers", None, ctypes.c_int, names)
        self.delete = gl_function(context, "glDeleteBuffers", None, ctypes.c_int, names)
        self.bind = gl_function(context, "glBindBuffer", None, uint, uint)
        self.storage = gl_function(context, "glBufferStorage", None, uint, size, pointer, uint)
        self.map = gl_function(context, "glMapBufferRange", pointer, uint, size, size, uint)
        self.copy = gl_function(context, "glCopyBufferSubData", None, uint, uint, size, size, size)
        self.fence = gl_function(context, "glFenceSync", pointer, uint, uint)
        self.wait = gl_function(context, "glClientWaitSync", uint, pointer, uint, ctypes.c_uint64)
        self.forget = gl_function(context, "glDeleteSync", None, pointer)


class _Slot:
    """One mapped buffer and the fence behind its copy.  number: of the copy, None while there is none."""

    def __init__(self, functions: _Functions):
        self._gl = functions
        self._name, self._address, self._size, self._fence = ctypes.c_uint(0), 0, 0, None
        self.number: int | None = None
        self._used = 0

    def _reserve(self, size: int) -> None:
        if size <= self._size:
            return
        self.release()
        wanted = max(_LEAST, 1 << (size - 1).bit_length())
        self._gl.generate(1, ctypes.byref(self._name))
        self._gl.bind(_WRITE, self._name)
        self._gl.storage(_WRITE, wanted, None, _MAP)
        address = self._gl.map(_WRITE, 0, wanted, _MAP)
        self._gl.bind(_WRITE, 0)
        if not address:
            self._gl.delete(1, ctypes.byref(self._name))
            raise DeviceMemoryError("the GPU has no memory left for a buffer that the host reads",
                                    remedy="close other programs")
        self._address, self._size = address, wanted

    def push(self, number: int, parts: "list[tuple[moderngl.Buffer, int, int]]") -> None:
        self._reserve(sum(size for _, _, size in parts))
        self._forget()
        at = 0
        self._gl.bind(_WRITE, self._name)
        for buffer, offset, size in parts:
            self._gl.bind(_READ, buffer.glo)
            self._gl.copy(_READ, _WRITE, offset, at, size)
            at += size
        self._gl.bind(_READ, 0)
        self._gl.bind(_WRITE, 0)
        self._fence, self.number, self._used = self._gl.fence(_COMMANDS_COMPLETE, 0), number, at

    def read(self, timeout: float) -> np.ndarray:
        if self._fence is not None:
            status = self._gl.wait(self._fence, _FLUSH_FIRST, int(timeout * 1e9))
            if status not in _REACHED:
                raise DeviceLostError(f"the GPU did not answer within {timeout:.0f} s, or was lost",
                                      remedy="start pointglass again")
            self._forget()
        words = (ctypes.c_uint32 * (self._used // 4)).from_address(self._address)
        return np.ctypeslib.as_array(words)

    @property
    def ready(self) -> bool:
        return self._fence is None or self._gl.wait(self._fence, _FLUSH_FIRST, 0) in _REACHED

    def _forget(self) -> None:
        fence, self._fence = self._fence, None
        if fence is not None:
            self._gl.forget(fence)

    def release(self) -> None:
        self._forget()
        self.number = None
        if self._size:
            self._gl.delete(1, ctypes.byref(self._name))  # which unmaps it
            self._size = 0


class ReadRing:
    """The last ``slots`` copies of a context, by number.  Use on the context's thread only."""

    def __init__(self, context: "moderngl.Context", slots: int):
        functions = _Functions(context)
        self._slots = [_Slot(functions) for _ in range(slots)]
        self._context = context

    @staticmethod
    def available(context: "moderngl.Context") -> bool:
        """Whether the driver can keep buffers mapped (OpenGL 4.4 or the extension)."""
        return context.version_code >= 440 or "GL_ARB_buffer_storage" in context.extensions

    def push(self, number: int, parts: "list[tuple[moderngl.Buffer, int, int]]") -> None:
        """Copies parts of buffers, (buffer, offset, bytes) in words of 4 bytes, as copy ``number``; the oldest is dropped."""
        self._context.memory_barrier()
        self._slots[number % len(self._slots)].push(number, parts)

    def read(self, number: int, timeout: float = TIMEOUT) -> np.ndarray | None:
        """(n,) uint32 of copy ``number``, valid until the ring comes round; None where it was dropped or never made.

        Waits until the GPU has made it.  Raises DeviceLostError where that takes longer than ``timeout`` seconds.
        """
        slot = self._slots[number % len(self._slots)]
        return slot.read(timeout) if slot.number == number else None

    def ready(self, number: int) -> bool:
        """Whether :meth:`read` would not wait."""
        slot = self._slots[number % len(self._slots)]
        return slot.number != number or slot.ready

    def release(self) -> None:
        """Frees the buffers; arrays that :meth:`read` returned become invalid."""
        for slot in self._slots:
            slot.release()


class PlainRing:
    """The same by plain buffers, whose reading waits for the GPU: for drivers that cannot keep buffers mapped."""

    def __init__(self, context: "moderngl.Context", slots: int):
        self._context = context
        self._made: list[tuple[int | None, moderngl.Buffer, int]] = [
            (None, context.buffer(reserve=_LEAST), 0) for _ in range(slots)]

    def push(self, number: int, parts: "list[tuple[moderngl.Buffer, int, int]]") -> None:
        """As ReadRing."""
        self._context.memory_barrier()
        place = number % len(self._made)
        buffer, total = self._made[place][1], sum(size for _, _, size in parts)
        if total > buffer.size:
            buffer.orphan(1 << (total - 1).bit_length())
        at = 0
        for source, offset, size in parts:
            self._context.copy_buffer(buffer, source, size, read_offset=offset, write_offset=at)
            at += size
        self._made[place] = number, buffer, total

    def read(self, number: int, timeout: float = TIMEOUT) -> np.ndarray | None:
        """As ReadRing; ``timeout`` is not kept."""
        held, buffer, size = self._made[number % len(self._made)]
        return np.frombuffer(buffer.read(size), np.uint32) if held == number else None

    def ready(self, number: int) -> bool:
        """As ReadRing; here reading waits, whenever it is."""
        return True

    def release(self) -> None:
        """Frees the buffers."""
        for _, buffer, _ in self._made:
            buffer.release()


def make_ring(context: "moderngl.Context", slots: int) -> ReadRing | PlainRing:
    """The better of both that the driver allows."""
    return (ReadRing if ReadRing.available(context) else PlainRing)(context, slots)
