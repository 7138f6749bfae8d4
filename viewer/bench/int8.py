"""Quantisation of the network's convolutions to 8-bit integers, for the bench only; the viewer does not use it.

Static quantisation of torch (torch.ao): each convolution between its own quantiser and dequantiser, with ranges calibrated on
the input of one picture.  CPU only.
"""

import copy
import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch

    from ...model.network.reconstruct import Reconstructor


class Int8Error(Exception):
    """This torch build cannot quantise; the message gives the reason."""


def quantised(network: "Reconstructor", packed: "torch.Tensor") -> "Reconstructor":
    """A copy of a compact network on the CPU, with all convolutions except the blurs in int8.

    network: in fp32.  packed: (H, W, 8) half, the input for the calibration of the ranges.  Raises Int8Error.
    """
    import torch
    from torch import nn

    made = copy.copy(network)
    made.network = copy.deepcopy(network.network).float().eval()
    made.precision, made.name = "int8", f"{network.name.rsplit(' ', 3)[0]} int8 on cpu"
    engine = next((e for e in ("fbgemm", "x86", "onednn", "qnnpack") if e in torch.backends.quantized.supported_engines), None)
    if engine is None:
        raise Int8Error("this torch build has no int8 convolutions")
    before = torch.backends.quantized.engine
    try:
        from torch.ao import quantization

        with warnings.catch_warnings(), torch.no_grad():
            warnings.simplefilter("ignore")  # deprecated in favour of torchao, which would be another dependency
            torch.backends.quantized.engine = engine
            for name, layer in list(made.network.named_modules()):
                if isinstance(layer, nn.Conv2d):
                    inside, _, last = name.rpartition(".")
                    wrapped = quantization.QuantWrapper(layer)
                    wrapped.qconfig = quantization.get_default_qconfig(engine)  # type: ignore[assignment]
                    setattr(made.network.get_submodule(inside), last, wrapped)
            _mark(made.network)
            quantization.prepare(made.network, inplace=True)
            made(packed)
            quantization.convert(made.network, inplace=True)
            _mark(made.network)
            made(packed)
    except (RuntimeError, ImportError, ValueError, AttributeError) as error:  # raised by a torch without this engine
        raise Int8Error(f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else 'no reason given'}") from None
    finally:
        torch.backends.quantized.engine = before
    return made


def _mark(network) -> None:
    """Sets a weight of type fp32, from which the network infers the type of its input."""
    import torch

    network.stem.weight = torch.zeros(1)
