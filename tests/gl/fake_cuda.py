"""A CUDA that is not there: cuda.core, cuda.bindings and torch.cuda as far as the bridge uses them, over real OpenGL buffers.

Mapping reads the OpenGL buffer into host memory at a fresh address and unmapping writes it back, so that whatever happens
outside of a map is lost, as it would be.  Signatures are those of the packages, which ``test_fakes_have_the_signatures_of``
checks where they are installed.  ``Driver.log`` holds what was called, in order.
"""

import ctypes
import enum
import sys
import types
import weakref
from contextlib import contextmanager
from time import perf_counter

import numpy as np
import torch

STREAM = 0x5EED


class Status(enum.IntEnum):
    cudaSuccess = 0
    cudaErrorMemoryAllocation = 2
    cudaErrorInvalidResourceHandle = 400
    cudaErrorUnknown = 999


class CUDAError(Exception):
    """cuda.core's own; its base is Exception."""


class Driver:
    """What both packages stand on.

    fail: name of a call -> the Status it returns.  null: registering gives a null handle.  deaf: unmapping forgets to hand
    the pixels back.  short: bytes missing from what is mapped.
    """

    def __init__(self):
        self.buffers: dict[int, object] = {}  # every OpenGL buffer made, by name
        self.fail: dict[str, Status] = {}
        self.null = self.deaf = False
        self.short = 0
        self.log: list[str] = []
        self.mapped: dict[int, ctypes.Array] = {}
        self._kept: list[ctypes.Array] = []

    def call(self, name: str) -> Status:
        self.log.append(name)
        return self.fail.get(name, Status.cudaSuccess)

    def map(self, name: int) -> tuple[int, int]:
        assert name not in self.mapped, "mapped twice"
        data = self.buffers[name].read()  # type: ignore[attr-defined]
        memory = (ctypes.c_uint8 * len(data)).from_buffer_copy(data)
        self.mapped[name] = memory
        self._kept = [*self._kept[-2:], memory]  # so that the next has another address
        return ctypes.addressof(memory), len(data) - self.short

    def unmap(self, name: int) -> None:
        memory = self.mapped.pop(name)
        if not self.deaf:
            self.buffers[name].write(bytes(memory))  # type: ignore[attr-defined]


class RecordingContext:
    """A moderngl context that remembers its buffers by their OpenGL names."""

    def __init__(self, context, driver: Driver):
        self._context, self._driver = context, driver

    def __getattr__(self, name):
        return getattr(self._context, name)

    def buffer(self, *arguments, **named):
        made = self._context.buffer(*arguments, **named)
        self._driver.buffers[made.glo] = made
        return made

    def memory_barrier(self):
        self._driver.log.append("memory_barrier")
        self._context.memory_barrier()


def core_module(driver: Driver) -> types.ModuleType:
    """cuda.core."""

    def check(name: str) -> None:
        status = driver.call(name)
        if status:
            raise CUDAError(f"{status.name}: made up\nand advice nobody asked for")

    class Buffer:
        """Its lifetime is that of the mapping, as the documentation says."""

        def __init__(self, pointer: int, size: int):
            self.handle, self.size = pointer, size

    class GraphicsResource:
        @classmethod
        def from_gl_buffer(cls, gl_buffer, *, flags=None, stream=None):
            check("from_gl_buffer")
            self = cls()
            self._name = gl_buffer
            return self

        def map(self, *, stream):
            assert stream.handle == STREAM
            check("map")
            made = Buffer(*driver.map(self._name))
            self._end = weakref.finalize(made, lambda: self._name in driver.mapped and driver.unmap(self._name))
            return made

        def unmap(self, *, stream=None):
            check("unmap")
            self._end.detach()
            driver.unmap(self._name)

        def close(self, stream=None):
            check("close")
            driver.mapped.pop(self._name, None)

    class Device:
        def __init__(self, device_id=None):
            self.device_id = device_id

        def set_current(self, ctx=None):
            check("set_current")

        def create_stream(self, obj=None, options=None):
            version, handle = obj.__cuda_stream__()
            assert version == 0
            return types.SimpleNamespace(handle=handle)

    module = types.ModuleType("cuda.core")
    module.__dict__.update(GraphicsResource=GraphicsResource, Device=Device, Buffer=Buffer)
    return module


class Resource:
    """cudaGraphicsResource_t."""

    def __init__(self, name: int, handle: int):
        self.name, self._handle = name, handle

    def __int__(self) -> int:
        return self._handle


