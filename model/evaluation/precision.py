"""Comparison of the networks in half precision with fp32, with half-float input and output buffers
(:mod:`model.network.reconstruct`).

The same place is used in kilometres, metres and millimetres.  As depth and point spacing scale alike, the depth feature and the
picture should not change.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from ..data.surfaces.projected import Projected, picture
from ..network.reconstruct import PRECISIONS
from ..network.unet import CompactUNet
from ..network.weights import load_weights
from .metrics.image_metrics import psnr

SCALES = (1e-3, 1.0, 1e3)
"""File units per metre: kilometres, metres, millimetres."""


@dataclass(frozen=True)
class PrecisionInput:
    """x: (5, H, W) float32 network input.  truth: (3, H, W) in 0..1.  scale: file units per metre."""

    x: Tensor
    truth: Tensor
    scale: float


def scaled_input(seen: Projected, truth: Tensor, spacing: float, scale: float, *, filtered: bool) -> PrecisionInput:
    """Input of a view with the scan in other units.  seen: thinned, metres.  spacing: of the thinned scan, metres."""
    other = replace(seen, z=seen.z * torch.tensor(scale, dtype=seen.z.dtype))
    x = picture(other, torch.ones(len(seen.z), dtype=torch.bool), spacing * scale, "auto" if filtered else "off")
    return PrecisionInput(x, truth, scale)


@torch.inference_mode()
def _served(network: nn.Module, x: Tensor, precision: str) -> Tensor:
    """(3, H, W) float32 output before clamping, rounded to half-float as in the buffers; may contain NaN."""
    x = x.half()[None]
    x = x.float() if isinstance(network, CompactUNet) else x.to(PRECISIONS[precision])
    return network(x.contiguous(memory_format=torch.channels_last))[0, :3].half().float()


def precision_table(weights: Path, inputs: Sequence[PrecisionInput]) -> list[dict]:
    """Compares each precision at each scale with fp32 on unrounded input.

    Returns rows: method (stem of the file), precision, scale, largest and percentile (99.9 %, mean over the inputs) absolute
    difference of the clamped pictures without NaN, psnr against the truth (mean, dB), nan (number of values).  Raises
    WeightsError.
    """
    exact, _ = load_weights(weights)
    with torch.inference_mode():
        references = [exact(entry.x[None])[0, :3].clamp(0, 1) for entry in inputs]
    rows = []
    for precision, dtype in PRECISIONS.items():
        network = load_weights(weights)[0].to(dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        found: dict[float, list[tuple[float, float, float, int]]] = {}
        for entry, reference in zip(inputs, references, strict=True):
            raw = _served(network, entry.x, precision)
            made = torch.nan_to_num(raw, nan=0.0).clamp(0, 1)
            gap = (made - reference).abs()[~raw.isnan()].numpy()
            largest, percentile = (gap.max(), np.percentile(gap, 99.9)) if len(gap) else (np.nan, np.nan)
            found.setdefault(entry.scale, []).append(
                (float(largest), float(percentile), psnr(made, entry.truth), int(raw.isnan().sum()))
            )
        for scale, values in sorted(found.items()):
            gaps, percentiles, decibels, nan = zip(*values, strict=True)
            rows.append({
                "method": weights.stem, "precision": precision, "scale": scale, "largest": float(np.max(gaps)),
                "percentile": float(np.mean(percentiles)), "psnr": float(np.mean(decibels)), "nan": sum(nan),
            })
    return rows


def precision_of_scene(folder: Path, weights: Sequence[Path], densities: Sequence[float], seed: int = 11) -> list[dict]:
    """:func:`precision_table` of each weights file on the first view of a scene, at each density and scale."""
    from ..data.stations import load_scene, scan_stations
    from ..data.surfaces.projected import project_scan, scan_spacing
    from .methods import thinned
    from .room_scores import pick_views, truth_of

    filtered = {path: load_weights(path)[1].get("input") != "unfiltered" for path in weights}
    scene = load_scene(folder)
    shot = pick_views(scene, 1)[0]
    scan = scan_stations(scene, seed)
    seen, spacing, truth = project_scan(scan, shot, seed), scan_spacing(scan), truth_of(shot)
    left = [(thinned(seen, density), spacing / density**0.5) for density in densities]
    rows = []
    for path in weights:
        rows += precision_table(path, [
            scaled_input(part, truth, apart, scale, filtered=filtered[path]) for part, apart in left for scale in SCALES
        ])
    return rows
