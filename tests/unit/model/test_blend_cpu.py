"""The compiled last part of the network against torch, on random pictures of many sizes."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from pointglass.model.network.blend_cpu import Blender
from pointglass.model.network.blend_rows import tanh
from pointglass.model.network.network_layout import CLOSED, PACKED_IN
from pointglass.model.network.reconstruct import Reconstructor
from pointglass.model.network.unet import BLENDS, INPUT_CHANNELS, CompactUNet, Size


def _network(rng, block=2) -> CompactUNet:
    """A small network with a random head."""
    network = CompactUNet(Size((8, 16), 1, block))
    torch.manual_seed(int(rng.integers(2**31)))
    torch.nn.init.normal_(network.head.weight, std=0.2)
    network.head.bias = torch.nn.Parameter(0.3 * torch.randn(network.head.out_channels))
    return network.eval()


def _packed(rng, height, width, mask="random") -> torch.Tensor:
    packed = torch.from_numpy(rng.random((height, width, PACKED_IN), np.float32))
    packed[..., 3] = {"random": (packed[..., 3] > 0.6).float(), "none": 0.0, "all": 1.0}[mask]
    packed[..., CLOSED] = (packed[..., CLOSED] > 0.9).float()
    if mask == "all":
        packed[: height // 2, :, :3] = 0.0  # black and uniform
    return packed


def _planes(packed) -> torch.Tensor:
    return packed.permute(2, 0, 1).contiguous()


@torch.inference_mode()
def _in_torch(network, packed) -> torch.Tensor:
    x = packed[None].permute(0, 3, 1, 2)[:, :INPUT_CHANNELS].contiguous()
    made = torch.nan_to_num(network(x)[0].clamp(0, 1), nan=0.0).permute(1, 2, 0)
    made[..., 3] = torch.maximum(made[..., 3], packed[..., CLOSED])
    return made


@torch.inference_mode()
def _blocks(network, packed) -> np.ndarray:
    x = packed[None].permute(0, 3, 1, 2)[:, :INPUT_CHANNELS].contiguous()
    return network.blocks(x)[0].permute(1, 2, 0).contiguous().numpy()


@pytest.mark.parametrize("mask", ["random", "none", "all"])
@pytest.mark.parametrize("block", [1, 2, 4])
def test_agrees_with_torch_at_any_size(seed, block, mask):
    rng = np.random.default_rng(seed)
    network, blender = _network(rng, block), Blender(2)
    sizes = [(1, 1), (2, 3), (5, 40), (17, 7), tuple(rng.integers(16, 90, 2))]
    spread = 0.0
    for height, width in sizes:
        packed = _packed(rng, int(height), int(width), mask)
        plain = _in_torch(network, packed)
        fast = torch.from_numpy(blender.made(_planes(packed).numpy(), _blocks(network, packed).view(np.uint32), block))
        assert (plain - fast).abs().max() < 2e-5, (height, width)
        spread = max(spread, float(fast[..., :3].std(unbiased=False)))
    assert spread > 0.05


@pytest.mark.parametrize("block", [1, 2, 4])
def test_the_input_in_blocks_equals_torchs(seed, block):
    rng = np.random.default_rng(seed)
    for height, width in [(1, 1), (3, 70), (16, 8), tuple(int(side) for side in rng.integers(30, 200, 2))]:
        packed = _packed(rng, height, width)
        x = packed[None].permute(0, 3, 1, 2)[:, :INPUT_CHANNELS]
        for multiple in (block, 8 * block):
            padded = torch.nn.functional.pad(x, (0, -width % multiple, 0, -height % multiple), mode="replicate")
            made = Blender(2).space_to_depth(_planes(packed), block, multiple)
            assert torch.equal(made, torch.nn.functional.pixel_unshuffle(padded, block))
            assert made.is_contiguous(memory_format=torch.channels_last)


def test_the_result_does_not_depend_on_threads_or_callers(seed):
    rng = np.random.default_rng(seed)
    network = _network(rng)
    pictures = [_packed(rng, 361, 483), _packed(rng, 120, 333)]
    inputs = [(_planes(packed), torch.from_numpy(_blocks(network, packed)), 2) for packed in pictures]
    once = [Blender(1)(*given) for given in inputs]
    for threads in (2, 3, 100):
        assert torch.equal(Blender(threads)(*inputs[0]), once[0])
    blender = Blender(2)
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda i: blender(*inputs[i % 2]), range(40)))
    assert all(torch.equal(picture, once[i % 2]) for i, picture in enumerate(made))
    halves = [(packed.half(), blocks.bfloat16(), 2) for packed, blocks, _ in inputs]  # conversion into reused buffers
    alone = [Blender(1)(packed.float(), blocks.float(), 2) for packed, blocks, _ in halves]
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda i: blender(*halves[i % 2]), range(20)))
    assert all(torch.equal(picture, alone[i % 2]) for i, picture in enumerate(made))


def test_nan_becomes_black_and_the_output_is_in_range(seed):
    rng = np.random.default_rng(seed)
    packed = _packed(rng, 40, 40)
    packed[5, 5, 0], packed[20, 20, 2], packed[30, 9, 1] = float("nan"), float("inf"), -float("inf")
    blocks = rng.normal(0.0, 0.5, (20, 20, 4 * (2 + BLENDS))).astype(np.float32)
    blocks[3, 3, : 4 * (1 + BLENDS)] = np.nan
    made = Blender(2).made(_planes(packed).numpy(), blocks.view(np.uint32), 2)
    assert np.isfinite(made).all() and made.min() >= 0 and made.max() <= 1
    assert not made[6:8, 6:8, :3].any() and made[39, 39, :3].any()


def test_rational_tanh_is_tanh():
    x = np.concatenate([np.linspace(-12, 12, 100_001), [0.0, 1e-30, -1e-8, 1e30, -np.inf]]).astype(np.float32)
    made = np.array([tanh(v) for v in x])
    assert np.abs(made - np.tanh(x.astype(np.float64))).max() < 5e-7


@pytest.mark.parametrize("quality", ["fast", "balanced"])
def test_shipped_networks_give_the_same_picture_compiled_and_in_torch(seed, quality):
    rng = np.random.default_rng(seed)
    network = Reconstructor(quality, filtered=True, device="cpu", precision="fp32")
    packed = _packed(rng, 90, 122).half()
    fast = network(packed).float()
    network._blender = None
    assert (network(packed).float() - fast).abs().max() <= 2**-10  # rounding to half precision
