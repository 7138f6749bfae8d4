"""The network behind its engines: graphs, captures and their failures, folded normalisation; without a GPU."""

import copy
import inspect
from contextlib import contextmanager, nullcontext

import numpy as np
import pytest
import torch
from torch import nn

from model.engines import ENGINES, Captured, Runner, fold_normalisation
from model.network_layout import PACKED_IN, PACKED_OUT
from model.unet import SIZES, CompactUNet, PaperUNet
from viewer.errors import InputError
from viewer.render import neural


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
    x = torch.rand((1, 6, 40, 56), generator=torch.Generator().manual_seed(seed)).to(dtype)
    expected, made = plain(x), folded(x)
    assert expected.std() > 1e-3
    assert (made - expected).abs().max() <= limit * expected.abs().max(), f"seed {seed}"


def test_a_network_without_normalisation_is_left_alone():
    network = CompactUNet(SIZES["fast"]).eval()
    before = copy.deepcopy(network.state_dict())
    after = fold_normalisation(network).state_dict()
    assert list(before) == list(after) and all(torch.equal(before[name], after[name]) for name in before)
