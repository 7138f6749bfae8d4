"""Around the bridge, without a GPU: which EGL device is which CUDA device, whose fault an error is, graphs and folding."""

import copy
import ctypes.util
import inspect
import subprocess
import sys
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import nn

from model import reconstruct
from model.engines import ENGINES, Captured, Runner, fold_normalisation
from model.reconstruct import PACKED_IN, PACKED_OUT
from model.unet import SIZES, CompactUNet, PaperUNet
from viewer.errors import DeviceError, InputError
from viewer.render import bridge, egl, neural
from viewer.render.context import Device
from viewer.render.cuda_bridge import CudaCallError, device_failure
from viewer.render.renderer import Renderer
from viewer.settings import Settings

# -- sizes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size, limit, software, fits", [
    ((3840, 2160), 1 << 27, False, True), ((4096, 2160), 1 << 27, False, False), ((4096, 2160), 1 << 27, True, True),
    ((8192, 8192), 1 << 27, True, True), ((16384, 16384), 1 << 27, True, False), ((16384, 16384), (1 << 31) - 1, False, False),
])
def test_a_picture_beyond_a_buffer_is_refused_before_it_is_begun(size, limit, software, fits):
    device = Device("any", "any", "4.5", software, storage_limit=limit, texture_limit=16384)
    if fits:
        bridge.check_room(device, size)
        return
    with pytest.raises(DeviceError, match=f"a neural picture of {size[0]}x{size[1]} needs .* --size or --view filled"):
        bridge.check_room(device, size)


# -- CUDA by use -------------------------------------------------------------------------------------------------------


def test_a_device_that_adds_but_does_not_convolve_is_a_problem(monkeypatch):
    """As on cards that torch still knows and its cuDNN no longer does."""
    made, convolve = torch.zeros, torch.nn.functional.conv2d
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch, "zeros", lambda *size, device=None, **more: made(*size, **more))
    assert reconstruct.cuda_problem() is None

    def too_old(*arguments, **more):
        convolve(*arguments, **more)
        raise RuntimeError("GET was unable to find an engine to execute this computation\nmore")

    monkeypatch.setattr(reconstruct.F, "conv2d", too_old)
    said = reconstruct.cuda_problem()
    assert said == "a first convolution on CUDA failed: GET was unable to find an engine to execute this computation"


# -- EGL devices ----------------------------------------------------------------------------------------------------


class Devices:
    """numbers: each EGL device's CUDA number; None: not NVIDIA's, and must not be asked."""

    def __init__(self, *numbers: int | None):
        self.numbers = numbers

    def all(self):
        return [100 + i for i in range(len(self.numbers))]

    def extensions(self, device):
        return "EGL_MESA_device_software" if self.numbers[device - 100] is None else f"EGL_EXT_device_drm {egl.EXTENSION}"

    def cuda(self, device):
        assert self.numbers[device - 100] is not None, "asked a device that does not know the question"
        return self.numbers[device - 100]


@pytest.mark.parametrize(("numbers", "current", "expected"), [
    ((None, 0), 0, 1),  # Mesa's device comes first
    ((2, 0, 1), 1, 2),  # another order than CUDA's
    ((0,), 0, 0),
    ((None,), 0, None),
    ((), 0, None),
    ((0, 1), 2, None),  # torch's device is not among them
    ((0, 0, 1), 0, None),  # a driver that gives a number twice
])  # fmt: skip
def test_the_egl_device_is_torchs_cuda_device(monkeypatch, numbers, current, expected):
    monkeypatch.delenv("GLCONTEXT_DEVICE_INDEX", raising=False)
    monkeypatch.setattr(egl, "current_cuda_number", lambda: current)
    assert egl.matching_device(Devices(*numbers)) == expected
    others = [index for index in range(len(numbers)) if index != expected]
    assert egl.device_order(Devices(*numbers)) == ([] if expected is None else [expected]) + others or [None]
    monkeypatch.setenv("GLCONTEXT_DEVICE_INDEX", "0")
    assert egl.matching_device(Devices(*numbers)) is None
    assert egl.device_order(Devices(*numbers)) == [None]


