"""Net2Net: a larger network initialised from a smaller one has the same output, and all its weights can learn."""

import pytest
import torch

from pointglass.model.network.unet import CompactUNet, Size, make_network
from pointglass.model.train.net2net import started_from, widen

SMALL = Size((8, 16, 24), 1)


def _trained(size: Size, seed: int) -> CompactUNet:
    torch.manual_seed(seed)
    network = CompactUNet(size)
    with torch.no_grad():
        for parameter in network.parameters():  # including the head, which is zero at first
            parameter.normal_(0.0, 0.15)
    return network


@pytest.mark.parametrize("large", [Size((8, 16, 24), 2), Size((12, 20, 24), 1), Size((16, 16, 40), 3)])
def test_the_larger_network_starts_with_the_smaller_ones_output(large):
    seed = int(torch.randint(2**31, ()).item())
    small, x = _trained(SMALL, seed), torch.rand(1, 6, 37, 50)
    begun = widen(small, CompactUNet(large))
    torch.testing.assert_close(begun(x), small(x), rtol=1e-4, atol=1e-4, msg=lambda m: f"seed {seed}: {m}")


def test_every_new_weight_gets_a_gradient_within_a_few_steps():
    small, large = _trained(SMALL, 3), CompactUNet(Size((12, 20, 24), 2))
    widen(small, large)
    before = {name: value.clone() for name, value in large.named_parameters()}
    optimiser = torch.optim.SGD(large.parameters(), 0.05)
    for _ in range(4):
        optimiser.zero_grad()
        (large(torch.rand(2, 6, 32, 32)) - 0.3).square().mean().backward()
        optimiser.step()
    for name, value in large.named_parameters():
        assert not torch.equal(value, before[name]), name


def test_the_balanced_size_can_start_from_fast():
    started_from(make_network("balanced"), make_network("fast"))


def test_a_narrower_network_or_another_kind_is_refused():
    with pytest.raises(ValueError, match="narrower"):
        widen(_trained(Size((16, 16, 24), 1), 1), CompactUNet(SMALL))
    with pytest.raises(ValueError, match="another kind"):
        started_from(make_network("paper"), make_network("fast"))
