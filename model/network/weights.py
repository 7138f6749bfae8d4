"""Weights on disk: safetensors files with a description in the header, found by quality and kind of input.

``assets/weights/balanced-filtered.safetensors`` is the balanced network trained on filtered pictures, ``...-unfiltered`` the
one for ``--filter off``.  Pickle files are never read.
"""

import hashlib
import json
from pathlib import Path

import torch
from torch import nn

from ..common.errors import PointglassError
from ..common.files.atomic_write import write_atomic
from .qualities import trainable
from .unet import INPUT_CHANNELS, make_network
from .weights_folder import shipped

FORMAT = "pointglass-weights-3"
"""Format in the header; its number is raised when the meaning of the tensors changes."""
_NUMBERS = ("F16", "BF16", "F32", "F64")
"""safetensors' types that are accepted; files written here have F16."""


class WeightsError(PointglassError):
    """Weights that are missing or do not fit; the message names the file and the remedy."""


def save_weights(path: Path, network: nn.Module, quality: str, *, filtered: bool, notes: dict | None = None) -> None:
    """Writes weights in fp16, atomically.  Raises WeightsError, with nothing written, where a value exceeds half precision.

    notes: JSON object for the header.
    """
    from safetensors.torch import save_file

    header = {
        "format": FORMAT, "quality": quality, "input": "filtered" if filtered else "unfiltered",
        "channels": str(INPUT_CHANNELS), "notes": json.dumps(notes or {}),
    }
    tensors = {k: v.detach().to("cpu", torch.float16).contiguous() for k, v in network.state_dict().items()}
    for name, value in network.state_dict().items():
        if value.is_floating_point() and not tensors[name].isfinite().all():
            raise WeightsError(f"tensor {name} has values beyond half precision")

    def save(beside: Path) -> None:
        save_file(tensors, str(beside), header)
        beside.chmod(0o644)  # safetensors creates files that only their owner can read

    write_atomic(path, save)


def load_weights(path: Path) -> tuple[nn.Module, dict[str, str]]:
    """A network in fp32 on the CPU, in evaluation mode, and the file's header.

    Raises WeightsError naming the file where it is missing, is not a pointglass weights file or does not fit its network.
    """
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise WeightsError(f"no such weights; shipped are: {', '.join(shipped()) or 'none'}", file=path)
    try:
        with safe_open(str(path), "pt") as file:
            header = file.metadata() or {}
            if header.get("format") != FORMAT:
                raise WeightsError(f"not pointglass weights (format {header.get('format')!r}, expected {FORMAT!r})", file=path)
            quality = header.get("quality", "")
            if quality not in trainable():
                raise WeightsError(f"weights of an unknown network {quality!r}", file=path)
            network = make_network(quality)
            expected = network.state_dict()
            names = set(file.keys())
            if names != set(expected):
                raise WeightsError(f"the tensors are not those of the {quality} network", file=path, remedy="retrain it")
            for name, value in expected.items():
                stored = file.get_slice(name)
                kind = stored.get_dtype()
                if tuple(stored.get_shape()) != tuple(value.shape):
                    raise WeightsError(f"tensor {name} has another shape than the {quality} network's", file=path,
                                       remedy="retrain it")
                if kind not in _NUMBERS:
                    raise WeightsError(f"tensor {name} has type {kind}, not {'/'.join(_NUMBERS)}", file=path,
                                       remedy="retrain it")
            state = {name: file.get_tensor(name).to(expected[name].dtype) for name in names}
    except (SafetensorError, OSError) as error:
        raise WeightsError(f"cannot be read as safetensors ({error})", file=path) from None
    bad = next((n for n, v in state.items() if v.is_floating_point() and not torch.isfinite(v).all()), None)
    if bad:
        raise WeightsError(f"tensor {bad} has values that are not finite", file=path)
    network.load_state_dict(state)
    return network.eval().requires_grad_(False), dict(header)


def digest(path: Path) -> str:
    """First 12 hex digits of the file's SHA-256."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]
