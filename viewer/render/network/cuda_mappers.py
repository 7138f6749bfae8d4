"""The two libraries that can map an OpenGL buffer into CUDA: cuda.core, and the CUDA runtime through cuda.bindings."""

from typing import TYPE_CHECKING, Any, Protocol

from ..device.device_failure import CudaCallError

if TYPE_CHECKING:
    import torch


class Mapper(Protocol):
    """One OpenGL buffer registered with CUDA."""

    def __init__(self, buffer: int, stream: "torch.cuda.Stream"): ...

    def map(self) -> tuple[int, int]:
        """Hands the buffer to CUDA, on the stream: device address and bytes."""
        ...

    def unmap(self) -> None:
        """Hands it back to OpenGL, on the stream."""
        ...

    def close(self) -> None: ...


class CoreMapper:
    """By cuda.core's GraphicsResource (cuda-core >= 0.7)."""

    def __init__(self, buffer: int, stream: "torch.cuda.Stream"):
        from cuda.core import Device, GraphicsResource  # type: ignore[import-not-found]

        device = Device(stream.device_index)
        device.set_current()  # the primary context, which is torch's
        self._stream = device.create_stream(_ForeignStream(stream))
        self._resource = GraphicsResource.from_gl_buffer(buffer)
        self._mapped: Any = None

    def map(self) -> tuple[int, int]:
        mapped = self._mapped = self._resource.map(stream=self._stream)  # kept: it is unmapped when the last reference goes
        return int(mapped.handle), int(mapped.size)

    def unmap(self) -> None:
        self._resource.unmap()  # on the stream that it was mapped on
        self._mapped = None

    def close(self) -> None:
        self._resource.close()


class BindingsMapper:
    """By the CUDA runtime through cuda.bindings, whose calls return their status first."""

    def __init__(self, buffer: int, stream: "torch.cuda.Stream"):
        from cuda.bindings import runtime  # type: ignore[import-not-found]

        self._runtime, self._stream = runtime, stream.cuda_stream
        (self._resource,) = self._call("cudaGraphicsGLRegisterBuffer", buffer, 0)
        if not int(self._resource):  # cuda-bindings 12.9.3
            raise CudaCallError("cudaGraphicsGLRegisterBuffer reported success and gave no handle; update cuda-bindings")

    def _call(self, name: str, *arguments) -> list:
        status, *made = getattr(self._runtime, name)(*arguments)
        if int(status) != 0:
            _, text = self._runtime.cudaGetErrorString(status)
            raise CudaCallError(f"{name}: {text.decode() if isinstance(text, bytes) else text} ({int(status)})")
        return made

    def map(self) -> tuple[int, int]:
        self._call("cudaGraphicsMapResources", 1, self._resource, self._stream)
        try:
            pointer, size = self._call("cudaGraphicsResourceGetMappedPointer", self._resource)
        except CudaCallError:
            self.unmap()
            raise
        return int(pointer), int(size)

    def unmap(self) -> None:
        self._call("cudaGraphicsUnmapResources", 1, self._resource, self._stream)

    def close(self) -> None:
        if self._resource is not None:
            resource, self._resource = self._resource, None
            self._call("cudaGraphicsUnregisterResource", resource)


MAPPERS: dict[str, type[Mapper]] = {"cuda.core": CoreMapper, "cuda.bindings": BindingsMapper}
"""In the order they are tried."""


class _ForeignStream:
    """torch's stream in the form cuda.core takes foreign streams; keeps it alive."""

    def __init__(self, stream: "torch.cuda.Stream"):
        self._stream = stream

    def __cuda_stream__(self) -> tuple[int, int]:
        return 0, int(self._stream.cuda_stream)
