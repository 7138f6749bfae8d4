"""What training minimises: L1, a perceptual distance, dissimilarity, coverage, and steadiness between neighbouring cameras.

L1 and the perceptual distance weigh as in the paper (0.9 and 0.1).  Dissimilarity is 1 - SSIM.  Coverage: the fourth channel
against the true share of each pixel that something covers.  Steadiness: the picture from a camera moved a little, brought back
along the true motion of every surface point, should be this picture; after Lai et al. 2018, with the motion known instead of
estimated.
"""

from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from model.data.crops import Batch
from model.perceptual import Dissimilarity, perceptual


def warp(picture: Tensor, flow: Tensor) -> Tensor:
    """``picture`` (N, C, H, W) sampled at each pixel's place plus ``flow`` (N, 2, H, W) pixels, bilinear; NaN flow as 0."""
    height, width = picture.shape[-2:]
    rows, columns = torch.meshgrid(
        torch.arange(height, device=flow.device), torch.arange(width, device=flow.device), indexing="ij"
    )
    flow = torch.nan_to_num(flow)
    x = (2 * (columns + flow[:, 0]) + 1) / width - 1
    y = (2 * (rows + flow[:, 1]) + 1) / height - 1
    return F.grid_sample(picture, torch.stack([x, y], -1).to(picture.dtype), align_corners=False, padding_mode="border")


def inside_flow(flow: Tensor) -> Tensor:
    """(N, 1, H, W) bool: pixels whose place in the neighbour is known and within the picture."""
    height, width = flow.shape[-2:]
    rows, columns = torch.meshgrid(
        torch.arange(height, device=flow.device), torch.arange(width, device=flow.device), indexing="ij"
    )
    x, y = columns + flow[:, 0], rows + flow[:, 1]  # NaN fails every comparison
    return ((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1))[:, None]


class Objective(nn.Module):
    """``forward`` gives the loss to minimise and its terms.  ``name``: the perceptual distance that is used."""

    def __init__(self, perceptual_path: Path | None, perceptual_weight: float, coverage_weight: float, steady_weight: float,
                 structure_weight: float = 0.0):
        super().__init__()
        self.dissimilarity, self.structure_weight = Dissimilarity(), structure_weight
        self.distance, self.name = perceptual(perceptual_path)
        self.perceptual_weight = perceptual_weight if self.distance is not None else 0.0
        self.coverage_weight, self.steady_weight = coverage_weight, steady_weight

    def forward(self, made: Tensor, beside: Tensor, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """made (B, 3 or 4, H, W); beside (N, 3 or 4, H, W): the network's pictures of ``batch.neighbour``."""
        colour = made[:, :3]
        weight = batch.coverage * batch.known
        l1 = ((colour - batch.colour).abs() * weight).sum() / (3 * weight.sum()).clamp_min(1)
        terms = {"l1": l1}
        loss = (1 - self.perceptual_weight) * l1
        if self.distance is not None and self.perceptual_weight:
            half = max(1, len(made) // 2)  # the distance costs more than the network: half of the batch is enough
            shown = torch.where(weight[-half:] > 0.5, colour[-half:].clamp(0, 1), batch.colour[-half:])
            terms["distance"] = self.distance(shown, batch.colour[-half:])
            loss = loss + self.perceptual_weight * terms["distance"]
        if self.structure_weight:
            terms["dissimilarity"] = self.dissimilarity(
                torch.where(weight > 0.5, colour.clamp(0, 1), batch.colour).float(), batch.colour)
            loss = loss + self.structure_weight * terms["dissimilarity"]
        if made.shape[1] > 3 and self.coverage_weight:
            covered, true = made[:, 3:4], batch.coverage
            # Beyond its bound the channel is clamped when shown, so there is nothing to mend there.
            wrong = torch.where(true >= 1, F.relu(1 - covered), torch.where(true <= 0, F.relu(covered), (covered - true).abs()))
            terms["coverage"] = (wrong * batch.known).mean()
            loss = loss + self.coverage_weight * terms["coverage"]
        if len(beside) and self.steady_weight:
            steady = inside_flow(batch.flow)
            change = (warp(beside[:, :3], batch.flow) - colour[: len(beside)]).abs() * steady
            terms["change"] = change.sum() / (3 * steady.sum()).clamp_min(1)
            loss = loss + self.steady_weight * terms["change"]
        return loss, terms
