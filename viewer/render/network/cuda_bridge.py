"""OpenGL's pixels mapped into CUDA: one buffer, registered once, mapped once a frame; nothing is copied through the host.

A storage buffer maps to CUDA as plain memory (a texture would map as an opaque array).  Input and output are two parts of
one buffer, so that one map serves both with either library.  A frame's work is ordered on one of torch's streams: mapping
waits for earlier OpenGL commands, unmapping makes OpenGL wait for CUDA; the host does not wait.
"""

import contextlib
from typing import TYPE_CHECKING

from ....model.network.network_layout import PACKED_IN, PACKED_OUT
from ...common.errors import DeviceError
from ..device.context import sharing_problem
from ..device.device_failure import CudaCallError, first_line
from ..device.match_device import other_gpu
from .bridge import Network, works
from .cuda_mappers import MAPPERS, Mapper

if TYPE_CHECKING:
    import moderngl
    import torch

    from ..device.shader import Programs

ALIGNMENT = 256
"""Bytes: the largest alignment of a storage buffer's offset that OpenGL allows a driver to require."""


class Region:
    """A part of a buffer, used as a buffer of its own.  offset, size: bytes."""

    def __init__(self, buffer: "moderngl.Buffer", offset: int, size: int):
        self._buffer, self._offset, self.size = buffer, offset, size

    def bind_to_storage_buffer(self, binding: int = 0) -> None:
        self._buffer.bind_to_storage_buffer(binding, self._offset, self.size)

    def read(self) -> bytes:
        return self._buffer.read(self.size, offset=self._offset)

    def write(self, data) -> None:
        if memoryview(data).nbytes > self.size:
            raise ValueError(f"{memoryview(data).nbytes} bytes do not fit into {self.size}")
        self._buffer.write(data, offset=self._offset)


class Clock:
    """Milliseconds between two events on a stream; calling it waits for them.  Valid until the run after next."""

    def __init__(self):
        import torch

        self.start, self.stop = (torch.cuda.Event(enable_timing=True) for _ in range(2))

    def __call__(self) -> float:
        try:
            self.stop.synchronize()
            return self.start.elapsed_time(self.stop)
        except RuntimeError:  # the device was lost: the next picture raises it
            return 0.0


class CudaBridge:
    """Maps a buffer into CUDA.  kind: by which library.  problem: why an earlier library in the order is not used, or None.

    mappers: names of MAPPERS to try, in order (default: all).
    Raises DeviceError with the problem of each where none works: OpenGL draws on another GPU, the packages are missing,
    VirtualGL; and without trying any where another vendor's driver draws.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int], mappers: tuple[str, ...] = tuple(MAPPERS)):
        import torch

        if (problem := sharing_problem(programs.context)) is not None:
            raise DeviceError(f"OpenGL's buffers cannot be mapped into CUDA here ({problem})")
        self._context, self.size = programs.context, size
        width, height = size
        self._shapes = (height, width, PACKED_IN), (height, width, PACKED_OUT)
        input_bytes, output_bytes = (2 * width * height * channels for channels in (PACKED_IN, PACKED_OUT))
        self._offset = -(-input_bytes // ALIGNMENT) * ALIGNMENT
        self._bytes = self._offset + output_bytes
        self._buffer = self._context.buffer(reserve=self._bytes)
        self.input = Region(self._buffer, 0, input_bytes)
        self.output = Region(self._buffer, self._offset, output_bytes)
        self._mapper: Mapper | None = None
        self._views: tuple[int, torch.Tensor, torch.Tensor] | None = None
        tried: list[str] = []
        try:
            self._stream = torch.cuda.Stream()
            self._before = torch.cuda.Event()
            self._clocks = [Clock(), Clock()]
            for name in mappers:
                if (problem := self._try(name, programs)) is None:
                    self.kind = f"CUDA mapping by {name}"
                    self.problem = "; ".join(tried) or None
                    return
                tried.append(f"{name}: {problem}")
        except BaseException:
            self.release()
            raise
        self.release()
        raise DeviceError(f"OpenGL's buffers cannot be mapped into CUDA here ({'; '.join(tried)}{other_gpu(programs.context)})")

    def _try(self, name: str, programs: "Programs") -> str | None:
        """Registers the buffer by one library and tests it: the problem, or None where it works and is kept."""
        try:
            self._mapper = MAPPERS[name](self._buffer.glo, self._stream)
            if works(programs, self, "cuda"):
                return None
            problem = "the self-test's pattern came back wrong"
        except ImportError as error:
            problem = f"not installed or too old ({first_line(error)}); pip install --upgrade cuda-core cuda-bindings"
        except Exception as error:  # each library has errors of its own, and so have drivers
            problem = first_line(error)
        self._close_mapper()
        return problem

    def run(self, network: Network) -> "Clock":
        import torch

        assert self._mapper is not None
        self._clocks.reverse()
        clock = self._clocks[0]
        self._context.memory_barrier()
        with torch.inference_mode(), torch.cuda.stream(self._stream):
            self._before.record(torch.cuda.default_stream())  # where weights were loaded
            self._stream.wait_event(self._before)
            source, target = self._mapped(*self._mapper.map())
            try:
                clock.start.record(self._stream)
                target.copy_(network(source), non_blocking=True)
                clock.stop.record(self._stream)
            except BaseException:
                self._unmap_quietly()
                raise
            self._mapper.unmap()
        return clock

    def _mapped(self, pointer: int, size: int) -> "tuple[torch.Tensor, torch.Tensor]":
        """The two parts as tensors.  The address rarely changes, and they are kept while it does not."""
        if self._views is None or self._views[0] != pointer:
            try:
                if not pointer or size < self._bytes:
                    raise CudaCallError(f"mapping gave {size} bytes at {pointer:#x}, {self._bytes} were expected")
                parts = (as_tensor(pointer, self._shapes[0]), as_tensor(pointer + self._offset, self._shapes[1]))
            except BaseException:
                self._unmap_quietly()
                raise
            self._views = pointer, *parts
        return self._views[1], self._views[2]

    def _unmap_quietly(self) -> None:
        """While another error is being raised, which must not be replaced."""
        try:
            if self._mapper is not None:
                self._mapper.unmap()
        except Exception:
            pass

    def _close_mapper(self) -> None:
        mapper, self._mapper, self._views = self._mapper, None, None
        try:
            if mapper is not None:
                mapper.close()
        except Exception:  # a lost device cannot unregister
            pass

    def release(self) -> None:
        with contextlib.suppress(Exception):  # a lost device has nothing left to wait for
            self._stream.synchronize()  # nothing promises that unregistering waits for what still uses the pixels
        self._close_mapper()
        self._buffer.release()


class _DeviceMemory:
    """Device memory as an array that torch reads without copying."""

    def __init__(self, pointer: int, shape: tuple[int, ...]):
        self.__cuda_array_interface__ = {"shape": shape, "typestr": "<f2", "data": (pointer, False), "version": 3}


def as_tensor(pointer: int, shape: tuple[int, ...]) -> "torch.Tensor":
    """(…) half floats at a device address, as torch's own.  Raises CudaCallError where torch made a copy."""
    import torch

    made = torch.as_tensor(_DeviceMemory(pointer, shape), device="cuda")
    if made.data_ptr() != pointer:
        raise CudaCallError("torch copied the mapped pixels instead of using them in place")
    return made
