"""A training loss for visible differences: the colour part of FLIP (Andersson et al. 2020), differentiable.

Both pictures are blurred as far as an eye cannot resolve them, chroma more than luminance, and compared in a space where equal
distances look equally different.  A power below 1 makes small errors on even surfaces count, which L1 and SSIM hardly see.
FLIP's second part, edges and single points, is left out.  Evaluation uses the authors' own package (model.evaluation.flip).
"""

import math

import torch
import torch.nn.functional as F
from torch import Tensor, nn

PIXELS_PER_DEGREE = 67.0
"""FLIP's default viewing distance."""
_SENSITIVITY = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
"""Contrast sensitivity of luminance, red-green and blue-yellow: amplitude and width (square degrees) of sums of Gaussians."""
_POWER = 0.7
_KNEE, _KNEE_VALUE = 0.4, 0.95
"""Differences below this share of the largest one are spread over so much of the result's range."""
_SMALLEST = 0.05
"""Added to a difference (of 0 to about 100) before the power, whose slope at 0 is infinite.  Chosen by hand: an eighth of the
difference of two neighbouring levels of a medium grey."""
_TO_XYZ = ((0.4124564, 0.3575761, 0.1804375), (0.2126729, 0.7151522, 0.0721750), (0.0193339, 0.1191920, 0.9503041))
"""Linear sRGB to CIE XYZ, D65 (IEC 61966-2-1); white is the sum of its columns."""
_OPPONENT = ((0.0, 116.0, 0.0), (500.0, -500.0, 0.0), (0.0, 200.0, -200.0))
"""XYZ over that of white to YCxCz, less its constant."""
_CURVE_START = 6 / 29
"""CIE Lab: cube of the ratio below which the cube root is replaced by a line."""


class VisibleDifference(nn.Module):
    """(B, 3, H, W) twice, sRGB in 0..1 -> mean difference, 0 (equal) to 1; with ``weight`` (B, 1, H, W), the weighted mean."""

    def __init__(self) -> None:
        super().__init__()
        to_xyz = torch.tensor(_TO_XYZ, dtype=torch.float64)
        relative = to_xyz / to_xyz.sum(1, keepdim=True)
        opponent = torch.tensor(_OPPONENT, dtype=torch.float64) @ relative
        self.register_buffer("relative", relative.float(), persistent=False)
        self.register_buffer("opponent", opponent.float(), persistent=False)
        self.register_buffer("to_linear", torch.linalg.inv(opponent).float(), persistent=False)
        widest = max(width for terms in _SENSITIVITY for _, width in terms)
        radius = math.ceil(3 * math.sqrt(widest / (2 * math.pi**2)) * PIXELS_PER_DEGREE)
        squared = (torch.arange(-radius, radius + 1, dtype=torch.float64) / PIXELS_PER_DEGREE).square()
        self._kernels: list[list[tuple[float, str]]] = []
        for channel, terms in enumerate(_SENSITIVITY):
            parts = []
            shares = [amplitude * math.sqrt(width) for amplitude, width in terms]  # sums over the plane of a term
            for number, (_, width) in enumerate(terms):
                taps = torch.exp(-(math.pi**2) * squared / width)
                name = f"taps_{channel}_{number}"
                self.register_buffer(name, (taps / taps.sum()).float(), persistent=False)
                parts.append((shares[number] / sum(shares), name))
            self._kernels.append(parts)
        corners = torch.tensor([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).reshape(2, 3, 1, 1)
        green, blue = self._lab(corners)
        self._largest = float(self._distance(green[None], blue[None]))

    def forward(self, a: Tensor, b: Tensor, weight: Tensor | None = None) -> Tensor:
        with torch.autocast(a.device.type, enabled=False):
            error = self._remapped(self._distance(self._seen(a.float()), self._seen(b.float())))
            if weight is None:
                return error.mean()
            return (error * weight).sum() / weight.sum().clamp_min(1)

    def _seen(self, srgb: Tensor) -> Tensor:
        """Lab colours after the blur of the eye."""
        linear = torch.where(srgb <= 0.04045, srgb / 12.92, ((srgb.clamp_min(0.04045) + 0.055) / 1.055) ** 2.4)
        channels = torch.einsum("ij,bjhw->bihw", self.get_buffer("opponent"), linear)
        blurred = torch.cat([self._blurred(channels[:, i : i + 1], parts) for i, parts in enumerate(self._kernels)], 1)
        return self._lab(torch.einsum("ij,bjhw->bihw", self.get_buffer("to_linear"), blurred).clamp(0.0, 1.0))

    def _blurred(self, channel: Tensor, parts: list[tuple[float, str]]) -> Tensor:
        blurred = torch.zeros_like(channel)
        for share, name in parts:
            taps = self.get_buffer(name)
            around = F.pad(channel, (len(taps) // 2,) * 4, mode="replicate")
            blurred = blurred + share * F.conv2d(F.conv2d(around, taps[None, None, :, None]), taps[None, None, None, :])
        return blurred

    def _lab(self, linear: Tensor) -> Tensor:
        """CIE Lab of linear sRGB, its chroma scaled by lightness (Hunt effect)."""
        ratio = torch.einsum("ij,bjhw->bihw", self.get_buffer("relative"), linear)
        start = _CURVE_START**3
        root = torch.where(ratio > start, ratio.clamp_min(start) ** (1 / 3), ratio / (3 * _CURVE_START**2) + 4 / 29)
        x, y, z = root.chunk(3, 1)
        lightness = 116 * y - 16
        return torch.cat([lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)], 1)

    @staticmethod
    def _distance(a: Tensor, b: Tensor) -> Tensor:
        """(B, 1, H, W): HyAB (Abasi et al. 2020) to the power, city-block in lightness and Euclidean in chroma."""
        change = a - b
        chroma = (change[:, 1:].square().sum(1, keepdim=True) + _SMALLEST**2).sqrt() - _SMALLEST
        return (change[:, :1].abs() + chroma + _SMALLEST) ** _POWER - _SMALLEST**_POWER

    def _remapped(self, error: Tensor) -> Tensor:
        knee = _KNEE * self._largest
        above = _KNEE_VALUE + (error - knee) / (self._largest - knee) * (1 - _KNEE_VALUE)
        return torch.where(error < knee, error * (_KNEE_VALUE / knee), above)
