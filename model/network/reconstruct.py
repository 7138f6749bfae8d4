"""Inference: the network on packed pixels, on CPU or CUDA, in the fastest precision that is accurate enough there.

Input and output are half floats in the layout of the renderer's buffers (model/network/network_layout.py): (H, W, 8), the six
channels of :func:`model.reference.projection.network_input`, CLOSED and BACKGROUND, to (H, W, 4), RGB and coverage.  On a CPU,
background farther from the rest of the picture than the network's receptive field is left out.  The paper's network predicts no
coverage: it is 1 everywhere.  Where points are sparse, a compact network sees the picture at half the size, too
(model/network/levels.py).
"""

import logging
import math
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ..common.errors import Option
from ..common.process.processors import usable_processors
from .blend_cpu import Blender
from .engines import fold_normalisation
from .interruption import check
from .level_loops import halved_pixels, merge, planes, sparse_blocks
from .levels import DENSITY_BLOCK, LEAST_SIDE, NOISE, merged, region
from .network_layout import BACKGROUND, CLOSED, PACKED_OUT
from .qualities import QUALITIES
from .unet import INPUT_CHANNELS, MEAN_BLOCK, CompactUNet
from .weights import WeightsError, digest, load_weights
from .weights_folder import weights_file

FLIPS: tuple[tuple[int, ...], ...] = ((), (1,), (0,), (0, 1))
"""Axes (rows 0, columns 1) along which mirrored pictures are flipped; the first is the picture itself."""
_WORTHWHILE = 0.9
"""Share of the picture from which on the background is not left out: at most a tenth of the network's time is given away.
The copy costs 0.2 % of it (640x480, one processor)."""
PRECISIONS = {"fp32": torch.float32, "bf16": torch.bfloat16, "fp16": torch.float16}
"""Precisions of the convolutions."""

_log = logging.getLogger(__name__)


def cuda_problem() -> str | None:
    """Why CUDA cannot be used, in one line, or None where it works.

    The test is a half-precision convolution: simpler kernels also run on devices too old for this cuDNN.
    """
    if not torch.cuda.is_available():
        return "torch sees no CUDA device" if torch.version.cuda else "this torch build has no CUDA"
    try:
        with torch.inference_mode():
            picture, kernel = (torch.zeros(8, 8, 8, 8, dtype=torch.float16, device="cuda") for _ in range(2))
            F.conv2d(picture.to(memory_format=torch.channels_last), kernel).sum().item()
    except RuntimeError as error:  # errors of CUDA, cuDNN and its memory; any other exception is a bug
        lines = str(error).strip().splitlines() or [type(error).__name__]
        return f"a first convolution on CUDA failed: {lines[0]}"
    return None


def fast_precision(device: str) -> str:
    """fp16 on CUDA; bf16 on CPUs that multiply it in hardware, else fp32."""
    if device == "cuda":
        return "fp16"
    probe = getattr(torch.cpu, "_is_avx512_bf16_supported", None) or getattr(torch.cpu, "_is_amx_tile_supported", None)
    if probe is not None and probe():
        return "bf16"
    _log.info("the network computes in fp32: %s", "this processor has no bf16 multiplication" if probe is not None
              else "this torch does not report whether the processor has bf16 multiplication")
    return "fp32"


def covered(background: Tensor, reach: int, multiple: int) -> tuple[slice, slice]:
    """Rows and columns of the part of a picture that is not background, widened by ``reach`` and aligned for the network.

    background: (H, W), 1 where a pixel is background.  reach: pixels.  multiple: the network's; the returned bounds are
    multiples of it and of MEAN_BLOCK.  Both slices are empty where all is background.
    """
    shown = background < 1.0
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
    """The file, its network and its header: ``weights``, or the weights shipped for ``quality``.

    filtered: whether a depth filter runs in front of the network.  Raises WeightsError where the file is missing or was trained
    for the other kind of input.
    """
    path = weights or weights_file(quality, filtered=filtered)
    expected = "filtered" if filtered else "unfiltered"
    if weights is None and not path.is_file():
        raise WeightsError(f"no weights are shipped for quality {quality!r} on {expected} input ({path})",
                           remedy=("choose another ", Option("--quality"), ", or train them with `pointglass train`"))
    network, header = load_weights(path)
    if header.get("input") != expected:
        raise WeightsError(f"made for {header.get('input')} input, this picture's is {expected}", file=path,
                           remedy=("choose other weights or ", Option("--filter", "off") if filtered else "a filter"))
    return path, network, header


