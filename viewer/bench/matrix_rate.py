"""Measured matrix multiplication rate of a device, with which the speed of a network is compared.

A multiply-accumulate counts as two operations.  The best of several runs is taken, as the rate is an upper limit.
"""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch

CONV = (256, 128, 2)
"""Input and output channels, and reduction of the picture's sides, of the 3x3 convolution with the largest share of the
operations of the paper's network.  All its levels take nearly the same."""


def synchronise(device: str) -> None:
    """Waits until the device has finished all submitted work."""
    import torch

    if device == "cuda":
        torch.cuda.synchronize()


def best_seconds(work: Callable[[], object], device: str, seconds: float, least: int = 3) -> float:
    """Seconds of the fastest of at least ``least`` runs within about ``seconds``, after a warm-up.

    On CUDA, runs are timed in batches, so that the launch latency is hidden as in a CUDA graph.
    """
    batch = 10 if device == "cuda" else 1
    work()
    synchronise(device)
    best, begun, runs = float("inf"), time.perf_counter(), 0
    while runs < least or time.perf_counter() - begun < seconds:
        start = time.perf_counter()
        for _ in range(batch):
            work()
        synchronise(device)
        best = min(best, (time.perf_counter() - start) / batch)
        runs += 1
    return best


def matmul_rate(device: str, dtype: "torch.dtype", *, side: int | None = None, seconds: float = 1.0) -> float:
    """Operations per second of a square matrix product.  side: default 8192 on CUDA, 2048 elsewhere."""
    import torch

    side = side or (8192 if device == "cuda" else 2048)
    with torch.inference_mode():
        a, b = (torch.randn(side, side, device=device).to(dtype) for _ in range(2))
        out = torch.empty_like(a)
        return 2.0 * side**3 / best_seconds(lambda: torch.mm(a, b, out=out), device, seconds)


def conv_rate(device: str, dtype: "torch.dtype", size: tuple[int, int], *, seconds: float = 1.0) -> float:
    """Operations per second of the CONV convolution, channels last, for a picture of ``size`` (width, height)."""
    import torch

    inside, outside, reduction = CONV
    width, height = (max(4, side // reduction) for side in size)
    with torch.inference_mode():
        conv = torch.nn.Conv2d(inside, outside, 3, padding=1, bias=False)
        conv = conv.to(device, dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        x = torch.randn(1, inside, height, width, device=device).to(dtype, memory_format=torch.channels_last)
        operations = 2.0 * 9 * inside * outside * width * height
        return operations / best_seconds(lambda: conv(x), device, seconds)
