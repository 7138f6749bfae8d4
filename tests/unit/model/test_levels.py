"""Merging of the network's pictures of two sizes where points are sparse (model/network/levels.py)."""

import numpy as np
import pytest
import torch

from pointglass.model.network.level_loops import sparse_blocks
from pointglass.model.network.levels import halved, merged, sparse
from pointglass.model.network.network_layout import BACKGROUND, CLOSED, PACKED_IN
from pointglass.model.network.reconstruct import Reconstructor


def packed_pixels(rng, density, size) -> torch.Tensor:
    """Random pixels of which a share is measured, of two surfaces."""
    made = rng.random((*size, PACKED_IN)).astype(np.float16)
    made[..., 3] = np.where(rng.random(size) < density, rng.choice([1.0, 0.6], size), 0.0)
    made[..., 4] = rng.choice([-0.3, 0.2], size) + rng.normal(0, 0.005, size)
    made[..., CLOSED:] = 0.0
    return torch.from_numpy(made)


@pytest.mark.parametrize("levels", [1, 2])
def test_the_loops_merge_as_the_reference_does_and_dense_places_stay_to_the_byte(levels, seed):
    rng = np.random.default_rng(seed)
    size = tuple(int(v) for v in rng.integers(70, 160, 2))
    packed = packed_pixels(rng, rng.uniform(0.02, 0.15), size)
    dense = size[1] // 3
    packed[:, :dense, 3] = 1.0
    one, several = (Reconstructor("fast", filtered=True, device="cpu", precision="fp32", levels=n) for n in (0, levels))

    @torch.inference_mode()
    def planes(x):
        return one(x[0].permute(1, 2, 0).contiguous().half()).permute(2, 0, 1)[None]

    made, alone = several(packed), one(packed)
    wanted = merged(planes, packed.permute(2, 0, 1)[None], levels)[0].permute(1, 2, 0)
    assert (made.float() - wanted.float()).abs().max() < 3e-3
    assert torch.equal(made[:, : dense - 16], alone[:, : dense - 16]) and torch.equal(made[..., 3], alone[..., 3])
    assert not torch.equal(made, alone)
    packed[..., 3] = 1.0
    packed[16:56, 24:, 3] = torch.from_numpy(rng.random((40, size[1] - 24)) < 0.1)
    made = several(packed)
    wanted = merged(planes, packed.permute(2, 0, 1)[None], levels)[0].permute(1, 2, 0)
    assert (made.float() - wanted.float()).abs().max() < 3e-3 and not torch.equal(made, one(packed))
    packed[..., 3] = 1.0
    assert torch.equal(several(packed), one(packed)), "a dense picture is the network's own"


def test_half_the_size_keeps_the_nearest_surface_and_averages_its_noise():
    x = torch.zeros(1, PACKED_IN, 2, 4)
    x[0, :3] = torch.tensor([[0.2, 0.4, 0.5, 0.7], [0.9, 0.3, 0.1, 0.3]])
    x[0, 3] = torch.tensor([[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    x[0, 4] = torch.tensor([[0.0, 0.0, 0.4, 0.4], [0.5, 0.0, 0.4, 0.4]])
    x[0, 5] = 0.8
    made = halved(x)[0]
    assert torch.allclose(made[:3, 0, 0], torch.tensor(0.3)), "the pixel behind the others, 0.9, is left out"
    assert torch.allclose(made[3:6, 0, 0], torch.tensor([1.0, 0.25, 0.8 / 2**0.5]))
    assert torch.allclose(made[:6, 0, 1], torch.tensor([0.4, 0.4, 0.4, 0.0, 0.65, 0.8])), "unmeasured: the mean of four"


def test_how_sparse_a_place_is_follows_from_the_distance_between_its_points():
    for apart, expected in ((1, 0.0), (3, 1.0), (5, 1.0)):
        confidence = torch.zeros(1, 1, 48, 96)
        confidence[..., ::apart, ::apart] = 1.0
        assert (sparse(confidence) - expected).abs().max() < 0.15, apart
    confidence = torch.ones(1, 1, 96, 96)
    confidence[..., :16, :16] = 0.0
    assert not sparse(confidence).any(), "one block of 36 is not worth the time"


@pytest.mark.parametrize("size", [(96, 240), (100, 250)])
def test_holes_are_not_sparse_places_but_gaps_between_points_far_apart_are(size):
    rng = np.random.default_rng(size[0])
    packed = torch.ones(*size, PACKED_IN)
    packed[:, 48:, 3] = 0.0
    assert not sparse_blocks(packed.numpy()).any(), "a hole beside dense points"
    packed[..., 3] = 0.0
    assert not sparse_blocks(packed.numpy()).any(), "nothing is measured"
    packed[10::20, 10::20, 3] = 1.0
    assert sparse_blocks(packed.numpy()).all(), "one point in 400, blocks without one among them"
    density = rng.choice([0.0, 0.002, 0.1, 1.0], (4, 5)).repeat(25, 0).repeat(50, 1)[: size[0], : size[1]]
    packed[..., 3] = torch.from_numpy(rng.random(size) < density)
    assert np.allclose(sparse_blocks(packed.numpy()), sparse(packed[None, None, ..., 3])[0, 0], atol=1e-6)


def test_background_far_from_the_picture_is_left_out_of_both_sizes():
    rng = np.random.default_rng(3)
    packed = packed_pixels(rng, 0.1, (400, 420))
    packed[..., BACKGROUND] = 1.0
    packed[:40, :40, BACKGROUND] = 0.0
    made = Reconstructor("fast", filtered=True, device="cpu", precision="fp32", levels=1)(packed)
    assert not made[-50:].any() and made[:40, :40].any()
