"""How a network runs at one picture size: call by call, as a CUDA graph, or compiled; and folding of batch normalisation.

A CUDA graph is captured on static buffers after a warm-up and replayed from then on, so that a frame only copies its pixels
and replays: it allocates nothing, compiles nothing and does not wait.  torch.compile is captured in a graph as well.  An engine
that is not available here is replaced by the next slower one; ``Runner.name`` and the log give the reason.  Only
:class:`EngineError` leads to such a fallback: any other exception is a bug or a failed device, and is raised.
"""

import logging
from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from .network_layout import PACKED_IN
from .runnable import Runnable

ENGINES = {
    "graph": "a CUDA graph",
    "eager": "call by call",
    "compile": "torch.compile, in a CUDA graph",
}
"""Engines of a Runner, for messages.  Only CUDA has a choice: on a CPU the network runs eagerly."""
_WARM_UP = 3
"""Runs before a capture, as torch's documentation recommends, so that cuDNN has chosen its algorithms."""

Work = Callable[[Tensor], Tensor]
"""(H, W, C) half -> (H, W, D) half, always of one size."""

_log = logging.getLogger(__name__)


class EngineError(RuntimeError):
    """An engine is not available on this device or installation; the message is one line."""


def fold_normalisation(network: nn.Module) -> nn.Module:
    """Merges batch normalisation, which in evaluation mode is a scale and a shift, into the convolution before it.

    network: in evaluation mode; it is changed and returned.  Networks without batch normalisation are unchanged.
    """
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
    """``work`` on static buffers as a CUDA graph.

    Raises EngineError where CUDA refuses the capture.  Errors of the warm-up, which runs ``work`` without a graph, and a lack
    of memory are raised as they are.
    """

    def __init__(self, work: Work, example: Tensor):
        self._input = torch.zeros_like(example)
        side = torch.cuda.Stream()  # a capture must not depend on work of the default stream
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(_WARM_UP):
                work(self._input)
        torch.cuda.current_stream().wait_stream(side)
        self._graph = torch.cuda.CUDAGraph()
        # thread_local: other threads may load a scan or weights during the capture.  The outer stream context restores the
        # current stream where a capture fails.
        here = torch.cuda.stream(torch.cuda.current_stream())
        try:
            with here, torch.cuda.graph(self._graph, capture_error_mode="thread_local"):
                self._output = work(self._input)
        except torch.OutOfMemoryError:
            raise
        except RuntimeError as error:
            raise EngineError(_first_line(error)) from error
        torch.cuda.synchronize()

    def __call__(self, packed: Tensor) -> Tensor:
        """The result is overwritten by the next call."""
        self._input.copy_(packed, non_blocking=True)
        self._graph.replay()
        return self._output


class Runner:
    """A network for one picture size.

    engine: a key of ENGINES; None: the network's own.  ``self.engine`` is the one in use, ``problem`` why it is not the one
    asked for, or None.  device: of the tensors it takes and returns.  capture: makes a graph of a piece of work; tests replace
    it.  Raises torch.OutOfMemoryError where the device has no memory left: a slower engine needs as much.
    """

    def __init__(self, network: Runnable, height: int, width: int, *, engine: str | None = None,
                 capture: Callable[[Work, Tensor], Work] = Captured):
        self.device = network.device
        asked = engine or network.engine
        self._work: Work | None = network
        self.engine, self.problem = "eager", None
        problems = []
        with torch.inference_mode():
            example = torch.zeros((height, width, PACKED_IN), dtype=torch.float16, device=self.device)
            for name in dict.fromkeys((asked, "graph")) if asked != "eager" else ():
                try:
                    self._work = capture(_PREPARED[name](network, example), example)
                    self.engine = name
                    break
                except EngineError as error:
                    problems.append(f"{ENGINES[name]} failed: {error}")
        self.problem = "; ".join(problems) or None
        _log.log(logging.WARNING if self.problem else logging.INFO, "the network runs %dx%d %s", width, height, self.name)

    @property
    def name(self) -> str:
        """The engine in use, and why it is not the one asked for."""
        return ENGINES[self.engine] + (f" ({self.problem})" if self.problem else "")

    @torch.inference_mode()
    def __call__(self, packed: Tensor) -> Tensor:
        """(H, W, PACKED_IN) half -> (H, W, PACKED_OUT) half, which the next call may overwrite."""
        assert self._work is not None, "released"
        return self._work(packed)

    def release(self) -> None:
        """Frees the graph and its memory after the last run has finished."""
        if self._work is None:
            return
        captured = self.engine != "eager" and self.device == "cuda"
        try:
            if captured:
                torch.cuda.synchronize()
            self._work = None
            if captured:
                torch.cuda.empty_cache()
        except RuntimeError:  # the device was lost, and its memory with it
            self._work = None


def _uncompiled(network: Runnable, _example: Tensor) -> Work:
    return network.made


def _compiled(network: Runnable, example: Tensor) -> Work:
    """Raises EngineError where torch.compile does not work here, for example without Triton or a C++ compiler."""
    work = torch.compile(network.made, dynamic=False)
    try:
        work(example)
    except torch.OutOfMemoryError:
        raise
    except (RuntimeError, ImportError) as error:  # an error of the network itself is raised again by the next engine
        raise EngineError(_first_line(error)) from error
    return work


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]


_PREPARED: dict[str, Callable[[Runnable, Tensor], Work]] = {"graph": _uncompiled, "compile": _compiled}
