"""The networks: a compact U-Net that corrects the filled picture, and the paper's U-Net for comparison.

``CompactUNet`` takes the six channels of :func:`model.reference.projection.network_input` and returns RGBA of the same size.
It cannot invent a colour.  At each pixel its convolutions choose two things:

* how far the filled picture is blended towards ever smoother versions of itself, in which measured pixels count most;
* a correction of luminance, bounded by the contrast measured around the pixel.  The correction has no local mean, so it may
  sharpen and mend but not change the brightness of a surface, and no pixel-frequency (Nyquist) component, which would show as a
  mesh on even walls.

A measured pixel may change by its noise and by its difference from its neighbours: outliers and edges are mended, and a
measurement with which its neighbours agree stays.

The last channel is the coverage, 0 in background and sky.  A plain residual network, without the blends, stayed at the identity
for thousands of steps of training.

The convolutions work at half resolution on 2x2 pixel blocks (space to depth), so they are wide and cheap and lose no detail.
The network is fully convolutional: any size is padded and cropped.  The model card
(assets/weights/README.md) lists what each bound costs and gains.
"""

import itertools

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from .interruption import check
from .network_layout import NOISE_SCALE
from .qualities import QUALITIES, Size

BLENDS = 4
"""Number of smoother versions of the filled picture: 3x3 binomial blurs at dilations 1, 2, 4, 8, each of the last."""
FILLED_WEIGHT = 0.05
"""Weight of a filled pixel in a blur, relative to 1 for a measured pixel; 0.01 and 0.2 change PSNR by 0.0 to
0.2 dB either way in three rooms."""
MEAN_BLOCK = 16
"""Pixels a side over which the correction has no mean.  Without this, FLIP is 0.007 to 0.04 worse in three rooms."""
HALF_BAND = (-1 / 16, 4 / 16, 10 / 16, 4 / 16, -1 / 16)
"""Half-band low-pass taps along rows and columns of the network's channels: zero at the pixel (Nyquist) frequency, flat at 0.
Made of blocks, the channels have a mesh of that frequency where the picture is even."""
CONTRAST_AT = 2
"""The blur whose 9x9 neighbourhood measures contrast, on the picture smoothed by the blurs before it, so that single outlier
points hardly count: two blurs leave a sixth of their amplitude."""
NOISE = 0.03
"""Contrast, as a standard deviation of luminance in 0..1, that even walls of real scans have.  The correction may use half of a
contrast of this size, hardly any of a smaller and nearly all of a larger one.  model.appearance.noise measures 0.023 in
studio.laz, 0.005 in plant_room.laz, 0.064 in street_corner.laz and 0.031 in a statue.  On brick and wood the correction draws
worm-like patterns without it."""
KEPT_DEVIATIONS = 3.0
"""Standard deviations of its noise by which a measured pixel may change, besides its difference from the 3x3 blur.  Chosen on
atrium and living-room-2 and judged on dining-room and two real scans (assets/weights/README.md)."""
LEAST_CONTRAST = 0.001
"""Contrast, 0..1, that the correction may use where nothing varies; keeps its bound above 0."""
LEAST_LUMINANCE = 1 / 255
"""Guard of the division by luminance: one level of 8 bits."""
LUMA = (0.25, 0.6, 0.15)
"""Weights of sRGB values called luminance here, near those of Rec. 601; the shipped weights were trained with them."""
INPUT_CHANNELS = 6
"""Filled red, green, blue; keep-mask or confidence; filled scale-free depth; filled noise level
(model/reference/projection.py)."""
PAPER_CHANNELS = 5
"""Channels of these that the paper's network takes: all but the noise level."""


_FUSED = (torch.float32, torch.bfloat16) if hasattr(torch.ops.mkldnn, "_convolution_pointwise") else ()
"""Types of which oneDNN, as torch has it here, convolves and rectifies in one call."""


