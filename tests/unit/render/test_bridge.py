"""Around the bridge, without a GPU: which EGL device is which CUDA device, whose fault an error is, stages made anew."""

import ctypes.util
import subprocess
import sys
import threading
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pointglass.model.network import reconstruct
from pointglass.viewer.common.errors import DeviceError
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device import egl
from pointglass.viewer.render.device.context import Device
from pointglass.viewer.render.device.device_failure import CudaCallError, DeviceMemoryError, device_failure
from pointglass.viewer.render.device.match_device import on_same_device
from pointglass.viewer.render.network import bridge, neural
from pointglass.viewer.render.network.background_capture import BackgroundRunner
from pointglass.viewer.render.renderer import Renderer
from pointglass.viewer.render.sized_passes import KeptPasses

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


@pytest.fixture
def second_gpu(monkeypatch):
    """As where OpenGL draws on the second of two GPUs: this thread uses it, a new thread the first one, as CUDA has it."""
    chosen = threading.local()
    chosen.index = 1

    @contextmanager
    def device(index):
        before = getattr(chosen, "index", 0)
        chosen.index = index
        yield
        chosen.index = before

    monkeypatch.setattr(torch.cuda, "current_device", lambda: getattr(chosen, "index", 0))
    monkeypatch.setattr(torch.cuda, "device", device)
    monkeypatch.setattr(torch.cuda, "is_initialized", lambda: True)


def test_the_network_and_its_capture_run_on_the_gpu_that_draws_whatever_their_thread(second_gpu):
    used = []

    class Engine:
        device, name = "cuda", "an engine"

        def __init__(self, network, height, width, engine=None):
            used.append(torch.cuda.current_device())

        def __call__(self, packed):
            return torch.full_like(packed, torch.cuda.current_device())

        def release(self):
            used.append(torch.cuda.current_device())

    runner = BackgroundRunner(None, 1, 1, make=Engine)  # type: ignore[arg-type]
    runner.settle()  # which releases the first
    runner.release()
    assert used == [1, 1, 1, 1]
    stage, ended = Stage(ValueError()), threading.Event()
    stage._on_device = on_same_device("cuda")  # type: ignore[assignment]
    Engine.device = "cpu"  # where tensors can be made
    stage._runner, stage.photographs = Engine(None, 1, 1), None  # type: ignore[assignment]
    read_back = object.__new__(bridge.ReadBackBridge)
    read_back.given = np.full((1, 1, 8), 9, np.float16)
    stage.bridge = read_back  # type: ignore[assignment]
    stage.start(1, ended.set)
    assert ended.wait(20)
    done = stage._thread.take(1)
    stage._thread.close()
    assert done is not None and done.error is None and (done.made == 1).all()


def test_weights_loaded_on_another_gpu_are_not_those_of_the_one_that_draws(second_gpu, monkeypatch):
    """A window loads them on a thread of its own, before it knows which GPU draws."""
    monkeypatch.setattr(neural, "_networks", {})
    monkeypatch.setattr(neural, "Reconstructor", lambda *_, **__: torch.cuda.current_device())
    loader = threading.Thread(target=neural.load_network, args=("fast", True, None, "auto", "cuda"))
    loader.start()
    loader.join(20)
    assert [neural.load_network("fast", True, None, "auto", "cuda") for _ in range(2)] == [1, 1]
    assert sorted(neural._networks.values()) == [0, 1]  # type: ignore[type-var]


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
    others = [index for index in range(len(numbers)) if index != expected]
    assert egl.device_order(Devices(*numbers)) == ([] if expected is None else [expected]) + others or [None]
    monkeypatch.setenv("GLCONTEXT_DEVICE_INDEX", "0")
    assert egl.device_order(Devices(*numbers)) == [None]


ORDERED = """
import moderngl
from pointglass.viewer.common.errors import DeviceError
from pointglass.viewer.render.device import context
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
from pointglass.viewer.render.device.context import create_context
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
    failure = device_failure(error)
    assert failure is not None and failure.exit_code == 3
    said = str(failure)
    assert isinstance(failure, DeviceMemoryError) == isinstance(error, torch.OutOfMemoryError)
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
        self._thread, self._on_device = neural.NetworkThread(), nullcontext


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


def renderer_of(kept_sizes: int):
    """What a renderer for CUDA needs to make a network's stage."""
    sizes = KeptPasses(None, 64, kept_sizes)  # type: ignore[arg-type]
    return SimpleNamespace(_sizes=sizes, _passes=sizes.use((4, 4)), _device="cuda")


def test_a_stage_is_made_anew_for_what_it_is_made_of_and_kept_otherwise(monkeypatch):
    """One after the other: each of these settings changes the network or where it runs, the others do not."""
    there, made = [], []

    def stage(_programs, _size, *key, background):
        made.append(key)
        there.append(key)
        return SimpleNamespace(key=key, usable=True, release=lambda: there.remove(key))

    monkeypatch.setattr(neural, "NeuralStage", stage)
    renderer = renderer_of(kept_sizes=0)
    plain = Settings(quality="fast", device="cpu")
    others = [{"quality": "best"}, {"filter": "off"}, {"weights": "own.safetensors"}, {"precision": "fp32"}, {"device": "auto"}]
    for settings in (plain, *(replace(plain, **other) for other in others)):
        for same in (settings, replace(settings, filter_strength=2.0, lod=1.0)):
            assert Renderer._neural_for(renderer, same, background=False) is renderer._passes.neural  # type: ignore[arg-type]
            assert there == [renderer._passes.neural.key]
    device, filtered = [key[-1] for key in made], [key[1] for key in made]
    assert len(made) == len(set(made)) == 6
    assert device == ["cpu"] * 5 + ["cuda"] and filtered == [True, True, False, True, True, True]


def test_a_window_that_alternates_between_two_networks_makes_each_once(monkeypatch):
    """In flight a smaller one stands in; a third replaces the one that was used longer ago, and a failed one is not kept."""
    there, made = [], []

    def stage(_programs, _size, *key, background):
        made.append(key[0])
        there.append(key[0])
        return SimpleNamespace(key=key, usable=True, release=lambda: there.remove(key[0]))

    monkeypatch.setattr(neural, "NeuralStage", stage)
    renderer = renderer_of(kept_sizes=2)
    for quality in ("balanced", "fast", "balanced", "fast", "balanced"):
        used = Renderer._neural_for(renderer, Settings(quality=quality), background=True)  # type: ignore[arg-type]
        assert used.key[0] == quality
    assert made == ["balanced", "fast"]
    Renderer._neural_for(renderer, Settings(quality="best"), background=True)  # type: ignore[arg-type]
    assert made == ["balanced", "fast", "best"] and sorted(there) == ["balanced", "best"]
    renderer._passes.neural.usable, renderer._passes.neural.key = False, ("failed",)
    Renderer._neural_for(renderer, Settings(quality="best"), background=True)  # type: ignore[arg-type]
    assert there == ["best"] and made[-1] == "best"
