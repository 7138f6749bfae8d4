"""Failures of a device as errors that a person can act on.  CUDA's come in many types; any other error is a bug."""

import re

from ...common.errors import DeviceError, Option

_OF_DEVICE = re.compile(
    r"CUDA( driver)? error|CUDA out of memory|cuDNN error|CUDNN_STATUS|CUBLAS_STATUS|cudaError|CUDA_ERROR"
    r"|unable to find an engine"  # cuDNN's message on a device that is too old or short of memory
)
_CUDA_TYPES = ("AcceleratorError", "CUDAError", "CudaCallError")
"""Types of torch, cuda.core and this project, by name: none of these libraries need be installed."""


class DeviceMemoryError(DeviceError):
    """The device has not enough memory for what was asked of it (exit code 3); less memory for points may help."""


class CudaCallError(RuntimeError):
    """A call of cuda.bindings that did not return cudaSuccess."""


def device_failure(error: BaseException) -> DeviceError | None:
    """The error to raise where ``error`` came from the CUDA device or its memory; None for any other error (a bug)."""
    if isinstance(error, DeviceError):
        return error
    name, reason = type(error).__name__, first_line(error)
    if name == "OutOfMemoryError":
        return DeviceMemoryError(f"the GPU has not enough memory left for the network ({reason})",
                                 remedy=("choose a smaller size or ", Option("--quality", "fast")))
    if name in _CUDA_TYPES or (isinstance(error, RuntimeError) and _OF_DEVICE.search(reason)):
        return DeviceError(f"the GPU failed while the network ran ({reason})",
                           remedy=("start again, or use ", Option("--device", "cpu")))
    return None


def first_line(error: BaseException) -> str:
    """An error's message without the lines of advice that CUDA's errors carry; its type where it has none."""
    lines = str(error).strip().splitlines()
    return lines[0].strip() if lines else type(error).__name__