ORDERED = """
import moderngl
from viewer.errors import DeviceError
from viewer.render import context
asked, real = [], moderngl.create_context
def noted(**settings):
    asked.append(settings["device_index"])
    return real(**settings)
moderngl.create_context = noted
for order, last in (([None], 0), ([0], 0), ([77, 0, 88], 1)):
    asked.clear()
    context.device_order = lambda: order
    context.create_context().release()
    assert asked == order[: last + 1], (asked, order)
context.device_order = lambda: [77, 88]
try:
    context.create_context()
except DeviceError as error:
    assert "index 77" in str(error), error
else:
    raise AssertionError
"""


@pytest.mark.gl
def test_a_context_is_made_on_the_first_device_that_draws():
    """In a process of its own: contexts of this one would no longer be current."""
    subprocess.run([sys.executable, "-c", ORDERED], check=True, timeout=120)


WITHOUT_X = """
import ctypes.util
real = ctypes.util.find_library
ctypes.util.find_library = lambda name: "libGL-that-wants-X.so" if name == "GL" else real(name)
from viewer.render.context import create_context
create_context().release()
"""


@pytest.mark.gl
def test_a_machine_without_x_draws():
    """There libGL may not be, or not load: it wants X's libraries.  libOpenGL and libEGL do not."""
    if ctypes.util.find_library("OpenGL") is None:
        pytest.skip("libOpenGL is not installed (apt install libopengl0)")
    subprocess.run([sys.executable, "-c", WITHOUT_X], check=True, timeout=120)


def test_every_real_egl_device_answers_or_is_not_asked():
    try:
        devices = egl.EglDevices()
    except (OSError, AttributeError) as error:
        pytest.skip(f"no EGL that lists devices: {error}")
    assert len(egl.cuda_numbers(devices)) == len(devices.all()) > 0


# -- whose fault -----------------------------------------------------------------------------------------------------


class AcceleratorError(RuntimeError):
    """As torch's; its constructor is not for us."""


class CUDAError(Exception):
    """As cuda.core's."""


@pytest.mark.parametrize("error", [
    torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 20 MiB.\nmore"),
    AcceleratorError("CUDA error: unspecified launch failure\nCUDA kernel errors might be asynchronously reported"),
    RuntimeError("GET was unable to find an engine to execute this computation"),
    CUDAError("CUDA_ERROR_ILLEGAL_ADDRESS: The device encountered a load"),
    CudaCallError("cudaGraphicsMapResources: unknown error (999)"),
    RuntimeError("cuDNN error: CUDNN_STATUS_EXECUTION_FAILED"),
    DeviceError("already said"),
])  # fmt: skip
def test_a_failed_device_is_one_line_with_a_remedy(error):
    said = device_failure(error)
    assert said and "\n" not in said
    assert isinstance(error, DeviceError) or "--device cpu" in said or "smaller" in said


@pytest.mark.parametrize("error", [
    RuntimeError("Expected all tensors to be on the same device, but found at least two devices, cuda:0 and cpu!"),
    RuntimeError("shape '[2]' is invalid for input of size 3"), ValueError("CUDA"), AssertionError(),
])  # fmt: skip
def test_a_bug_is_not_blamed_on_the_device(error):
    assert device_failure(error) is None


def test_torch_still_raises_what_is_recognised():
    assert issubclass(torch.OutOfMemoryError, RuntimeError) and torch.OutOfMemoryError.__name__ == "OutOfMemoryError"
    assert issubclass(torch.AcceleratorError, RuntimeError)


class Stage(neural.NeuralStage):
    """A stage whose bridge fails with ``error``."""

    def __init__(self, error: Exception, gl_error: str = "GL_NO_ERROR"):
        class Bridge:
            def run(self, _network):
                raise error

        class Context:
            error = gl_error

        self.key, self._runner, self.network = ("balanced",), None, None  # type: ignore[assignment]
        self.bridge, self.context = Bridge(), Context()  # type: ignore[assignment]


def test_a_lost_device_is_a_device_error_and_the_stage_is_made_anew():
    stage = Stage(AcceleratorError("CUDA error: device lost\nadvice"))
    with pytest.raises(DeviceError, match=r"the GPU failed .*device lost.*--device cpu") as caught:
        stage.infer()
    assert "advice" not in str(caught.value) and stage.key != ("balanced",)
    stage = Stage(ValueError("a bug"), gl_error="GL_CONTEXT_LOST")
    with pytest.raises(DeviceError, match="driver was reset"):
        stage.infer()
    stage = Stage(ValueError("a bug"))
    with pytest.raises(ValueError, match="a bug"):
        stage.infer()
    assert stage.key == ("balanced",)


