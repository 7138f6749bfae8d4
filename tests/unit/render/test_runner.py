"""Engines without a GPU: graphs, failed captures and fallbacks; folded batch normalisation."""

import copy
from contextlib import contextmanager, nullcontext

import pytest
import torch
from torch import nn

from pointglass.model.network.engines import ENGINES, Captured, EngineError, Runner, fold_normalisation
from pointglass.model.network.network_layout import PACKED_IN, PACKED_OUT
from pointglass.model.network.unet import PaperUNet, make_network
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.render.network import neural


class Network:
    """A Runnable on the CPU."""

    device: str = "cpu"
    engine: str = "graph"

    def made(self, packed):
        return (packed[..., :PACKED_OUT] * 2 + packed[..., PACKED_OUT:]).contiguous()

    __call__ = made


class Graph:
    """Stand-in for a CUDA graph: static input and output buffers, overwritten by each run."""

    def __init__(self, work, example):
        self.input, self.work = torch.zeros_like(example), work
        self.output = work(self.input)

    def __call__(self, packed):
        self.input.copy_(packed)
        self.output.copy_(self.work(self.input))
        return self.output


def test_a_graph_gives_what_the_network_gives(seed):
    generator = torch.Generator().manual_seed(seed)
    for height, width in ((1, 1), (7, 13), (64, 48)):
        runner = Runner(Network(), height, width, capture=Graph)
        assert runner.engine == "graph" and runner.problem is None and runner.name == ENGINES["graph"]
        for _ in range(3):
            packed = torch.rand((height, width, PACKED_IN), generator=generator).half()
            assert torch.equal(runner(packed), Network().made(packed)), f"seed {seed}"
        runner.release()
        runner.release()


class Cuda:
    """The part of torch.cuda that a capture uses, on the CPU.  refusal: raised when a capture ends."""

    def __init__(self, monkeypatch, refusal: Exception | None):
        class Stream:
            def wait_stream(self, _stream):
                pass

        @contextmanager
        def graph(_graph, capture_error_mode="global"):
            assert capture_error_mode == "thread_local"
            yield
            if refusal is not None:
                raise refusal

        fakes = {"Stream": Stream, "CUDAGraph": object, "graph": graph, "stream": lambda _stream: nullcontext(),
                 "current_stream": Stream, "synchronize": lambda: None}
        for name, fake in fakes.items():
            monkeypatch.setattr(torch.cuda, name, fake)


def test_a_refused_capture_is_an_engine_error_and_a_bug_is_not(monkeypatch):
    example = torch.zeros((2, 3, PACKED_IN), dtype=torch.float16)
    Cuda(monkeypatch, RuntimeError("operation not permitted when stream is capturing"))
    with pytest.raises(EngineError, match="not permitted"):
        Captured(Network().made, example)
    for error in (torch.OutOfMemoryError("CUDA out of memory"), TypeError("a bug")):
        Cuda(monkeypatch, error)
        with pytest.raises(type(error)):
            Captured(Network().made, example)

    def broken(_packed):
        raise RuntimeError("shapes do not match")

    Cuda(monkeypatch, None)
    with pytest.raises(RuntimeError, match="shapes do not match") as raised:
        Captured(broken, example)
    assert not isinstance(raised.value, EngineError)


@pytest.mark.parametrize("engine", list(ENGINES))
def test_a_capture_that_fails_falls_back_and_the_log_says_why(monkeypatch, caplog, engine):
    monkeypatch.setattr(torch, "compile", lambda work, dynamic: work)  # importing the real one takes seconds

    def refuse(_work, _example):
        raise EngineError("operation not permitted when stream is capturing")

    runner = Runner(Network(), 4, 4, engine=engine, capture=refuse)
    packed = torch.rand(4, 4, PACKED_IN).half()
    assert runner.engine == "eager" and torch.equal(runner(packed), Network().made(packed))
    if engine == "eager":
        assert runner.problem is None and not caplog.records
    else:
        assert "not permitted" in runner.name and runner.name.startswith(ENGINES["eager"])
        assert [record.levelname for record in caplog.records] == ["WARNING"] and "not permitted" in caplog.text


@pytest.mark.parametrize("error", [RuntimeError("no C++ compiler\nadvice"), ImportError("no Triton")])
def test_a_compiler_that_is_missing_falls_back_to_a_graph(monkeypatch, error):
    def compile_fails(_work, dynamic):
        def run(_packed):
            raise error

        return run

    monkeypatch.setattr(torch, "compile", compile_fails)
    runner = Runner(Network(), 4, 4, engine="compile", capture=Graph)
    assert runner.engine == "graph" and runner.name.endswith(f"({ENGINES['compile']} failed: {str(error).splitlines()[0]})")


def test_a_bug_does_not_choose_a_slower_engine(monkeypatch):
    def broken(_work, _example):
        raise TypeError("a bug")

    with pytest.raises(TypeError):
        Runner(Network(), 4, 4, capture=broken)


def test_no_memory_is_not_hidden_by_a_fallback():
    def full(_work, _example):
        raise torch.OutOfMemoryError("CUDA out of memory")

    with pytest.raises(torch.OutOfMemoryError):
        Runner(Network(), 4, 4, capture=full)


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
def test_folded_normalisation_changes_nothing(dtype, limit, seed):
    plain = lively(PaperUNet(8), seed).to(dtype)
    folded = fold_normalisation(copy.deepcopy(plain))
    assert not any(isinstance(module, nn.BatchNorm2d) for module in folded.modules())
    x = torch.rand((1, 6, 40, 56), generator=torch.Generator().manual_seed(seed)).to(dtype)
    expected, made = plain(x), folded(x)
    assert expected.std() > 1e-3
    assert (made - expected).abs().max() <= limit * expected.abs().max(), f"seed {seed}"


def test_a_network_without_normalisation_is_left_alone():
    network = make_network("fast").eval()
    before = copy.deepcopy(network.state_dict())
    after = fold_normalisation(network).state_dict()
    assert list(before) == list(after) and all(torch.equal(before[name], after[name]) for name in before)
