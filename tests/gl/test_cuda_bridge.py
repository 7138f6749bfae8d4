"""The CUDA mapping's logic, without CUDA: fakes with the packages' signatures over real OpenGL buffers (fake_cuda.py)."""

import importlib
import inspect
import sys
from time import sleep

import numpy as np
import pytest
import torch
from fake_cuda import Driver, RecordingContext, Status, core_module, install, runtime_module

from pointglass.model.network.network_layout import PACKED_IN, PACKED_OUT
from pointglass.viewer.common.errors import DeviceError
from pointglass.viewer.doctor_probes import interop_item
from pointglass.viewer.render.device.context import sharing_problem
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.network.bridge import ReadBackBridge, works
from pointglass.viewer.render.network.choose_bridge import make_bridge
from pointglass.viewer.render.network.cuda_bridge import MAPPERS, CudaBridge

pytestmark = pytest.mark.gl

SIZES = [(96, 64), (33, 17), (1, 1), (127, 5), (301, 200)]


@pytest.fixture
def driver():
    return Driver()


@pytest.fixture
def programs(context, driver):
    made = Programs(RecordingContext(context, driver))  # type: ignore[arg-type]
    yield made
    made.release()


def network(packed: torch.Tensor) -> torch.Tensor:
    """Takes something from every channel."""
    return (packed.flip(0)[..., :PACKED_OUT] - 3 * packed[..., PACKED_OUT:]).contiguous()


network.device = "cpu"  # type: ignore[attr-defined]


def through(bridge, seed: int) -> bytes:
    width, height = bridge.size
    pixels = np.random.default_rng(seed).random((height, width, PACKED_IN)).astype(np.float16)
    bridge.input.write(pixels)
    bridge.output.write(np.full((height, width, PACKED_OUT), np.nan, np.float16))
    bridge.run(network)
    return bridge.output.read()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mapper", list(MAPPERS))
def test_mapped_pixels_equal_copied_ones_to_the_bit(monkeypatch, driver, programs, size, mapper, seed):
    install(monkeypatch, driver)
    mapped, copied = CudaBridge(programs, size, (mapper,)), ReadBackBridge(programs.context, size)
    for frame in range(3):
        assert through(mapped, seed + frame) == through(copied, seed + frame), f"seed {seed + frame}"
    assert mapped.kind == f"CUDA mapping by {mapper}" and not driver.mapped
    mapped.release()
    copied.release()


def test_a_frame_maps_once_between_opengl_and_the_network(monkeypatch, driver, programs):
    for mapper, calls in {"cuda.core": ["map", "network", "unmap"],
                          "cuda.bindings": ["cudaGraphicsMapResources", "cudaGraphicsResourceGetMappedPointer", "network",
                                            "cudaGraphicsUnmapResources"]}.items():
        install(monkeypatch, driver)
        bridge = CudaBridge(programs, (8, 8), (mapper,))
        driver.log.clear()

        def noted(packed):
            driver.log.append("network")
            return network(packed)

        bridge.run(noted)  # type: ignore[arg-type]
        assert driver.log == ["memory_barrier", "record", "wait_event", *calls]
        bridge.release()


def test_a_run_tells_its_own_time_and_a_lost_device_none(monkeypatch, driver, programs):
    install(monkeypatch, driver)
    bridge = CudaBridge(programs, (33, 17))

    def slow(packed):
        sleep(0.02)
        return network(packed)

    slow.device = "cpu"
    first, second = bridge.run(slow), bridge.run(network)
    assert first() >= 20 and second() > 0 and first() != second()  # the one before it can still be asked
    driver.fail["synchronize"] = Status.cudaErrorUnknown
    assert second() == 0


def test_the_order_is_core_then_bindings_then_a_copy_and_says_why(monkeypatch, driver, programs):
    install(monkeypatch, driver)
    bridge, why = make_bridge(programs, (8, 8), "cuda")
    assert bridge.kind == "CUDA mapping by cuda.core" and why is None
    bridge.release()
    install(monkeypatch, driver, core=False)
    bridge, why = make_bridge(programs, (8, 8), "cuda")
    assert bridge.kind == "CUDA mapping by cuda.bindings" and why
    assert "cuda.core: not installed" in why and "pip install --upgrade cuda-core" in why
    bridge.release()
    install(monkeypatch, driver)
    monkeypatch.delattr(sys.modules["cuda.core"], "GraphicsResource")  # as before 0.7
    bridge, why = make_bridge(programs, (8, 8), "cuda")
    assert bridge.kind == "CUDA mapping by cuda.bindings" and why
    assert "too old (cannot import name 'GraphicsResource'" in why and "--upgrade" in why
    bridge.release()
    install(monkeypatch, driver, core=False, bindings=False)
    bridge, why = make_bridge(programs, (8, 8), "cuda")
    assert bridge.kind == "read-back" and why and "cuda.core: not" in why and "cuda.bindings: not" in why
    bridge.release()
    bridge, why = make_bridge(programs, (8, 8), "cpu")
    assert bridge.kind == "read-back" and why is None
    bridge.release()


def test_cuda_is_not_asked_about_the_buffers_of_another_driver(monkeypatch, driver, programs):
    """It may crash: then there would be no picture at all."""
    install(monkeypatch, driver)
    for module in ("network.cuda_bridge", "device.match_device"):
        monkeypatch.setattr(f"pointglass.viewer.render.{module}.sharing_problem", sharing_problem)
    bridge, why = make_bridge(programs, (8, 8), "cuda")
    renderer = str(programs.context.info["GL_RENDERER"])
    assert bridge.kind == "read-back" and why and renderer in why and "only NVIDIA's OpenGL" in why
    found = interop_item(programs)
    assert found["status"] == "warn" and found["value"].count(renderer) == 1
    assert not driver.log
    bridge.release()


