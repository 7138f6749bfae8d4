"""How the network is run for one picture size: eagerly, as a CUDA graph, compiled, or by TensorRT; normalisation folded.

A CUDA graph is captured after a warm-up on static buffers and replayed from then on: a steady frame copies its pixels in,
replays, and allocates, compiles and waits for nothing.  torch.compile and TensorRT (the extra ``tensorrt``) are captured
in a graph as well.  What cannot be had falls back to the next best, and ``Runner.name`` says so and why.
"""

import copy
from collections.abc import Callable
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from model.network_layout import PACKED_IN

if TYPE_CHECKING:
    from model.reconstruct import Reconstructor

ENGINES = {
    "graph": "a CUDA graph",
    "eager": "call by call",
    "compile": "torch.compile, in a CUDA graph",
    "tensorrt": "TensorRT, in a CUDA graph",
}
"""What a Runner can be asked for.  Only CUDA has a choice: on a CPU the network runs eagerly."""
_WARM_UP = 3

Work = Callable[[Tensor], Tensor]
"""(H, W, C) half -> (H, W, D) half, always of one size."""


def fold_normalisation(network: nn.Module) -> nn.Module:
    """The same network without its batch normalisation, which in use is a scale and a shift that the convolution before
    it takes over.  Networks without any come back as they are.  In evaluation mode; changes ``network`` itself."""
    for module in network.modules():
        if not isinstance(module, nn.Sequential):
            continue
        layers: list[nn.Module] = []
        for layer in module:
            if isinstance(layer, nn.BatchNorm2d) and layers and isinstance(layers[-1], nn.Conv2d):
                layers[-1] = fuse_conv_bn_eval(layers[-1], layer)
            else:
                layers.append(layer)
        if len(layers) < len(module):
            del module[:]
            module.extend(layers)
    return network


class Captured:
    """``work`` on static buffers as a CUDA graph.  Raises whatever the warm-up or the capture met."""

    def __init__(self, work: Work, example: Tensor):
        self._input = torch.zeros_like(example)
        side = torch.cuda.Stream()  # what is captured must not have been set up on the default stream
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(_WARM_UP):
                work(self._input)
        torch.cuda.current_stream().wait_stream(side)
        self._graph = torch.cuda.CUDAGraph()
        # another thread may load a scan or weights meanwhile: only this one is forbidden what a capture forbids; and a capture
        # that fails must not leave its stream current
        here = torch.cuda.stream(torch.cuda.current_stream())
        with here, torch.cuda.graph(self._graph, capture_error_mode="thread_local"):
            self._output = work(self._input)
        torch.cuda.synchronize()

    def __call__(self, packed: Tensor) -> Tensor:
        """The result is overwritten by the next call."""
        self._input.copy_(packed, non_blocking=True)
        self._graph.replay()
        return self._output


class Runner:
    """A Reconstructor's network for one picture size.

    engine: a key of ENGINES, what is used; ``problem``: why not what was asked for, or None.
    device: of the tensors it takes and returns.  capture: makes a graph of a piece of work, replaceable in tests.
    """

    def __init__(self, network: "Reconstructor", height: int, width: int, *, engine: str | None = None,
                 capture: Callable[[Work, Tensor], Work] = Captured):
        self.device = network.device
        asked = engine or network.engine
        self._work: Work | None = network
        self.engine, self.problem = "eager", None
        if asked == "eager":
            return
        problems = []
        with torch.inference_mode():
            example = torch.zeros((height, width, PACKED_IN), dtype=torch.float16, device=self.device)
            for name in dict.fromkeys((asked, "graph")):
                try:
                    self._work = capture(_PREPARED[name](network, example), example)
                    self.engine = name
                    break
                except torch.OutOfMemoryError:
                    raise  # what follows needs as much
                except Exception as error:
                    said = str(error).strip() or type(error).__name__
                    problems.append(f"{ENGINES[name]} failed: {said.splitlines()[0]}")
        self.problem = "; ".join(problems) or None

    @property
    def name(self) -> str:
        """What runs the network, and why not what was asked for where that failed."""
        return ENGINES[self.engine] + (f" ({self.problem})" if self.problem else "")

    @torch.inference_mode()
    def __call__(self, packed: Tensor) -> Tensor:
        """(H, W, PACKED_IN) half -> (H, W, PACKED_OUT) half, which the next call may overwrite."""
        assert self._work is not None, "released"
        return self._work(packed)

    def release(self) -> None:
        """Frees the graph and its memory, once nothing uses them any more."""
        if self._work is None:
            return
        captured = self.engine != "eager" and self.device == "cuda"
        try:
            if captured:
                torch.cuda.synchronize()
            self._work = None
            if captured:
                torch.cuda.empty_cache()
        except RuntimeError:  # a lost device has nothing left to free
            self._work = None


def _as_it_is(network: "Reconstructor", _example: Tensor) -> Work:
    return network.made


def _compiled(network: "Reconstructor", _example: Tensor) -> Work:
    return torch.compile(network.made, dynamic=False)


def _tensorrt(network: "Reconstructor", example: Tensor) -> Work:
    import torch_tensorrt  # type: ignore[import-not-found]

    other = copy.copy(network)
    other.network = torch_tensorrt.compile(network.network, ir="dynamo", inputs=[network.channels(example)])
    return other.made


_PREPARED: dict[str, Callable[["Reconstructor", Tensor], Work]] = {
    "graph": _as_it_is, "compile": _compiled, "tensorrt": _tensorrt,
}
