"""Between OpenGL and torch: the network's pixels, through CUDA mapping where both share a GPU, else by read-back.

A bridge owns what the fill pass writes (``input``: (H, W, PACKED_IN) half floats) and what the picture is made from
(``output``: (H, W, PACKED_OUT)).  Mapping (viewer/render/network/cuda_bridge.py) is tried first, by cuda.core, then by
cuda.bindings; the copy through host memory here is the fallback and the reference.  Each is used only after a self-test: a
pattern written by OpenGL and changed by torch must come back right.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ....model.network.network_layout import PACKED_IN, PACKED_OUT
from ...common.errors import DeviceError, Option
from ..device.self_test import run_self_test

if TYPE_CHECKING:
    import moderngl
    import torch

    from ..device.context import Device
    from ..device.shader import Programs

TESTED = 4096
"""Pixels that the self-test compares: enough for several rows and workgroups; a choice."""


def check_room(device: "Device", size: tuple[int, int]) -> None:
    """Raises DeviceError where the pixels of a picture (width, height) do not fit into one buffer that a shader can address."""
    width, height = size
    needed = 2 * PACKED_IN * width * height
    if needed > device.buffer_limit:
        raise DeviceError(f"a neural picture of {width}x{height} needs a buffer of {needed >> 20} MiB, and this device has "
                          f"{device.buffer_limit >> 20} MiB at most",
                          remedy=("choose a smaller ", Option("--size"), " or ", Option("--view", "filled")))


class Pixels(Protocol):
    """A bridge's input or output: a buffer, or a part of one.  size: bytes."""

    @property
    def size(self) -> int: ...

    def bind_to_storage_buffer(self, binding: int = 0) -> None: ...
    def read(self) -> bytes: ...
    def write(self, data) -> None: ...


class Network(Protocol):
    """A network as a bridge runs it: (H, W, PACKED_IN) half -> (H, W, PACKED_OUT) half, on ``device``."""

    device: str

    def __call__(self, packed: "torch.Tensor") -> "torch.Tensor": ...


class Bridge(Protocol):
    """Owns the pixels for one picture size.  kind: how they are transferred, for display."""

    kind: str
    size: tuple[int, int]

    @property
    def input(self) -> Pixels: ...

    @property
    def output(self) -> Pixels: ...

    def run(self, network: Network) -> Callable[[], float] | None:
        """Reads ``input``, runs the network, writes ``output``.

        Returns a function that waits and returns the elapsed milliseconds; None where the work is done on return.
        """
        ...

    def release(self) -> None: ...


class ReadBackBridge:
    """Copies through host memory: for machines without CUDA, and the reference the mapping is tested against.

    given: (H, W, PACKED_IN) float32, values of half floats, where the input was made in main memory; None: ``input`` holds it.
    made: (H, W, PACKED_OUT) half floats, what the network made last; it is uploaded when ``output`` is asked for.
    """

    kind = "read-back"

    def __init__(self, context: "moderngl.Context", size: tuple[int, int]):
        self._context, self.size = context, size
        width, height = size
        self.input: moderngl.Buffer = context.buffer(reserve=2 * PACKED_IN * width * height)
        self._output: moderngl.Buffer = context.buffer(reserve=2 * PACKED_OUT * width * height)
        self._copied = context.texture(size, PACKED_OUT // 2, dtype="u4")
        self._host = np.empty((height, width, PACKED_IN), np.float16)
        self.given: np.ndarray | None = None
        self.made = np.zeros((height, width, PACKED_OUT), np.float16)
        self._uploaded: np.ndarray | None = self.made

    def sent(self) -> np.ndarray:
        """(H, W, PACKED_IN), what the network is given: values of half floats; overwritten by the next picture."""
        if self.given is not None:
            return self.given
        self._context.memory_barrier()
        self.input.read_into(self._host)
        return self._host

    def run(self, network: Network) -> None:
        import torch

        self.made = run_on_host(network, torch.from_numpy(self.sent()))

    @property
    def output(self) -> "moderngl.Buffer":
        if self._uploaded is not self.made:
            self._output.write(self.made)
            self._uploaded = self.made
        return self._output

    def output_texture(self) -> "moderngl.Texture":
        """The output, two half floats in each of two words a pixel.  For the shader that shows it: software OpenGL reads a
        texture in half the time of a storage block."""
        self._copied.write(self.output)
        return self._copied

    def release(self) -> None:
        for owned in (self.input, self._output, self._copied):
            owned.release()


def run_on_host(network: Network, packed: "torch.Tensor") -> np.ndarray:
    """(H, W, PACKED_OUT) half of a network and its input in main memory, half or float32."""
    if network.device != "cpu":
        packed = packed.to(network.device).half()
    return np.ascontiguousarray(network(packed).cpu().numpy())


def works(programs: "Programs", bridge: Bridge, device: str = "cpu") -> bool:
    """Self-test: OpenGL writes a pattern, torch doubles it and adds one, OpenGL reads it back; True where the result is right.

    Compares the first TESTED pixels.  device: torch's.
    """
    pixels = min(bridge.size[0] * bridge.size[1], TESTED)
    target = programs.context.buffer(reserve=4 * PACKED_OUT * pixels)
    try:
        run_self_test(programs, 1, bridge.input, target, PACKED_IN * pixels // 2)
        bridge.run(_Doubler(device))
        run_self_test(programs, 2, bridge.output, target, PACKED_OUT * pixels // 2)
        made = np.frombuffer(target.read(), np.uint32).reshape(pixels, PACKED_OUT)
    finally:
        target.release()
    sent = (np.arange(PACKED_IN * pixels) % 1021).reshape(pixels, PACKED_IN)[:, :PACKED_OUT]
    return bool(np.array_equal(made, 2 * sent + 1))


class _Doubler:
    """The self-test's network."""

    def __init__(self, device: str):
        self.device = device

    def __call__(self, packed: "torch.Tensor") -> "torch.Tensor":
        return (packed[..., :PACKED_OUT] * 2 + 1).contiguous()
