"""What :mod:`model.network.engines` needs of a network, so that it does not import :mod:`model.network.reconstruct`."""

from typing import Protocol

from torch import Tensor


class Runnable(Protocol):
    """A network on packed pixels (model/network/network_layout.py).  device: "cuda" or "cpu".  engine: the engine asked for, a
    key of :data:`model.network.engines.ENGINES`."""

    device: str
    engine: str

    def made(self, packed: Tensor) -> Tensor:
        """(H, W, PACKED_IN) half -> (H, W, PACKED_OUT) half, every pixel computed; call it in inference mode."""
        ...

    def __call__(self, packed: Tensor) -> Tensor:
        """The same, free to leave out parts of the picture that are background."""
        ...
