"""The training loss: L1, perceptual distance, dissimilarity, local light, excess error, coverage, and temporal stability.

L1 and the perceptual distance have the paper's weights by default (0.9 and 0.1).  Dissimilarity is 1 - SSIM.  Local light
compares means over small squares: without it the network shifted the brightness of surfaces slightly, which the other terms
hardly penalise.  Excess error counts only where the network is further from the truth than its input.
Coverage compares the fourth channel with the true covered share of each pixel.  Temporal stability (Lai et al. 2018): the
picture from a slightly moved camera, warped by the true motion of the surface points, should equal this picture; their
optical flow is estimated, ours is known.
"""

from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ..data.crops import Batch
from ..evaluation.metrics.perceptual import Dissimilarity, perceptual


def warp(picture: Tensor, flow: Tensor) -> Tensor:
    """``picture`` (N, C, H, W) sampled bilinearly at each pixel's position plus ``flow`` (N, 2, H, W) pixels; NaN flow is 0."""
    height, width = picture.shape[-2:]
    rows, columns = torch.meshgrid(
        torch.arange(height, device=flow.device), torch.arange(width, device=flow.device), indexing="ij"
    )
    flow = torch.nan_to_num(flow)
    x = (2 * (columns + flow[:, 0]) + 1) / width - 1
    y = (2 * (rows + flow[:, 1]) + 1) / height - 1
    return F.grid_sample(picture, torch.stack([x, y], -1).to(picture.dtype), align_corners=False, padding_mode="border")


def inside_flow(flow: Tensor) -> Tensor:
    """(N, 1, H, W) bool: pixels whose position in the neighbouring picture is known and inside it."""
    height, width = flow.shape[-2:]
    rows, columns = torch.meshgrid(
        torch.arange(height, device=flow.device), torch.arange(width, device=flow.device), indexing="ij"
    )
    x, y = columns + flow[:, 0], rows + flow[:, 1]  # NaN compares false
    return ((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1))[:, None]


LIGHT_SIDES = (4, 16)
"""Pixels a side of the squares whose mean colours are compared; at both, atrium's mean light was worse than filled."""


def local_light(made: Tensor, true: Tensor, weight: Tensor) -> Tensor:
    """Mean absolute difference of the weighted mean colours of squares of LIGHT_SIDES pixels, averaged over both sizes.

    made, true: (B, 3, H, W).  weight: (B, 1, H, W), 0 where the truth is unknown; a square counts by its summed weight.
    """
    losses = []
    for side in LIGHT_SIDES:
        change = F.avg_pool2d((made - true) * weight, side)
        losses.append(change.abs().sum() / (3 * F.avg_pool2d(weight, side).sum()).clamp_min(1e-6))
    return torch.stack(losses).mean()


EXCESS_SIDES = (2, 4, 16)
"""Pixels a side of the squares of :func:`excess_error`: from fine edges to patches of a wall, as the shipped
weights were trained (assets/weights/README.md)."""


def excess_error(made: Tensor, filled: Tensor, true: Tensor, weight: Tensor) -> Tensor:
    """How much further than the filled picture's the mean colours of squares are from the truth; 0 where they are nearer.

    The mean of the measured colours of a square is an unbiased estimate, so a network may replace it only where it knows
    better.  made, filled, true: (B, 3, H, W).  weight: (B, 1, H, W), 0 where the truth is unknown.  Averaged over EXCESS_SIDES.
    """
    losses = []
    for side in EXCESS_SIDES:
        now = F.avg_pool2d((made - true) * weight, side).abs()
        before = F.avg_pool2d((filled - true) * weight, side).abs()
        losses.append(F.relu(now - before).sum() / (3 * F.avg_pool2d(weight, side).sum()).clamp_min(1e-6))
    return torch.stack(losses).mean()


class Objective(nn.Module):
    """``forward`` returns the loss and its terms.  ``name``: of the perceptual distance in use.

    perceptual_weight: of the perceptual distance; L1 has 1 minus it.  The other weights multiply their terms; 0 skips a term.
    """

    def __init__(self, perceptual_path: Path | None, perceptual_weight: float, coverage_weight: float, steady_weight: float,
                 structure_weight: float = 0.0, light_weight: float = 0.0, excess_weight: float = 0.0):
        super().__init__()
        self.light_weight, self.excess_weight = light_weight, excess_weight
        self.dissimilarity, self.structure_weight = Dissimilarity(), structure_weight
        self.distance, self.name = perceptual(perceptual_path)
        self.perceptual_weight = perceptual_weight if self.distance is not None else 0.0
        self.coverage_weight, self.steady_weight = coverage_weight, steady_weight

    def forward(self, made: Tensor, beside: Tensor, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """made: (B, 3 or 4, H, W), the network's pictures of ``batch.x``.  beside: (N, 3 or 4, H, W), those of
        ``batch.neighbour``."""
        colour = made[:, :3]
        weight = batch.coverage * batch.known
        l1 = ((colour - batch.colour).abs() * weight).sum() / (3 * weight.sum()).clamp_min(1)
        terms = {"l1": l1}
        loss = (1 - self.perceptual_weight) * l1
        if self.distance is not None and self.perceptual_weight:
            half = max(1, len(made) // 2)  # the distance takes longer than the network, so only half of the batch is compared
            shown = torch.where(weight[-half:] > 0.5, colour[-half:].clamp(0, 1), batch.colour[-half:])
            terms["distance"] = self.distance(shown, batch.colour[-half:])
            loss = loss + self.perceptual_weight * terms["distance"]
        if self.structure_weight:
            terms["dissimilarity"] = self.dissimilarity(
                torch.where(weight > 0.5, colour.clamp(0, 1), batch.colour).float(), batch.colour)
            loss = loss + self.structure_weight * terms["dissimilarity"]
        if self.light_weight:
            terms["light"] = local_light(colour.float(), batch.colour, weight)
            loss = loss + self.light_weight * terms["light"]
        if self.excess_weight:
            terms["excess"] = excess_error(colour.float(), batch.x[:, :3].float(), batch.colour, weight)
            loss = loss + self.excess_weight * terms["excess"]
        if made.shape[1] > 3 and self.coverage_weight:
            covered, true = made[:, 3:4], batch.coverage
            # The channel is clamped to 0..1 for display, so values beyond a true 0 or 1 are no error.
            wrong = torch.where(true >= 1, F.relu(1 - covered), torch.where(true <= 0, F.relu(covered), (covered - true).abs()))
            terms["coverage"] = (wrong * batch.known).mean()
            loss = loss + self.coverage_weight * terms["coverage"]
        if len(beside) and self.steady_weight:
            steady = inside_flow(batch.flow)
            change = (warp(beside[:, :3], batch.flow) - colour[: len(beside)]).abs() * steady
            terms["change"] = change.sum() / (3 * steady.sum()).clamp_min(1)
            loss = loss + self.steady_weight * terms["change"]
        return loss, terms
