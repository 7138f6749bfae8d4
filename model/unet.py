"""The networks: a compact U-Net that corrects the filled picture, and the paper's, for comparison.

``CompactUNet`` takes the six channels of :func:`model.projection.network_input` and returns RGBA of the same size.  It cannot
invent a colour: at every pixel it chooses how far to blend the filled picture towards ever smoother versions of itself
(measured pixels count most), by no more than points stray by there, and then lightens or darkens that mixture, by no more
than the contrast of what was measured around it, without a local mean and what goes to and fro from pixel to pixel, and the
less the farther measured pixels are.  A last channel says how far the pixel is covered, 0 in void and sky.  Without the
blends, a plain residual network stayed at the identity for thousands of steps; with a mean, the correction glazed real scans
with the light of the rooms it was trained on; with what goes to and fro, even walls and paper showed a mesh; free in colour
and size, it drew coloured fringes and gratings beside holes of real scans.  It works at half resolution on 2x2 pixel blocks
(space to depth), so every convolution is wide and cheap and no detail is lost, and is fully convolutional: any size is padded
and cropped.
"""

import itertools
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

BLENDS = 4
"""Smoother versions of the filled picture: 3x3 binomial blurs at dilations 1, 2, 4, 8, one on the other."""
FILLED_WEIGHT = 0.05
"""How much an invented pixel counts in a blur, a measured one counting 1."""
MEAN_BLOCK = 16
"""Pixels a side over which the correction has no mean: it may sharpen and mend, but not shift the light."""
HALF_BAND = (-1 / 16, 4 / 16, 10 / 16, 4 / 16, -1 / 16)
"""Along rows and columns of what the network says: takes all of what goes to and fro from pixel to pixel and little else.  Made
of blocks, correction and blends have such a mesh where a picture is even; a mean for each corner takes only what is steady of
it."""
CONTRAST_AT = 2
"""Contrast is that of the picture so many blurs smooth, over the 9x9 pixels of the next; of points that stray, each for
itself, two blurs leave a sixth.  Density is measured after it."""
NOISE = 0.03
"""Contrast, of full light, that even walls of real scans have: the correction may use half of such a contrast, hardly any of a
smaller one, all of a larger.  With the whole of it, and of each pixel, the network drew worms on brick and wood."""
LEAST_CONTRAST = 0.001
"""By so much of full light the correction may change even where nothing varies."""
STRAYS = (0.273, 0.12, 0.058)
"""Standard deviation of what points that stray, each for itself by 1, leave between one blur and the next, the first on."""
MOST_STRAYS = 2.5
"""So many of these a blend may take away where all is measured, but for the finest, which it may have whole.  What is more
stands out: unbound, the network took faint numbers off an even tank, whatever lettering it was taught."""
LEAST_STRAY = 0.003
"""By so much of full light points stray everywhere."""
MEASURED = (0.3, 0.7)
"""Share of measured pixels below which a blend is not bound, and above which it is: far apart, points say little of this."""
SPARSE = 1.0 / 6.0
"""Share of measured pixels below which the correction fades, to nothing inside a hole."""
DARK = 0.08
"""Light below which the correction fades: black stays black."""
LUMA = (0.25, 0.6, 0.15)
INPUT_CHANNELS = 6
"""Filled red, green, blue; keep-mask or confidence; filled scale-free depth; filled noise level (model/projection.py)."""
PAPER_CHANNELS = 5
"""Of these, what the paper's network takes: all but the noise level."""


@dataclass(frozen=True)
class Size:
    """Channels of each level, 3x3 convolutions on the way down and up at each, pixels a side of the blocks it works on."""

    widths: tuple[int, ...]
    convolutions: int
    block: int = 2


SIZES = {
    "fast": Size((32, 64, 96, 128), 1),
    "balanced": Size((64, 128, 192, 256), 1),
}


