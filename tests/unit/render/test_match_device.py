"""Which CUDA device belongs to an OpenGL device, of machines with two GPUs, and how much memory points may take."""

import sys
from types import SimpleNamespace

import pytest

from pointglass.viewer.render.device import gpu_memory
from pointglass.viewer.render.device.match_device import CudaDevice, OpenGLDevice, match

A, B, OTHER = (bytes([value] * 16) for value in (1, 2, 3))
TWO = [CudaDevice(0, "NVIDIA RTX A", A), CudaDevice(1, "NVIDIA RTX B", B)]
TWINS = [CudaDevice(0, "NVIDIA H100"), CudaDevice(1, "NVIDIA H100")]


@pytest.mark.parametrize(("drawing", "devices", "index", "word"), [
    (OpenGLDevice("NVIDIA RTX B/PCIe", (B,)), TWO, 1, "UUID"),
    (OpenGLDevice("NVIDIA RTX A/PCIe", (B,), runtime=(0,), egl=0), TWO, 1, "UUID"),  # the UUID is the surest
    (OpenGLDevice("Mesa Intel(R) UHD Graphics 620", (OTHER,)), TWO, None, "no CUDA device"),  # a laptop's other GPU draws
    (OpenGLDevice("NVIDIA H100", runtime=(1,)), TWINS, 1, "cudaGLGetDevices"),
    (OpenGLDevice("Mesa Intel(R) UHD Graphics 620", runtime=()), TWINS, None, "no CUDA device"),
    (OpenGLDevice("NVIDIA H100/PCIe", egl=1), TWINS, 1, "EGL_NV_device_cuda"),  # headless, the second of two equal cards
    (OpenGLDevice("NVIDIA H100/PCIe", egl=7), TWINS, None, "nothing distinguishes them"),  # hidden by CUDA_VISIBLE_DEVICES
    (OpenGLDevice("NVIDIA RTX B/PCIe/SSE2"), TWO, 1, "name"),
    (OpenGLDevice("NVIDIA H100"), TWINS, None, "nothing distinguishes them"),
    (OpenGLDevice("llvmpipe (LLVM 15)"), TWO, None, "no CUDA device is named like"),
    (OpenGLDevice("llvmpipe (LLVM 15)"), [], None, "there is no CUDA device"),
])  # fmt: skip
def test_the_cuda_device_of_what_draws(drawing, devices, index, word):
    made = match(drawing, devices)
    assert made.index == index and word in made.how and "\n" not in made.how


class Context:
    """An OpenGL context whose memory extensions answer with ``kib`` KiB."""

    def __init__(self, *extensions: str, vendor: str = "NVIDIA Corporation"):
        self.extensions = set(extensions)
        self.info = {"GL_RENDERER": "some GPU", "GL_VENDOR": vendor, "GL_VERSION": "4.6",
                     "GL_MAX_SHADER_STORAGE_BLOCK_SIZE": 1 << 27, "GL_MAX_TEXTURE_SIZE": 16384}  # fmt: skip


@pytest.mark.parametrize(("extension", "vendor"), [
    ("GL_NVX_gpu_memory_info", "NVIDIA Corporation"), ("GL_ATI_meminfo", "AMD"), ("torch", "NVIDIA Corporation"),
])  # fmt: skip
@pytest.mark.parametrize("free", [2 << 30, 8 << 30, 139 << 30])
def test_points_may_take_a_share_of_what_the_device_has_free(monkeypatch, extension, vendor, free):
    monkeypatch.setattr(gpu_memory, "integers", lambda context, name, count: [free >> 10] * count)
    cuda = SimpleNamespace(is_initialized=lambda: True, mem_get_info=lambda: (free, 2 * free))
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(cuda=cuda))
    budget, source = gpu_memory.point_budget(Context(extension, vendor=vendor), software=False)  # type: ignore[arg-type]
    assert free / 4 <= budget <= 3 * free / 4 and extension.split(".")[0] in source


def test_a_device_that_says_nothing_gets_a_fixed_budget(monkeypatch):
    monkeypatch.setattr(gpu_memory, "integers", lambda context, name, count: [0] * count)
    budget, source = gpu_memory.point_budget(Context("GL_ATI_meminfo", vendor="Intel"), software=False)  # type: ignore[arg-type]
    assert budget == gpu_memory.UNKNOWN_BUDGET and "does not say" in source