FAILURES = {
    "register": ({"from_gl_buffer": Status.cudaErrorUnknown, "cudaGraphicsGLRegisterBuffer": Status.cudaErrorUnknown}, {},
                 "cudaErrorUnknown"),
    "map": ({"map": Status.cudaErrorUnknown, "cudaGraphicsMapResources": Status.cudaErrorUnknown}, {}, "cudaErrorUnknown"),
    "pointer": ({"map": Status.cudaErrorUnknown, "cudaGraphicsResourceGetMappedPointer": Status.cudaErrorUnknown}, {},
                "cudaErrorUnknown"),
    "unmap": ({"unmap": Status.cudaErrorUnknown, "cudaGraphicsUnmapResources": Status.cudaErrorUnknown}, {},
              "cudaErrorUnknown"),
    "a map too small": ({}, {"short": 2}, "were expected"),
    "pixels that do not come back": ({}, {"deaf": True}, "came back wrong"),
}


@pytest.mark.parametrize("name", list(FAILURES))
def test_nothing_is_trusted_that_fails_at_any_step(monkeypatch, driver, programs, name):
    driver.fail, odd, said = dict(FAILURES[name][0]), FAILURES[name][1], FAILURES[name][2]
    vars(driver).update(odd)
    install(monkeypatch, driver)
    with pytest.raises(DeviceError) as caught:
        CudaBridge(programs, (8, 8))
    text = str(caught.value)
    assert text.count(said) == 2 and "cuda.core: " in text and "cuda.bindings: " in text and "\n" not in text
    assert "advice" not in text
    assert "OpenGL draws on CUDA device 3 of 4 (GPU 3), by cudaGLGetDevices, torch computes on CUDA device 0" in text
    assert "close" in driver.log or "from_gl_buffer" in driver.fail  # what was registered is given back


def test_success_with_a_null_handle_is_a_failure(monkeypatch, driver, programs):
    driver.null = True
    install(monkeypatch, driver, core=False)
    with pytest.raises(DeviceError, match="no handle; update cuda-bindings"):
        CudaBridge(programs, (8, 8))


def test_a_network_that_fails_hands_the_pixels_back(monkeypatch, driver, programs):
    install(monkeypatch, driver)
    bridge = CudaBridge(programs, (8, 8))

    def broken(_packed):
        raise RuntimeError("CUDA error: an illegal memory access was encountered")

    with pytest.raises(RuntimeError, match="illegal memory access"):
        bridge.run(broken)  # type: ignore[arg-type]
    assert not driver.mapped
    driver.fail = {"close": Status.cudaErrorUnknown}  # a lost device cannot unregister, and closing must not fail for it
    bridge.release()


def test_two_bridges_at_once_keep_their_pixels_apart(monkeypatch, driver, programs):
    install(monkeypatch, driver)
    bridges = [CudaBridge(programs, size) for size in ((40, 30), (13, 7))]
    copies = [ReadBackBridge(programs.context, bridge.size) for bridge in bridges]
    for frame in range(3):
        for bridge, copied in zip(bridges, copies):
            assert through(bridge, frame) == through(copied, frame)
    for owned in (*bridges, *copies):
        owned.release()


def test_the_self_test_finds_swapped_pixels(programs):
    class Swapping(ReadBackBridge):
        def run(self, network):
            super().run(network)
            self.output.write(np.frombuffer(self.output.read(), np.float16)[::-1].copy())

    for kind, right in ((ReadBackBridge, True), (Swapping, False)):
        bridge = kind(programs.context, (80, 70))
        assert works(programs, bridge) is right
        bridge.release()


def test_doctor_says_which_library_maps(monkeypatch, driver, programs):
    install(monkeypatch, driver)
    found = interop_item(programs)
    assert found["status"] == "ok" and "by cuda.core" in found["value"] and "cuda.bindings would do too" in found["value"]
    install(monkeypatch, driver, core=False)
    found = interop_item(programs)
    assert found["status"] == "ok" and "by cuda.bindings" in found["value"] and "cuda.core: not installed" in found["value"]
    install(monkeypatch, driver, core=False, bindings=False)
    found = interop_item(programs)
    assert found["status"] == "warn" and "copied through memory" in found["remedy"]


@pytest.mark.parametrize("name", ["cuda.core", "cuda.bindings.runtime"])
def test_fakes_have_the_signatures_of(name, driver):
    """So that the fakes cannot drift: parameter names and kinds, and what may be left out, against the package itself."""
    try:
        real = importlib.import_module(name)
    except ImportError as error:
        pytest.skip(f"{name} is not installed (pip install cuda-core cuda-bindings): {error}")
    fake = core_module(driver) if name == "cuda.core" else runtime_module(driver)
    checked = 0
    for owner in (["GraphicsResource", "Device"] if name == "cuda.core" else [None]):
        mine, theirs = (getattr(fake, owner), getattr(real, owner)) if owner else (fake, real)
        for method, function in vars(mine).items():
            if method.startswith("_") or isinstance(function, type) or not inspect.isroutine(getattr(mine, method)):
                continue
            expected = inspect.signature(getattr(theirs, method)).parameters
            got = inspect.signature(getattr(mine, method)).parameters
            assert [(p.name, p.kind) for p in got.values()] == [(p.name, p.kind) for p in expected.values()], method
            needed = [p.name for p in expected.values() if p.default is p.empty]
            assert set(needed) <= {p.name for p in got.values() if p.default is p.empty}, method
            checked += 1
    assert checked >= 6
    if name == "cuda.core":
        assert {"handle", "size"} <= set(dir(real.Buffer))