def runtime_module(driver: Driver) -> types.ModuleType:
    """cuda.bindings.runtime: every call returns a tuple, its status first; what failed gives None for the rest."""

    def cudaGraphicsGLRegisterBuffer(buffer, flags):
        status = driver.call("cudaGraphicsGLRegisterBuffer")
        return (status, None if status else Resource(buffer, 0 if driver.null else 7))

    def cudaGraphicsMapResources(count, resources, stream):
        assert count == 1 and isinstance(resources, Resource) and stream == STREAM
        return (driver.call("cudaGraphicsMapResources"),)

    def cudaGraphicsResourceGetMappedPointer(resource):
        status = driver.call("cudaGraphicsResourceGetMappedPointer")
        return (status, None, None) if status else (status, *driver.map(resource.name))

    def cudaGraphicsUnmapResources(count, resources, stream):
        assert count == 1 and stream == STREAM
        status = driver.call("cudaGraphicsUnmapResources")
        if not status and resources.name in driver.mapped:
            driver.unmap(resources.name)
        return (status,)

    def cudaGraphicsUnregisterResource(resource):
        return (driver.call("cudaGraphicsUnregisterResource"),)

    def cudaGLGetDevices(cudaDeviceCount, deviceList):
        status = driver.call("cudaGLGetDevices")
        return (status, 1, [3])

    def cudaGetErrorString(error):
        return (Status.cudaSuccess, error.name.encode())

    module = types.ModuleType("cuda.bindings.runtime")
    module.__dict__.update({f.__name__: f for f in (
        cudaGraphicsGLRegisterBuffer, cudaGraphicsMapResources, cudaGraphicsResourceGetMappedPointer,
        cudaGraphicsUnmapResources, cudaGraphicsUnregisterResource, cudaGLGetDevices, cudaGetErrorString)})
    module.__dict__["cudaGLDeviceList"] = types.SimpleNamespace(cudaGLDeviceListAll=1)
    return module


def install(monkeypatch, driver: Driver, *, core: bool = True, bindings: bool = True) -> None:
    """Puts the fakes in place, as if NVIDIA's OpenGL drew.  core, bindings: whether that package is 'installed'."""
    for module in ("network.cuda_bridge", "device.match_device"):
        monkeypatch.setattr(f"pointglass.viewer.render.{module}.sharing_problem", lambda context: None)
    for name in ("cuda", "cuda.core", "cuda.bindings", "cuda.bindings.runtime"):
        monkeypatch.setitem(sys.modules, name, None)
    package = types.ModuleType("cuda")
    monkeypatch.setitem(sys.modules, "cuda", package)
    if core:
        monkeypatch.setitem(sys.modules, "cuda.core", core_module(driver))
    if bindings:
        parent, runtime = types.ModuleType("cuda.bindings"), runtime_module(driver)
        parent.__dict__["runtime"] = runtime
        monkeypatch.setitem(sys.modules, "cuda.bindings", parent)
        monkeypatch.setitem(sys.modules, "cuda.bindings.runtime", runtime)

    class Stream:
        device_index, cuda_stream = 0, STREAM

        def wait_event(self, event):
            driver.log.append("wait_event")

    class Event:
        def __init__(self, enable_timing=False):
            self._clock, self.moment = enable_timing, 0.0

        def record(self, stream=None):
            self.moment = perf_counter()
            if self._clock:
                assert isinstance(stream, Stream)  # of the work being timed, not the default one
            else:
                driver.log.append("record")

        def synchronize(self):
            if driver.fail.get("synchronize"):
                raise RuntimeError("CUDA error: device lost")

        def elapsed_time(self, after):
            assert self._clock and after._clock
            return (after.moment - self.moment) * 1e3

    @contextmanager
    def stream(chosen):
        assert isinstance(chosen, Stream)
        yield

    for name, value in {"Stream": Stream, "Event": Event, "stream": stream, "default_stream": lambda: None,
                        "current_device": lambda: 0, "device_count": lambda: 4, "set_device": lambda index: None,
                        "get_device_properties": lambda index: types.SimpleNamespace(name=f"GPU {index}")}.items():
        monkeypatch.setattr(torch.cuda, name, value)
    monkeypatch.setattr("pointglass.viewer.render.network.cuda_bridge.as_tensor", host_tensor)


def host_tensor(pointer: int, shape: tuple[int, ...]) -> torch.Tensor:
    """Half floats at an address of the host's."""
    raw = (ctypes.c_uint16 * int(np.prod(shape))).from_address(pointer)
    return torch.from_numpy(np.frombuffer(raw, np.float16).reshape(shape))
