"""Picture metrics: PSNR, SSIM and the gradient energy that keeps blur from winning.  Pictures (..., 3, H, W) in 0..1."""

import torch
import torch.nn.functional as F
from torch import Tensor


def psnr(a: Tensor, b: Tensor) -> float:
    """Decibels; infinite where the pictures are equal."""
    error = (a.double() - b.double()).square().mean()
    return float(-10.0 * torch.log10(error))


def psnr_after_gain(a: Tensor, b: Tensor) -> float:
    """PSNR after one global gain on ``a``, the best in the least-squares sense."""
    a, b = a.double(), b.double()
    return psnr(a * ((a * b).sum() / a.square().sum().clamp_min(1e-12)), b)


def ssim(a: Tensor, b: Tensor) -> float:
    """Mean structural similarity, 11x11 Gaussian window of sigma 1.5, per channel (Wang et al. 2004)."""
    offsets = torch.arange(11, dtype=torch.float64, device=a.device) - 5
    kernel = torch.exp(-offsets.square() / (2 * 1.5**2))
    kernel = kernel / kernel.sum()
    a, b = a.double().reshape(-1, 1, *a.shape[-2:]), b.double().reshape(-1, 1, *b.shape[-2:])

    def blur(x: Tensor) -> Tensor:
        return F.conv2d(F.conv2d(x, kernel.view(1, 1, 1, -1)), kernel.view(1, 1, -1, 1))

    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2
    cov = blur(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    value = ((2 * mean_a * mean_b + c1) * (2 * cov + c2)) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
    return float(value.mean())


def gradient_energy(a: Tensor) -> float:
    """Mean absolute difference of neighbouring pixels."""
    return float((a[..., 1:] - a[..., :-1]).abs().mean() + (a[..., 1:, :] - a[..., :-1, :]).abs().mean())