def test_a_stage_is_made_anew_for_what_it_is_made_of_and_kept_otherwise(monkeypatch):
    """One after the other: each of these settings changes the network or where it runs, the others do not."""
    there, made = [], []

    def stage(_programs, _size, *key):
        made.append(key)
        there.append(key)
        return SimpleNamespace(key=key, release=lambda: there.remove(key))

    monkeypatch.setattr(neural, "NeuralStage", stage)
    renderer = SimpleNamespace(_neural=None, _device="cuda", _programs=None, _size=(4, 4))
    plain = Settings(quality="fast", device="cpu")
    others = [{"quality": "best"}, {"filter": "off"}, {"weights": "own.safetensors"}, {"precision": "fp32"}, {"device": "auto"}]
    for settings in (plain, *(replace(plain, **other) for other in others)):
        for same in (settings, replace(settings, filter_strength=2.0, lod=1.0)):
            assert Renderer._neural_for(renderer, same) is renderer._neural  # type: ignore[arg-type]
            assert there == [renderer._neural.key]
    device, filtered = [key[-1] for key in made], [key[1] for key in made]
    assert len(made) == len(set(made)) == 6
    assert device == ["cpu"] * 5 + ["cuda"] and filtered == [True, True, False, True, True, True]


# -- graphs ----------------------------------------------------------------------------------------------------------


class Network:
    """A Reconstructor as far as a Runner goes, on the CPU."""

    device, engine = "cpu", "graph"

    def made(self, packed):
        return (packed[..., :PACKED_OUT] * 2 + packed[..., PACKED_OUT:]).contiguous()

    __call__ = made


class Graph:
    """A capture that behaves as a CUDA graph does: fixed buffers in and out, nothing but the recorded work."""

    def __init__(self, work, example):
        self.input, self.work = torch.zeros_like(example), work
        self.output = work(self.input)

    def __call__(self, packed):
        self.input.copy_(packed)
        self.output.copy_(self.work(self.input))
        return self.output


def test_a_graph_gives_what_the_network_gives():
    seed = int(np.random.default_rng().integers(2**31))
    generator = torch.Generator().manual_seed(seed)
    for height, width in ((1, 1), (7, 13), (64, 48)):
        runner = Runner(Network(), height, width, capture=Graph)  # type: ignore[arg-type]
        assert runner.engine == "graph" and runner.problem is None and runner.name == ENGINES["graph"]
        for _ in range(3):
            packed = torch.rand((height, width, PACKED_IN), generator=generator).half()
            assert torch.equal(runner(packed), Network().made(packed)), f"seed {seed}"
        runner.release()
        runner.release()


class Cuda:
    """torch.cuda as far as a capture uses it, on the CPU; ``log`` holds what was called."""

    def __init__(self, monkeypatch):
        self.log: list[str] = []
        log = self.log

        class Stream:
            def wait_stream(self, _stream):
                log.append("wait")

        class Graph:
            def replay(self):
                log.append("replay")

        @contextmanager
        def graph(cuda_graph, pool=None, stream=None, capture_error_mode="global"):
            assert isinstance(cuda_graph, Graph) and capture_error_mode == "thread_local"
            log.append("capture")
            yield
            log.append("captured")

        self.graph = graph
        fakes = {"Stream": Stream, "CUDAGraph": Graph, "graph": graph, "stream": lambda _stream: nullcontext(),
                 "current_stream": Stream, "synchronize": lambda: log.append("synchronize")}
        for name, fake in fakes.items():
            monkeypatch.setattr(torch.cuda, name, fake)


