"""Perceptual distances: the SqueezeNet distance from files given by path, else LPIPS where its weights are available.

``SqueezeDistance`` uses ImageNet SqueezeNet 1.1 features and LPIPS's linear heads for them (Zhang et al. 2018).  It is not
the published LPIPS, whose backbone was trained separately, so every figure made with it is called "SqueezeNet distance".
Pictures are (B, 3, H, W) in 0..1, sRGB.
"""

import logging
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

_log = logging.getLogger(__name__)

_FIRES = ("fire2", "fire3", "fire4", "fire5", "fire6", "fire7", "fire8", "fire9")
"""Fire modules of SqueezeNet 1.1, in order."""
_TAPS = ("fire3", "fire5", "fire6", "fire7", "fire8", "fire9")
"""Modules whose outputs LPIPS compares, besides the first convolution."""
_POOL_BEFORE = ("fire2", "fire4", "fire6")
"""Modules with a max pooling in front."""
SQUEEZE_FILES = ("sqz_notop.mat", "lin_v0.1_squeeze.pth")
"""Files of the features and of the linear heads."""


class SqueezeDistance(nn.Module):
    """Mean perceptual distance of two batches of pictures; 0 where they are equal.

    folder: holds SQUEEZE_FILES.  Raises FileNotFoundError where one is missing.
    """

    def __init__(self, folder: Path):
        super().__init__()
        from scipy.io import loadmat

        stored = loadmat(str(Path(folder) / SQUEEZE_FILES[0]))
        heads = torch.load(Path(folder) / SQUEEZE_FILES[1], map_location="cpu", weights_only=True)
        for name in ("conv1", *(f"{fire}/{part}" for fire in _FIRES for part in ("squeeze1x1", "expand1x1", "expand3x3"))):
            weight, bias = stored[name][0]
            key = name.replace("/", "_")
            self.register_buffer(f"{key}_weight", torch.from_numpy(weight.copy()).float().permute(3, 2, 0, 1).contiguous())
            self.register_buffer(f"{key}_bias", torch.from_numpy(bias.copy()).float().flatten())
        for number in range(7):
            self.register_buffer(f"head{number}", heads[f"lin{number}.model.1.weight"].flatten())
        self.register_buffer("mean", torch.tensor([104.0, 117.0, 123.0])[None, :, None, None])

    def _convolve(self, x: Tensor, key: str, **options) -> Tensor:
        return F.relu(F.conv2d(x, self.get_buffer(f"{key}_weight"), self.get_buffer(f"{key}_bias"), **options))

    def features(self, picture: Tensor) -> list[Tensor]:
        """Seven feature maps, normalised to unit length at each position."""
        x = self._convolve(picture.flip(1) * 255.0 - self.get_buffer("mean"), "conv1", stride=2)
        maps = [x]
        for fire in _FIRES:
            if fire in _POOL_BEFORE:
                x = F.max_pool2d(x, 3, 2, ceil_mode=True)
            x = self._convolve(x, f"{fire}_squeeze1x1")
            x = torch.cat([self._convolve(x, f"{fire}_expand1x1"), self._convolve(x, f"{fire}_expand3x3", padding=1)], 1)
            if fire in _TAPS:
                maps.append(x)
        return [m * torch.rsqrt(m.square().sum(1, keepdim=True) + 1e-10) for m in maps]

    def forward(self, a: Tensor, b: Tensor) -> Tensor:
        """Scalar: distance averaged over pictures and positions, summed over feature maps."""
        total = a.new_zeros(())
        for number, (p, q) in enumerate(zip(self.features(a), self.features(b), strict=True)):
            head = self.get_buffer(f"head{number}")[None, :, None, None]
            total = total + ((p - q).square() * head).sum(1).mean()
        return total


class Dissimilarity(nn.Module):
    """1 - SSIM (Wang et al. 2004), as a loss (Zhao et al. 2017): mean over windows, channels and pictures; 0 where equal.

    It penalises texture replaced by different texture, which a distance of deep features tolerates.
    """

    WINDOW, SIGMA = 11, 1.5
    """Gaussian window: side and standard deviation, pixels (Wang et al. 2004)."""

    def __init__(self) -> None:
        super().__init__()
        taps = torch.exp(-(torch.arange(self.WINDOW) - self.WINDOW // 2).float().square() / (2 * self.SIGMA**2))
        self.register_buffer("taps", taps / taps.sum(), persistent=False)

    def _means(self, x: Tensor) -> Tensor:
        taps, planes = self.get_buffer("taps").to(x.dtype), x.shape[1]
        x = F.conv2d(x, taps[None, None, :, None].expand(planes, 1, -1, -1), groups=planes)
        return F.conv2d(x, taps[None, None, None, :].expand(planes, 1, -1, -1), groups=planes)

    def forward(self, a: Tensor, b: Tensor) -> Tensor:
        """a, b: (B, 3, H, W) in 0..1, at least WINDOW pixels a side.  Computed in float32: in bfloat16 a variance, computed as
        the difference of two means, can be negative."""
        with torch.autocast(a.device.type, enabled=False):
            a, b = a.float(), b.float()
            mean_a, mean_b, square_a, square_b, product = self._means(torch.cat([a, b, a * a, b * b, a * b], 1)).chunk(5, 1)
        c1, c2 = 0.01**2, 0.03**2
        alike = (2 * mean_a * mean_b + c1) * (2 * (product - mean_a * mean_b) + c2)
        return 1.0 - (alike / ((mean_a**2 + mean_b**2 + c1) * (square_a - mean_a**2 + square_b - mean_b**2 + c2))).mean()


def perceptual(path: Path | None) -> tuple[nn.Module | None, str]:
    """The perceptual distance for training and evaluation, and its name for tables.

    The SqueezeNet distance where ``path`` is given, else LPIPS if it is installed and its weights can be loaded, else
    (None, "none"), which is logged.
    """
    if path is not None:
        return SqueezeDistance(path).eval(), "SqueezeNet distance"
    try:
        import lpips  # type: ignore[import-not-found]
    except ImportError as error:
        _log.info("no perceptual distance: no --perceptual DIR, and LPIPS is not installed (%s)", error)
        return None, "none"
    try:
        return _Lpips(lpips.LPIPS(net="vgg", verbose=False).eval()), "LPIPS (VGG)"
    except (OSError, RuntimeError) as error:  # no network for the download, or a damaged file
        _log.warning("no perceptual distance: LPIPS's weights cannot be loaded (%s)", error)
        return None, "none"


class _Lpips(nn.Module):
    def __init__(self, network: nn.Module):
        super().__init__()
        self.network = network

    def forward(self, a: Tensor, b: Tensor) -> Tensor:
        return self.network(a, b, normalize=True).mean()