class Pointwise(nn.Conv2d):
    """A convolution of 1x1 pixels.  On a CPU it is a product of matrices: oneDNN's 1x1 convolution of 256 channels and more
    adds in an order that depends on the number of threads, so that pictures differed by one level (measured on 1, 2, 3 and 8).
    """

    def forward(self, input: Tensor) -> Tensor:
        if input.device.type != "cpu":
            return super().forward(input)
        return F.linear(input.permute(0, 2, 3, 1), self.weight[:, :, 0, 0], self.bias).permute(0, 3, 1, 2)


def _convolutions(width: int, count: int) -> nn.Sequential:
    layers = []
    for _ in range(count):
        layers += [nn.Conv2d(width, width, 3, padding=1), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def _rectified(layer: nn.Module, x: Tensor) -> Tensor:
    """``layer`` and ReLU.  In inference on a CPU both are one call of oneDNN, equal to the bit: 8 % of balanced's time."""
    if isinstance(layer, nn.Conv2d) and x.device.type == "cpu" and x.dtype in _FUSED and torch.is_inference_mode_enabled():
        check()
        return torch.ops.mkldnn._convolution_pointwise(
            x, layer.weight, layer.bias, layer.padding, layer.stride, layer.dilation, layer.groups, "relu", [], "")
    return layer(x).relu_()


def _all_rectified(layers: nn.Module, x: Tensor) -> Tensor:
    for layer in layers.children():
        if isinstance(layer, nn.Conv2d):  # else its ReLU
            x = _rectified(layer, x)
    return x


def _grown(skip: Tensor, coarse: Tensor) -> Tensor:
    """ReLU of the sum of ``skip`` (B, C, H, W), which inference overwrites, and ``coarse`` (B, C, H/2, W/2), its pixels
    repeated."""
    if not torch.is_inference_mode_enabled():
        return F.interpolate(coarse, scale_factor=2, mode="nearest").add_(skip).relu_()
    height, width = skip.shape[2:]
    four = skip.unflatten(3, (width // 2, 2)).unflatten(2, (height // 2, 2))
    four.add_(coarse[:, :, :, None, :, None]).relu_()
    return skip


def _luma(rgb: Tensor) -> Tensor:
    """(B, 1, H, W) luminance of (B, 3, H, W) sRGB values."""
    return LUMA[0] * rgb[:, :1] + LUMA[1] * rgb[:, 1:2] + LUMA[2] * rgb[:, 2:3]


def local_mean(x: Tensor, phases: int = 1) -> Tensor:
    """Means over squares of MEAN_BLOCK pixels, interpolated between the squares' centres; the size of ``x``, (B, 1, H, W).

    phases: pixels this many apart share a mean.  A picture made of blocks is slightly brighter in one corner of each block than
    in the next; with one mean for each corner, that pattern is part of the mean.
    """
    height, width = x.shape[-2:]
    apart = F.pixel_unshuffle(F.pad(x, (0, -width % phases, 0, -height % phases), mode="replicate"), phases)
    side = MEAN_BLOCK // phases
    padded = F.pad(apart, (0, -apart.shape[-1] % side, 0, -apart.shape[-2] % side), mode="replicate")
    means = F.avg_pool2d(padded, side)
    around = F.interpolate(means, padded.shape[-2:], mode="bilinear", align_corners=False)
    return F.pixel_shuffle(around, phases)[..., :height, :width]


def without_mesh(x: Tensor, kernel: Tensor) -> Tensor:
    """(B, C, H, W) without its pixel-frequency (Nyquist) pattern, edges repeated.  kernel: (1, 1, 5, 5), HALF_BAND twice."""
    planes = x.shape[1]
    around = F.pad(x, (len(HALF_BAND) // 2,) * 4, mode="replicate")
    return F.conv2d(around, kernel.to(x.dtype).expand(planes, 1, -1, -1), groups=planes)


class CompactUNet(nn.Module):
    """(B, 6, H, W) -> (B, 4, H, W), RGB and coverage, to be clamped to 0..1.  Skips are added, not concatenated; there are no
    normalisation layers.

    multiple: sides are padded to a multiple of this many pixels.  reach: radius of the receptive field, pixels.
    """

    def __init__(self, size: Size):
        super().__init__()
        widths, count = size.widths, size.convolutions
        self.block = size.block
        self.multiple = size.block * 2 ** (len(widths) - 1)
        strides = [size.block * 2**level for level in range(len(widths))]
        self.reach = 2 * size.block + count * (sum(strides) + sum(strides[:-1])) + strides[-1] + 3 * MEAN_BLOCK // 2
        self.stem = nn.Conv2d(size.block**2 * INPUT_CHANNELS, widths[0], 3, padding=1)
        self.down = nn.ModuleList(_convolutions(w, count) for w in widths)
        self.shrink = nn.ModuleList(nn.Conv2d(a, b, 2, stride=2) for a, b in itertools.pairwise(widths))
        self.grow = nn.ModuleList(Pointwise(b, a, 1) for a, b in itertools.pairwise(widths))
        self.up = nn.ModuleList(_convolutions(w, count) for w in widths[:-1])
        self.head = nn.Conv2d(widths[0], size.block**2 * (1 + BLENDS + 1), 3, padding=1)
        nn.init.zeros_(self.head.weight)  # untrained, the network returns the filled picture, covered everywhere
        nn.init.zeros_(self.head.bias)  # type: ignore[arg-type]
        binomial = torch.tensor([0.25, 0.5, 0.25])
        kernel = (binomial[:, None] * binomial).expand(5, 1, 3, 3).clone()
        self.register_buffer("kernel", kernel, persistent=False)
        taps = torch.tensor(HALF_BAND)
        self.register_buffer("half_band", (taps[:, None] * taps)[None, None].clone(), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """Blends in the precision of ``x``, convolves in that of the weights."""
        guide = self._trunk(x.to(self.stem.weight.dtype)).to(x.dtype)
        with torch.autocast(x.device.type, enabled=False):
            return self._blend(x, guide)

    def _blend(self, x: Tensor, guide: Tensor) -> Tensor:
        """x: (B, 6, H, W), the input.  guide: (B, 1 + BLENDS + 1, H, W), correction of luminance, shares of the blends,
        coverage less 1.  Returns (B, 4, H, W).

        ``sums`` holds weighted red, green and blue and the weight; at CONTRAST_AT also the weighted square of luminance.
        """
        picture, out, sharper, allowed = x[:, :3], x[:, :3], x[:, :3], x[:, :3]
        weight = x[:, 3:4] * (1.0 - FILLED_WEIGHT) + FILLED_WEIGHT
        sums = limit = torch.cat([picture * weight, weight], 1)
        kernel, half_band = self.get_buffer("kernel").to(x.dtype), self.get_buffer("half_band")
        shares = without_mesh(guide[:, 1 : 1 + BLENDS], half_band).clamp(0.0, 1.0)
        for number in range(BLENDS):
            if number == CONTRAST_AT:
                sums = torch.cat([sums, _luma(sums[:, :3]).square() / sums[:, 3:4]], 1)
            reach, planes = 2**number, sums.shape[1]
            sums = F.conv2d(F.pad(sums, (reach,) * 4, mode="replicate"), kernel[:planes], dilation=reach, groups=planes)
            smoother = sums[:, :3] / sums[:, 3:4]
            if number == 0:
                allowed = KEPT_DEVIATIONS / NOISE_SCALE * x[:, 5:6] + (picture - smoother).abs()
            out = out + shares[:, number : number + 1] * (smoother - sharper)
            sharper = smoother
            if number == CONTRAST_AT:
                variance = (sums[:, 4:] / sums[:, 3:4] - _luma(smoother).square()).clamp_min(0.0)
                limit = variance.sqrt() * variance / (variance + NOISE**2) + LEAST_CONTRAST
                sums = sums[:, :4]
        light = without_mesh(guide[:, :1] - local_mean(guide[:, :1], self.block), half_band)
        light = limit * torch.tanh(light / limit)
        out = out * (1.0 + light / _luma(out).clamp_min(LEAST_LUMINANCE))
        allowed = torch.where(x[:, 3:4] > 0, allowed / x[:, 3:4], 1.0)  # filled pixels may change by any amount
        return torch.cat([picture + (out - picture).clamp(-allowed, allowed), 1.0 + guide[:, -1:]], 1)

    def _trunk(self, x: Tensor) -> Tensor:
        return F.pixel_shuffle(self.blocks(x), self.block)[..., : x.shape[-2], : x.shape[-1]]

    def blocks(self, x: Tensor) -> Tensor:
        """Output of the convolutions for each block of pixels: (B, (1 + BLENDS + 1) * block**2, h, w)."""
        height, width = x.shape[-2:]
        padded = F.pad(x, (0, -width % self.multiple, 0, -height % self.multiple), mode="replicate")
        return self.convolve(F.pixel_unshuffle(padded, self.block))

    def convolve(self, h: Tensor) -> Tensor:
        """The same from the padded input in blocks (space to depth): (B, 6 * block**2, h, w)."""
        h = _rectified(self.stem, h)
        skips = []
        for level, convolutions in enumerate(self.down):
            h = _all_rectified(convolutions, h)
            if level < len(self.shrink):
                skips.append(h)
                h = _rectified(self.shrink[level], h)
        for level in range(len(skips) - 1, -1, -1):
            h = _all_rectified(self.up[level], _grown(skips[level], self.grow[level](h)))
        return self.head(h)


class PaperUNet(nn.Module):
    """The paper's U-Net (Vanherck et al. 2025): 64 to 1024 channels, batch normalisation, transposed convolutions.

    (B, 5 or more, H, W), RGB, keep-mask and depth (further channels are ignored) -> (B, 3, H, W).  31 million parameters.
    """

    def __init__(self, base: int = 64):
        super().__init__()
        self.multiple = 16
        widths = [base * 2**i for i in range(5)]

        def double(a: int, b: int) -> nn.Sequential:
            layers: list[nn.Module] = []
            for source in (a, b):
                layers += [nn.Conv2d(source, b, 3, padding=1, bias=False), nn.BatchNorm2d(b), nn.ReLU(inplace=True)]
            return nn.Sequential(*layers)

        self.down = nn.ModuleList(double(a, b) for a, b in zip([PAPER_CHANNELS, *widths], widths, strict=False))
        self.grow = nn.ModuleList(nn.ConvTranspose2d(2 * w, w, 2, stride=2) for w in widths[:-1])
        self.up = nn.ModuleList(double(2 * w, w) for w in widths[:-1])
        self.head = nn.Conv2d(base, 3, 1)

    def forward(self, x: Tensor) -> Tensor:
        height, width = x.shape[-2:]
        x = x[:, :PAPER_CHANNELS]
        h = F.pad(x, (0, -width % self.multiple, 0, -height % self.multiple), mode="replicate")
        skips = []
        for level, block in enumerate(self.down):
            h = block(h if level == 0 else F.max_pool2d(h, 2))
            skips.append(h)
        for level in range(len(self.up) - 1, -1, -1):
            h = self.up[level](torch.cat([skips[level], self.grow[level](h)], 1))
        return self.head(h)[..., :height, :width]


def make_network(quality: str) -> nn.Module:
    """An untrained network of a quality."""
    row = QUALITIES[quality]
    size = QUALITIES[row.mirrors].size if row.mirrors else row.size
    return PaperUNet() if size is None else CompactUNet(size)


def mac_per_pixel(network: nn.Module, side: int = 256) -> float:
    """Multiply-accumulates of all convolutions for one pixel, counted by running a side x side picture."""
    total = 0

    def count(module: nn.Module, _inputs, output: Tensor) -> None:
        nonlocal total
        if isinstance(module, nn.Conv2d):
            total += output.numel() * module.weight[0].numel()
        elif isinstance(module, nn.ConvTranspose2d):
            total += output.numel() * module.weight.shape[0]

    hooks = [m.register_forward_hook(count) for m in network.modules()]
    training = network.training
    with torch.no_grad():
        network.eval()(torch.zeros(1, INPUT_CHANNELS, side, side))
    network.train(training)
    for hook in hooks:
        hook.remove()
    return total / side**2
