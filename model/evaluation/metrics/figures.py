"""Metrics of one picture against the truth.  Features of the truth are computed once for all methods."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from .flip import FlipTo
from .image_metrics import SsimTo, masked_error, masked_psnr, mean_of, psnr, psnr_after_gain
from .perceptual import SqueezeDistance


@dataclass(frozen=True)
class Figures:
    """Metrics of one picture; NaN where a metric is not available.

    psnr, psnr_gain (after one global gain): dB.  distance: perceptual.  flip: mean FLIP.  invented: share of the pixels without
    a measured colour; invented_psnr (dB), invented_error (mean absolute, 0..1), invented_distance: over those pixels only.
    """

    psnr: float
    psnr_gain: float
    ssim: float
    distance: float
    flip: float
    invented: float
    invented_psnr: float
    invented_error: float
    invented_distance: float


class Truth:
    """A true picture with its precomputed features.

    rgb: (3, H, W) in 0..1.  distance: of :func:`model.evaluation.metrics.perceptual.perceptual`, or None.  flip: of
    :func:`model.evaluation.metrics.flip.flip_metric`, or None.
    """

    def __init__(self, rgb: Tensor, distance: nn.Module | None, flip: FlipTo | None = None):
        self.rgb, self.distance, self.flip = rgb, distance, flip
        self.similarity = SsimTo(rgb)
        self.features = None
        if isinstance(distance, SqueezeDistance):
            with torch.inference_mode():
                self.features = distance.features(_batch(rgb))

    @torch.inference_mode()
    def gap(self, made: Tensor) -> float:
        """Perceptual distance of a picture (3, H, W) to the truth; NaN if not available."""
        if self.distance is None:
            return math.nan
        if self.features is None:
            return float(self.distance(made[None], self.rgb[None]))
        assert isinstance(self.distance, SqueezeDistance)
        total = 0.0
        for number, (p, q) in enumerate(zip(self.distance.features(_batch(made)), self.features, strict=True)):
            head = self.distance.get_buffer(f"head{number}")[None, :, None, None]
            total += mean_of(((p - q).square() * head).sum(1))
        return total

    def figures(self, made: Tensor, invented: Tensor, *, invented_distance: bool = True) -> Figures:
        """made: (3, H, W) in 0..1.  invented: (H, W) bool, pixels without a measured colour, the same for all compared methods.

        invented_distance: whether to compute the perceptual distance of those pixels, for which they replace the true ones in
        the true picture.
        """
        some = invented_distance and bool(invented.any())
        return Figures(
            psnr(made, self.rgb), psnr_after_gain(made, self.rgb), self.similarity(made), self.gap(made),
            math.nan if self.flip is None else self.flip(self.rgb, made),
            float(invented.double().mean()),
            masked_psnr(made, self.rgb, invented), masked_error(made, self.rgb, invented),
            self.gap(torch.where(invented, made, self.rgb)) if some else math.nan,
        )


def _batch(rgb: Tensor) -> Tensor:
    return rgb[None].contiguous(memory_format=torch.channels_last)
