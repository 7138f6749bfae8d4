"""A larger network that begins as a smaller trained one: its first output is the smaller one's, to rounding.

Function-preserving widening and deepening (Net2Net, Chen et al. 2016): channels that are new start at random but are not
read yet, convolutions that are new start as the identity.  A size so begun needs a fraction of the steps.
"""

import torch
from torch import Tensor, nn

from model.unet import CompactUNet


def widen(small: CompactUNet, large: CompactUNet) -> CompactUNet:
    """Makes ``large``, freshly initialised, compute what ``small`` does; returns it.

    Raises ValueError where a level of ``large`` is narrower or has fewer convolutions, or blocks or levels differ.
    """
    mine, theirs = large.state_dict(), small.state_dict()
    if large.block != small.block or len(large.down) != len(small.down) or theirs.keys() - mine.keys():
        raise ValueError("the larger network must have the blocks and levels of the smaller, and at least its convolutions")
    for name, value in mine.items():
        if name in theirs:
            value.copy_(_embedded(name, value, theirs[name]))
        elif name.endswith("weight"):  # a convolution that the smaller network does not have, after a ReLU
            known = small.get_parameter(f"{name.rsplit('.', 2)[0]}.0.weight").shape[0]
            value[:known] = 0.0
            value[range(known), range(known), 1, 1] = 1.0
        else:
            value.zero_()
    large.load_state_dict(mine)
    return large


def _embedded(name: str, value: Tensor, known: Tensor) -> Tensor:
    """``value`` with ``known`` in its corner and nothing new read by what is known."""
    if any(a < b for a, b in zip(value.shape, known.shape, strict=True)):
        raise ValueError(f"{name}: {tuple(value.shape)} is narrower than {tuple(known.shape)}")
    out = value.clone()
    outputs = known.shape[0]
    if value.dim() > 1:
        out[:outputs] = 0.0
        out[:outputs, : known.shape[1]] = known
    else:
        out[:outputs] = known
    return out


def started_from(network: nn.Module, trained: nn.Module) -> nn.Module:
    """``network`` with the weights of ``trained``, which is alike or smaller."""
    state = trained.state_dict()
    alike = {name: value.shape for name, value in network.state_dict().items()}
    if {name: value.shape for name, value in state.items()} == alike:
        network.load_state_dict(state)
    elif isinstance(network, CompactUNet) and isinstance(trained, CompactUNet):
        with torch.no_grad():
            widen(trained, network)
    else:
        raise ValueError("the network to start from is of another kind")
    return network
