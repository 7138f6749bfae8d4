"""Inference: the network on packed pixels, on CPU or CUDA, in the precision that is fastest there and still right.

Pixels come as (H, W, 8) half floats, channels last: the five channels of :func:`model.projection.network_input`, 1 where the
pixel is known to be covered, 1 where it is void (what surrounds the rest by more than the network sees is left out on a
CPU), and a zero.  They leave as (H, W, 4) half floats, RGB and coverage 0..1: the layout the
renderer's buffers have.  The paper's network has no coverage: it is 1 everywhere.
"""

import math
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from model.blend_cpu import Blender
from model.common.memory import keep_freed_memory
from model.common.processors import usable_processors
from model.engines import fold_normalisation
from model.network_layout import BACKGROUND, CLOSED, PACKED_OUT
from model.unet import INPUT_CHANNELS, MEAN_BLOCK, CompactUNet
from model.weights import MIRRORED, WeightsError, digest, load_weights, weights_dir, weights_name

FLIPS: tuple[tuple[int, ...], ...] = ((), (1,), (0,), (0, 1))
"""Axes (rows 0, columns 1) that mirrored pictures are flipped along; the first is the picture itself."""
_WORTHWHILE = 0.9  # share of the picture above which leaving out the void saves nothing
PRECISIONS = {"fp32": torch.float32, "bf16": torch.bfloat16, "fp16": torch.float16}


def cuda_problem() -> str | None:
    """Why CUDA cannot be used, or None where a convolution ran on it.  Probed by use, not by asking.

    By what the network needs most: simpler kernels run on devices too old for this cuDNN as well.
    """
    if not torch.cuda.is_available():
        return "torch sees no CUDA device" if torch.version.cuda else "this torch build has no CUDA"
    try:
        with torch.inference_mode():
            picture, kernel = (torch.zeros(8, 8, 8, 8, dtype=torch.float16, device="cuda") for _ in range(2))
            F.conv2d(picture.to(memory_format=torch.channels_last), kernel).sum().item()
    except Exception as error:
        said = str(error).strip().splitlines() or [type(error).__name__]
        return f"a first convolution on CUDA failed: {said[0]}"
    return None


def fast_precision(device: str) -> str:
    """fp16 on CUDA; bf16 on CPUs that multiply it in hardware, else fp32."""
    if device == "cuda":
        return "fp16"
    probe = getattr(torch.cpu, "_is_avx512_bf16_supported", None) or getattr(torch.cpu, "_is_amx_tile_supported", None)
    return "bf16" if probe is not None and probe() else "fp32"