class Reconstructor:
    """A network ready to run.  ``name``: weights, their hash, precision and device, for display.

    quality: a key of QUALITIES; one that ``mirrors`` another averages its network over four mirrored pictures (self-ensemble,
    Timofte et al. 2016) and takes four times as long.  filtered: weights trained for filtered input.
    device: "cuda" or "cpu".  precision: a key of PRECISIONS; None: :func:`fast_precision`.  engine: a key of
    :data:`model.network.engines.ENGINES` for a :class:`model.network.engines.Runner` on CUDA; None: "graph".
    levels: coarser sizes that a compact network sees, too, where points are sparse (model/network/levels.py).
    Raises WeightsError where there are no such weights.

    It changes no setting of the process: see :func:`model.common.process.torch_process.prepare_inference`.
    """

    def __init__(self, quality: str, *, filtered: bool, device: str, precision: str | None = None,
                 weights: Path | None = None, engine: str | None = None, levels: int = 0):
        path, network, self.header = fitting_weights(quality, filtered=filtered, weights=weights)
        self.device = device
        self.precision = precision or fast_precision(device)
        self.dtype = PRECISIONS[self.precision]
        self.engine = (engine or "graph") if device == "cuda" else "eager"
        self.compact = isinstance(network, CompactUNet)
        self.levels = levels if self.compact else 0
        self.network = fold_normalisation(network).to(device, self.dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.flips = FLIPS if QUALITIES[quality].mirrors else FLIPS[:1]
        mirrored = f" on {len(self.flips)} mirrored pictures" if len(self.flips) > 1 else ""
        self.name = f"{path.stem} {digest(path)}{mirrored} {self.precision} on {device}"
        self._blender: Blender | None = None
        if device == "cpu":
            for layer in self.network.modules():
                if isinstance(layer, nn.Conv2d):
                    layer.register_forward_pre_hook(check)
        if device == "cpu" and self.compact:
            self._blender = Blender(usable_processors())
        _log.info("network %s", self.name)

    @torch.inference_mode()
    def __call__(self, packed: Tensor) -> Tensor:
        """(H, W, 8) half, or float32 with the values of half floats, -> (H, W, 4) half on the same device; never NaN, within
        0..1."""
        if self.device == "cpu" and self.compact:  # on CUDA this would cost a synchronisation, and a graph for each size
            rows, columns = covered(packed[..., BACKGROUND], self.network.reach, self.network.multiple)
            part = packed[rows, columns]
            if part.shape[0] * part.shape[1] < _WORTHWHILE * packed.shape[0] * packed.shape[1]:
                made = torch.zeros((*packed.shape[:2], PACKED_OUT), dtype=torch.float16)
                if part.numel():
                    made[rows, columns] = self.made(part)
                return made
        return self.made(packed)

    def channels(self, packed: Tensor) -> Tensor:
        """The network's input: (1, INPUT_CHANNELS, H, W), channels last."""
        x = packed[None].permute(0, 3, 1, 2)[:, :INPUT_CHANNELS]
        return x.to(torch.float32 if self.compact else self.dtype, memory_format=torch.channels_last)

    def made(self, packed: Tensor) -> Tensor:
        """The picture without leaving out background, averaged over the mirrored pictures; call it in inference mode."""
        if self.levels == 0:
            return self._averaged(packed)
        if self.device == "cpu":
            return self._merged_on_cpu(packed, self.levels)

        def planes(x: Tensor) -> Tensor:
            return self._averaged(x[0].permute(1, 2, 0).contiguous()).permute(2, 0, 1)[None]

        return merged(planes, packed.permute(2, 0, 1)[None], self.levels)[0].permute(1, 2, 0).contiguous()

    def _merged_on_cpu(self, packed: Tensor, levels: int) -> Tensor:
        """The same as ``merged``, in compiled loops."""
        packed = packed.float()
        large = min(packed.shape[:2]) >= LEAST_SIDE
        shares = sparse_blocks(packed.numpy()) if levels and large else np.zeros(0)
        made = self._averaged(packed)
        if shares.any():
            part = region(torch.from_numpy(shares), *packed.shape[:2])
            blocks = shares[tuple(slice(side.start // DENSITY_BLOCK, -(-side.stop // DENSITY_BLOCK)) for side in part)]
            near = packed[part].permute(2, 0, 1).contiguous()
            coarse = self._merged_on_cpu(torch.from_numpy(halved_pixels(near.numpy())).permute(1, 2, 0), levels - 1)
            picture = planes(made[part])
            merge(near[NOISE].numpy(), picture, planes(coarse), np.ascontiguousarray(blocks))
            made[part][..., :3] = torch.from_numpy(picture).permute(1, 2, 0)
        return made

    def _averaged(self, packed: Tensor) -> Tensor:
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
        """The same, with everything but the convolutions in compiled loops."""
        network = self.network
        assert isinstance(network, CompactUNet)
        packed = packed.permute(2, 0, 1).float().contiguous()  # no copy of what viewer.render.passes.fill_cpu makes
        cells = blend.space_to_depth(packed, network.block, network.multiple)
        return blend(packed, network.convolve(cells.to(self.dtype))[0].permute(1, 2, 0), network.block)
