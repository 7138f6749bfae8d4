"""Net2Net: initialises a larger network from a smaller trained one; both then compute the same output, up to rounding.

Function-preserving widening and deepening (Chen et al. 2016): new channels start at random but are not read yet, and new
convolutions start as the identity.  A network initialised so needs a fraction of the steps.
"""

import torch
from torch import Tensor, nn

from ..network.unet import CompactUNet


def widen(small: CompactUNet, large: CompactUNet) -> CompactUNet:
    """Makes ``large``, freshly initialised, compute the same function as ``small``; returns it.

    Raises ValueError where a level of ``large`` is narrower or has fewer convolutions, or blocks or levels differ.
    """
    mine, theirs = large.state_dict(), small.state_dict()
    if large.block != small.block or len(large.down) != len(small.down) or theirs.keys() - mine.keys():
        raise ValueError("the larger network must have the smaller one's blocks and levels, and at least its convolutions")
    for name, value in mine.items():
        if name in theirs:
            value.copy_(_embedded(name, value, theirs[name]))
        elif name.endswith("weight"):  # a new convolution follows a ReLU, so that the identity preserves its input
            known = small.get_parameter(f"{name.rsplit('.', 2)[0]}.0.weight").shape[0]
            value[:known] = 0.0
            value[range(known), range(known), 1, 1] = 1.0
        else:
            value.zero_()
    large.load_state_dict(mine)
    return large


def _embedded(name: str, value: Tensor, known: Tensor) -> Tensor:
    """``value`` with ``known`` in its first corner; the known outputs read none of the new inputs."""
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
    """``network`` initialised from ``trained``, a network of the same or a smaller size.  Raises ValueError otherwise."""
    state = trained.state_dict()
    alike = {name: value.shape for name, value in network.state_dict().items()}
    if {name: value.shape for name, value in state.items()} == alike:
        network.load_state_dict(state)
    elif isinstance(network, CompactUNet) and isinstance(trained, CompactUNet):
        with torch.no_grad():
            widen(trained, network)
    else:
        raise ValueError("the initial weights belong to another kind of network")
    return network