def test_a_capture_warms_up_first_and_a_frame_only_copies_and_replays(monkeypatch):
    real = inspect.signature(torch.cuda.graph).parameters
    cuda = Cuda(monkeypatch)
    assert list(inspect.signature(cuda.graph).parameters) == list(real)[:4]
    made = []

    def work(packed):
        cuda.log.append("work")
        made.append(packed[..., :PACKED_OUT].clone())
        return made[-1]

    captured = Captured(work, torch.zeros((2, 3, PACKED_IN), dtype=torch.float16))
    assert cuda.log == ["wait", "work", "work", "work", "wait", "capture", "work", "captured", "synchronize"]
    cuda.log.clear()
    packed = torch.rand(2, 3, PACKED_IN).half()
    assert captured(packed) is made[-1] and torch.equal(captured._input, packed)
    assert cuda.log == ["replay"]


@pytest.mark.parametrize("engine", list(ENGINES))
def test_a_capture_that_fails_falls_back_and_says_so(monkeypatch, engine):
    monkeypatch.setattr(torch, "compile", lambda work, dynamic: work)  # importing the real one takes seconds

    def refuse(_work, _example):
        raise RuntimeError("operation not permitted when stream is capturing\nadvice")

    runner = Runner(Network(), 4, 4, engine=engine, capture=refuse)  # type: ignore[arg-type]
    packed = torch.rand(4, 4, PACKED_IN).half()
    assert runner.engine == "eager" and torch.equal(runner(packed), Network().made(packed))
    if engine == "eager":
        assert runner.problem is None
    else:
        assert "not permitted" in runner.name and "advice" not in runner.name and runner.name.startswith(ENGINES["eager"])


def test_tensorrt_that_is_not_installed_falls_back_to_a_graph():
    if __import__("importlib.util").util.find_spec("torch_tensorrt"):
        pytest.skip("torch_tensorrt is installed")
    runner = Runner(Network(), 4, 4, engine="tensorrt", capture=Graph)  # type: ignore[arg-type]
    assert runner.engine == "graph" and "torch_tensorrt" in runner.name


def test_no_memory_is_not_hidden_by_a_fallback():
    def full(_work, _example):
        raise torch.OutOfMemoryError("CUDA out of memory")

    with pytest.raises(torch.OutOfMemoryError):
        Runner(Network(), 4, 4, capture=full)  # type: ignore[arg-type]


def test_an_unknown_engine_in_the_environment_is_refused(monkeypatch):
    monkeypatch.setenv(neural.ENGINE_VARIABLE, "vulkan")
    with pytest.raises(InputError, match="vulkan: expected one of graph"):
        neural.load_network("balanced", True, None, "auto", "made up")


# -- folding ---------------------------------------------------------------------------------------------------------


def lively(network: nn.Module, seed: int) -> nn.Module:
    """Random weights and normalisation statistics, as after training."""
    generator = torch.Generator().manual_seed(seed)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d):
            for tensor, low, high in ((module.running_mean, -1, 1), (module.running_var, 0.1, 2),
                                      (module.weight.data, 0.2, 2), (module.bias.data, -1, 1)):
                assert tensor is not None
                tensor.copy_(torch.rand(tensor.shape, generator=generator) * (high - low) + low)
        elif isinstance(module, (nn.Conv2d, nn.ConvTranspose2d)):
            module.weight.data.copy_(torch.randn(module.weight.shape, generator=generator) / module.weight[0].numel() ** 0.5)
    return network.eval().requires_grad_(False)


@pytest.mark.parametrize(("dtype", "limit"), [(torch.float64, 1e-12), (torch.float32, 1e-5)])
def test_folded_normalisation_changes_nothing(dtype, limit):
    seed = int(np.random.default_rng().integers(2**31))
    plain = lively(PaperUNet(8), seed).to(dtype)
    folded = fold_normalisation(copy.deepcopy(plain))
    assert not any(isinstance(module, nn.BatchNorm2d) for module in folded.modules())
    x = torch.rand((1, 5, 40, 56), generator=torch.Generator().manual_seed(seed)).to(dtype)
    expected, made = plain(x), folded(x)
    assert expected.std() > 1e-3
    assert (made - expected).abs().max() <= limit * expected.abs().max(), f"seed {seed}"


def test_a_network_without_normalisation_is_left_alone():
    network = CompactUNet(SIZES["fast"]).eval()
    before = copy.deepcopy(network.state_dict())
    after = fold_normalisation(network).state_dict()
    assert list(before) == list(after) and all(torch.equal(before[name], after[name]) for name in before)