def covered(void: Tensor, reach: int, multiple: int) -> tuple[slice, slice]:
    """Rows and columns outside which a picture is void, widened by ``reach`` and aligned as the network is.

    void: (H, W), 1 where void.  multiple: MEAN_BLOCK and the network's own multiple divide what is returned.
    """
    shown = void < 1.0
    step = math.lcm(multiple, MEAN_BLOCK)
    out = []
    for axis in (1, 0):
        held = torch.nonzero(shown.any(dim=axis))
        if len(held) == 0:
            return slice(0, 0), slice(0, 0)
        first, last = int(held[0]) - reach, int(held[-1]) + 1 + reach
        out.append(slice(max(first // step * step, 0), min(-(-last // step) * step, shown.shape[1 - axis])))
    return out[0], out[1]


def fitting_weights(quality: str, *, filtered: bool, weights: Path | None = None) -> tuple[Path, nn.Module, dict[str, str]]:
    """The file, its network and its header: ``weights``, or those shipped for ``quality``.

    Raises WeightsError where there are none, or where they are not for input that is ``filtered`` or not.
    """
    path = weights or weights_dir() / f"{weights_name(quality, filtered=filtered)}.safetensors"
    expected = "filtered" if filtered else "unfiltered"
    if weights is None and not path.is_file():
        raise WeightsError(
            f"no weights are shipped for quality {quality!r} on {expected} input ({path}); choose another --quality, or "
            "train them with `pointglass train`"
        )
    network, header = load_weights(path)
    if header.get("input") != expected:
        raise WeightsError(f"{path}: made for {header.get('input')} input, this picture's is {expected}; "
                           f"choose other weights or {'--filter off' if filtered else 'a filter'}")
    return path, network, header


class Reconstructor:
    """A network ready to run.  ``name`` says what runs and on what, for every place that shows it.

    quality: fast, balanced, best or paper; ``best`` is the network of ``balanced`` on four mirrored pictures, averaged
    (self-ensemble: Timofte et al. 2016), at four times its time.  filtered: trained for filtered input.  device: "cuda" or
    "cpu".  precision: a key of PRECISIONS, None = the fast one.  engine: a key of :data:`model.engines.ENGINES`, what a
    :class:`model.engines.Runner` uses on CUDA, None = "graph".  Raises WeightsError where there are no such weights.
    """

    def __init__(self, quality: str, *, filtered: bool, device: str, precision: str | None = None,
                 weights: Path | None = None, engine: str | None = None):
        path, network, self.header = fitting_weights(quality, filtered=filtered, weights=weights)
        self.device = device
        self.precision = precision or fast_precision(device)
        self.dtype = PRECISIONS[self.precision]
        self.engine = (engine or "graph") if device == "cuda" else "eager"
        self.compact = isinstance(network, CompactUNet)
        self.network = fold_normalisation(network).to(device, self.dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.flips = FLIPS if quality in MIRRORED else FLIPS[:1]
        mirrored = f" on {len(self.flips)} mirrored pictures" if len(self.flips) > 1 else ""
        self.name = f"{path.stem} {digest(path)}{mirrored} {self.precision} on {device}"
        self._blender: Blender | None = None
        if device == "cuda":
            torch.backends.cudnn.allow_tf32 = False  # fp32 is to be fp32: 10 bits of fraction would be called exact
        if device == "cpu":
            keep_freed_memory()
            threads = usable_processors()
            torch.set_num_threads(threads)
            self._blender = Blender(threads) if self.compact else None

    @torch.inference_mode()
    def __call__(self, packed: Tensor) -> Tensor:
        """(H, W, 8) half -> (H, W, 4) half on the same device; never NaN, within 0..1."""
        if self.device == "cpu" and self.compact:  # on CUDA looking would cost a synchronisation, and a size its own graph
            rows, columns = covered(packed[..., BACKGROUND], self.network.reach, self.network.multiple)
            part = packed[rows, columns]
            if part.shape[0] * part.shape[1] < _WORTHWHILE * packed.shape[0] * packed.shape[1]:
                made = packed.new_zeros((*packed.shape[:2], PACKED_OUT))
                if part.numel():
                    made[rows, columns] = self.made(part)
                return made
        return self.made(packed)

    def channels(self, packed: Tensor) -> Tensor:
        """What the network itself takes: (1, INPUT_CHANNELS, H, W), channels last."""
        x = packed[None].permute(0, 3, 1, 2)[:, :INPUT_CHANNELS]
        return x.to(torch.float32 if self.compact else self.dtype, memory_format=torch.channels_last)

    def made(self, packed: Tensor) -> Tensor:
        """The whole picture, whatever is void; for a caller in inference mode.  Where it is made of several mirrored pictures,
        their mean."""
        if len(self.flips) == 1:
            return self._made_once(packed)
        total = sum(self._made_once(packed.flip(axes).contiguous()).flip(axes).float() for axes in self.flips)
        return (torch.as_tensor(total) / len(self.flips)).half()

    def _made_once(self, packed: Tensor) -> Tensor:
        if self._blender is not None:
            return self._made_on_cpu(packed, self._blender)
        made = torch.nan_to_num(self.network(self.channels(packed))[0].float().clamp_(0.0, 1.0), nan=0.0).permute(1, 2, 0)
        made = F.pad(made, (0, PACKED_OUT - made.shape[2]), value=1.0).half()
        made[..., 3] = torch.maximum(made[..., 3], packed[..., CLOSED].to(made.dtype))
        return made

    def _made_on_cpu(self, packed: Tensor, blend: Blender) -> Tensor:
        """The same, all but the convolutions in compiled loops."""
        assert isinstance(self.network, CompactUNet)
        x = packed[None].permute(0, 3, 1, 2)[:, :INPUT_CHANNELS].to(self.dtype, memory_format=torch.channels_last)
        return blend(packed, self.network.blocks(x)[0].permute(1, 2, 0), self.network.block)
