"""Picture metrics: PSNR, SSIM and gradient energy, which reveals blur.  Pictures: (..., 3, H, W) in 0..1."""

import math

import torch
from torch import Tensor

WINDOW = 11
"""Side, pixels, of the window of SSIM, a Gaussian of standard deviation 1.5 (Wang et al. 2004)."""


def mean_of(values: Tensor) -> float:
    """The mean in float64, to the last bit the same for any number of threads: torch adds up a part for each."""
    return float(values.detach().double().cpu().numpy().mean()) if values.numel() else math.nan


def psnr(a: Tensor, b: Tensor) -> float:
    """PSNR in dB; infinite if the pictures are equal."""
    error = mean_of((a.double() - b.double()).square())
    return math.inf if error == 0.0 else -10.0 * math.log10(error)


def psnr_after_gain(a: Tensor, b: Tensor) -> float:
    """PSNR in dB after multiplying ``a`` by the global gain with the least squared error."""
    a, b = a.double(), b.double()
    return psnr(a * (mean_of(a * b) / max(mean_of(a.square()), 1e-18)), b)


def masked_psnr(a: Tensor, b: Tensor, where: Tensor) -> float:
    """PSNR over the pixels ``where`` (H, W) bool; NaN without pixels."""
    return psnr(a[..., where], b[..., where])


def masked_error(a: Tensor, b: Tensor, where: Tensor) -> float:
    """Mean absolute difference over the pixels ``where`` (H, W) bool; NaN without pixels."""
    return mean_of((a[..., where].double() - b[..., where].double()).abs())


def _window_means(x: Tensor) -> Tensor:
    """Gaussian means of the windows within the picture: (..., H, W) -> (..., H - 10, W - 10)."""
    middle = WINDOW // 2
    weights = torch.exp(-(torch.arange(WINDOW, dtype=torch.float64) - middle).square() / (2 * 1.5**2))
    share = (weights / weights.sum()).tolist()
    for axis in (-1, -2):
        length = x.shape[axis] - WINDOW + 1
        total = x.narrow(axis, middle, length) * share[middle]
        for k in range(middle):
            total.add_(x.narrow(axis, k, length) + x.narrow(axis, WINDOW - 1 - k, length), alpha=share[k])
        x = total
    return x


class SsimTo:
    """Structural similarity (Wang et al. 2004: 11x11 Gaussian window, per channel) to one picture, with its precomputed
    moments.

    Computed in the precision of that picture.  Raises ValueError for a picture smaller than the window.
    """

    def __init__(self, truth: Tensor):
        if min(truth.shape[-2:]) < WINDOW:
            raise ValueError(f"SSIM needs at least {WINDOW}x{WINDOW} pixels; this one has {truth.shape[-1]}x{truth.shape[-2]}")
        self.truth = truth
        self.mean, squares = _window_means(torch.stack([truth, truth * truth]))
        self.variance = squares - self.mean**2

    def __call__(self, a: Tensor) -> float:
        """Mean over windows and channels; 1 for equal pictures."""
        a = a.to(self.truth.dtype)
        mean, squares, products = _window_means(torch.stack([a, a * a, a * self.truth]))
        c1, c2 = 0.01**2, 0.03**2
        value = (2 * mean * self.mean + c1) * (2 * (products - mean * self.mean) + c2)
        value = value / ((mean**2 + self.mean**2 + c1) * (squares - mean**2 + self.variance + c2))
        return mean_of(value)


def ssim(a: Tensor, b: Tensor) -> float:
    """Mean structural similarity (:class:`SsimTo`) in float64."""
    return SsimTo(b.double())(a)


def gradient_energy(a: Tensor) -> float:
    """Mean absolute difference of horizontal neighbours plus that of vertical neighbours."""
    return mean_of((a[..., 1:] - a[..., :-1]).abs()) + mean_of((a[..., 1:, :] - a[..., :-1, :]).abs())
