"""Between OpenGL and torch: the network's pixels, through CUDA mapping where both share a GPU, else by read-back.

A storage buffer maps to CUDA as plain memory (a texture would map as an opaque array), so the fill pass writes the
network's layout straight into ``input`` and the network's result is read by OpenGL from ``output``.  Both are mapped
once a frame; on that path nothing passes through the host.
"""

from typing import TYPE_CHECKING, Protocol

import numpy as np

from model.reconstruct import PACKED_IN, PACKED_OUT
from viewer.errors import DeviceError

if TYPE_CHECKING:
    import moderngl
    import torch

    from model.reconstruct import Reconstructor


class Bridge(Protocol):
    """Owns the two buffers for one picture size.  kind: how pixels travel, for every place that shows it."""

    kind: str
    input: "moderngl.Buffer"
    output: "moderngl.Buffer"

    def run(self, network: "Reconstructor") -> None:
        """Reads ``input``, runs the network, writes ``output``."""
        ...

    def release(self) -> None: ...


class ReadBackBridge:
    """Copies through host memory: for machines without CUDA, and the reference the mapping is tested against."""

    kind = "read-back"

    def __init__(self, context: "moderngl.Context", size: tuple[int, int]):
        import torch

        self._context = context
        width, height = size
        self.input = context.buffer(reserve=2 * PACKED_IN * width * height)
        self.output = context.buffer(reserve=2 * PACKED_OUT * width * height)
        self._host = np.empty((height, width, PACKED_IN), np.float16)
        self._torch = torch.from_numpy(self._host)

    def run(self, network: "Reconstructor") -> None:
        self._context.memory_barrier()
        self.input.read_into(self._host)
        made = network(self._torch.to(network.device))
        self.output.write(made.cpu().numpy())

    def release(self) -> None:
        self.input.release()
        self.output.release()


class CudaBridge:
    """Maps both buffers into CUDA: nothing is copied through the host.

    Raises DeviceError where the buffers cannot be registered (another GPU draws than computes, no cuda.core, VirtualGL).
    """

    kind = "CUDA mapping"

    def __init__(self, context: "moderngl.Context", size: tuple[int, int]):
        try:
            import torch
            from cuda.core import Device, GraphicsResource  # type: ignore[import-not-found]
        except ImportError as error:
            raise DeviceError(f"CUDA mapping needs the cuda extra (pip install 'pointglass[cuda]'): {error}") from None
        width, height = size
        self.input = context.buffer(reserve=2 * PACKED_IN * width * height)
        self.output = context.buffer(reserve=2 * PACKED_OUT * width * height)
        self._shapes = (height, width, PACKED_IN), (height, width, PACKED_OUT)
        self._resources: list = []
        try:
            device = Device(torch.cuda.current_device())
            device.set_current()
            # torch's own stream, so that the mapping is ordered with the network without a device-wide wait
            self._stream = device.create_stream(_TorchStream(torch.cuda.current_stream().cuda_stream))
            self._resources += [
                GraphicsResource.from_gl_buffer(self.input.glo, flags="read_only"),
                GraphicsResource.from_gl_buffer(self.output.glo, flags="write_discard"),
            ]
        except Exception as error:
            self.release()
            raise DeviceError(f"OpenGL buffers cannot be mapped into CUDA here: {str(error).splitlines()[0]}") from None

    def run(self, network: "Reconstructor") -> None:
        source, target = self._resources
        with source.map(stream=self._stream) as pixels, target.map(stream=self._stream) as picture:
            packed = _as_tensor(pixels, self._shapes[0])
            _as_tensor(picture, self._shapes[1]).copy_(network(packed), non_blocking=True)

    def release(self) -> None:
        for resource in self._resources:
            resource.close()
        self._resources = []
        self.input.release()
        self.output.release()


class _TorchStream:
    """torch's stream in the form cuda.core takes foreign streams."""

    def __init__(self, handle: int):
        self._handle = handle

    def __cuda_stream__(self) -> tuple[int, int]:
        return 0, self._handle


class _DeviceMemory:
    """Mapped memory as an array that torch reads without copying."""

    def __init__(self, pointer: int, shape: tuple[int, ...]):
        self.__cuda_array_interface__ = {"shape": shape, "typestr": "<f2", "data": (pointer, False), "version": 3}


def _as_tensor(buffer, shape: tuple[int, ...]) -> "torch.Tensor":
    import torch

    return torch.as_tensor(_DeviceMemory(int(buffer.handle), shape), device="cuda")


def make_bridge(context: "moderngl.Context", size: tuple[int, int], device: str) -> tuple[Bridge, str | None]:
    """The bridge for a device, and why the CUDA mapping is not used where it could have been."""
    if device != "cuda":
        return ReadBackBridge(context, size), None
    try:
        return CudaBridge(context, size), None
    except DeviceError as error:
        return ReadBackBridge(context, size), str(error)