def _convolutions(width: int, count: int) -> nn.Sequential:
    layers = []
    for _ in range(count):
        layers += [nn.Conv2d(width, width, 3, padding=1), nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def _luma(rgb: Tensor) -> Tensor:
    """(B, 1, H, W) light of (B, 3, H, W) sRGB values."""
    return LUMA[0] * rgb[:, :1] + LUMA[1] * rgb[:, 1:2] + LUMA[2] * rgb[:, 2:3]


def local_mean(x: Tensor, phases: int = 1) -> Tensor:
    """Means over squares of MEAN_BLOCK pixels, interpolated between the squares' centres; the size of ``x``, (B, 1, H, W).

    phases: pixels that are so many apart have a mean of their own.  Made of blocks, a picture is a little lighter in one corner
    of every block than in the next: with a mean for each corner, that pattern is part of the mean.
    """
    height, width = x.shape[-2:]
    apart = F.pixel_unshuffle(F.pad(x, (0, -width % phases, 0, -height % phases), mode="replicate"), phases)
    side = MEAN_BLOCK // phases
    padded = F.pad(apart, (0, -apart.shape[-1] % side, 0, -apart.shape[-2] % side), mode="replicate")
    means = F.avg_pool2d(padded, side)
    around = F.interpolate(means, padded.shape[-2:], mode="bilinear", align_corners=False)
    return F.pixel_shuffle(around, phases)[..., :height, :width]


def without_mesh(x: Tensor, kernel: Tensor) -> Tensor:
    """(B, C, H, W) without what changes from pixel to pixel, edges repeated.  kernel: (1, 1, 5, 5), HALF_BAND both ways."""
    planes = x.shape[1]
    around = F.pad(x, (len(HALF_BAND) // 2,) * 4, mode="replicate")
    return F.conv2d(around, kernel.to(x.dtype).expand(planes, 1, -1, -1), groups=planes)


class CompactUNet(nn.Module):
    """(B, 6, H, W) -> (B, 4, H, W), RGB and coverage, to be clamped to 0..1.  Skips are added, not concatenated; no
    normalisation layers.

    multiple: pixels that a side is padded to.  reach: no pixel further away than this many plays a part in one.
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
        self.grow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in itertools.pairwise(widths))
        self.up = nn.ModuleList(_convolutions(w, count) for w in widths[:-1])
        self.head = nn.Conv2d(widths[0], size.block**2 * (1 + BLENDS + 1), 3, padding=1)
        nn.init.zeros_(self.head.weight)  # untrained, the network returns the filled picture, covered everywhere
        nn.init.zeros_(self.head.bias)  # type: ignore[arg-type]
        binomial = torch.tensor([0.25, 0.5, 0.25])
        kernel = (binomial[:, None] * binomial).expand(6, 1, 3, 3).clone()
        self.register_buffer("kernel", kernel, persistent=False)
        taps = torch.tensor(HALF_BAND)
        self.register_buffer("half_band", (taps[:, None] * taps)[None, None].clone(), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """The blends are made in the precision of ``x``, the convolutions in that of the weights."""
        guide = self._trunk(x.to(self.stem.weight.dtype)).to(x.dtype)
        with torch.autocast(x.device.type, enabled=False):
            return self._blend(x, guide)

    def _blend(self, x: Tensor, guide: Tensor) -> Tensor:
        """guide: (B, 1 + BLENDS + 1, H, W), correction of the light, weights of the blends, coverage less 1."""
        picture, out, sharper = x[:, :3], x[:, :3], x[:, :3]
        weight = x[:, 3:4] * (1.0 - FILLED_WEIGHT) + FILLED_WEIGHT
        sums = torch.cat([picture * weight, weight, _luma(picture).square() * weight], 1)  # at last how far points stray
        kernel, half_band = self.get_buffer("kernel").to(x.dtype), self.get_buffer("half_band")
        shares = without_mesh(guide[:, 1 : 1 + BLENDS], half_band).clamp(0.0, 1.0)
        limit = dense = weight
        for number in range(BLENDS):
            if number == CONTRAST_AT:
                sums = torch.cat([sums, _luma(sums[:, :3]).square() / sums[:, 3:4]], 1)
            reach, planes = 2**number, sums.shape[1]
            sums = F.conv2d(F.pad(sums, (reach,) * 4, mode="replicate"), kernel[:planes], dilation=reach, groups=planes)
            smoother = sums[:, :3] / sums[:, 3:4]
            change = shares[:, number : number + 1] * (smoother - sharper)
            density = (sums[:, 3:4] - FILLED_WEIGHT) / (1.0 - FILLED_WEIGHT)
            if number == 0:
                variance = (sums[:, 4:] / sums[:, 3:4] - _luma(smoother).square()).clamp_min(0.0)
                sums = torch.cat([sums[:, :4], (variance + LEAST_STRAY**2).sqrt() * sums[:, 3:4]], 1)
            else:
                most = MOST_STRAYS * STRAYS[number - 1] * sums[:, 4:5] / sums[:, 3:4]
                bound = (most / _luma(change).abs().clamp_min(1e-6)).clamp_max(1.0)
                sure = ((density - MEASURED[0]) / (MEASURED[1] - MEASURED[0])).clamp(0.0, 1.0)
                change = change * (1.0 - sure * (1.0 - bound))
            out = out + change
            sharper = smoother
            if number == CONTRAST_AT:
                variance = (sums[:, 5:] / sums[:, 3:4] - _luma(smoother).square()).clamp_min(0.0)
                limit = variance.sqrt() * variance / (variance + NOISE**2) + LEAST_CONTRAST
                dense, sums = density, sums[:, :5]
        light = without_mesh(guide[:, :1] - local_mean(guide[:, :1], self.block), half_band)
        light = limit * torch.tanh(light / limit) * (dense / SPARSE).clamp(0.0, 1.0)
        return torch.cat([out * (1.0 + light / _luma(out).clamp_min(DARK)), 1.0 + guide[:, -1:]], 1)

    def _trunk(self, x: Tensor) -> Tensor:
        return F.pixel_shuffle(self.blocks(x), self.block)[..., : x.shape[-2], : x.shape[-1]]

    def blocks(self, x: Tensor) -> Tensor:
        """What the convolutions say of each block of pixels: (B, (1 + BLENDS + 1) * block**2, h, w)."""
        height, width = x.shape[-2:]
        padded = F.pad(x, (0, -width % self.multiple, 0, -height % self.multiple), mode="replicate")
        h = self.stem(F.pixel_unshuffle(padded, self.block)).relu_()
        skips = []
        for level, convolutions in enumerate(self.down):
            h = convolutions(h)
            if level < len(self.shrink):
                skips.append(h)
                h = self.shrink[level](h).relu_()
        for level in range(len(skips) - 1, -1, -1):
            h = F.interpolate(self.grow[level](h), scale_factor=2, mode="nearest")
            h = self.up[level](h.add_(skips[level]).relu_())
        return self.head(h)


class PaperUNet(nn.Module):
    """The paper's U-Net (Vanherck et al. 2025): 64 to 1024 channels, batch normalisation, transposed convolutions.

    (B, 5 or more, H, W) RGB, keep-mask and depth, and what it does not look at -> (B, 3, H, W).  31 million parameters.
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
    """An untrained network of the named quality (a key of SIZES, or ``paper``)."""
    return PaperUNet() if quality == "paper" else CompactUNet(SIZES[quality])


def mac_per_pixel(network: nn.Module, side: int = 256) -> float:
    """Multiply-accumulates of all convolutions for one pixel of a side x side picture (counted by running it)."""
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
