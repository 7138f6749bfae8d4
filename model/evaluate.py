"""How good the pictures are: rooms with registered truth, at several densities, by every way of making a picture.

``raw``, ``pull-push`` (behind no filter, the paper's, ours and true visibility) and the networks on the same projected
points, in one table: PSNR, PSNR after one global gain, SSIM and the perceptual distance against the true views.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from model.data.pairs import project_scan
from model.data.spacing import median_spacing
from model.data.stations import ScanModel, Shot, load_scene, scan_stations
from model.depth_filter import keep_mask
from model.losses import perceptual
from model.metrics import psnr, psnr_after_gain, ssim
from model.project import Raster, SoftZ, network_input, rasterise
from model.weights import load_weights


@dataclass(frozen=True)
class Row:
    """Mean figures of one way of making a picture at one density."""

    method: str
    density: float
    psnr: float
    psnr_gain: float
    ssim: float
    distance: float
    kept: float
    leaked: float


def true_visibility(depth: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """(visible, hidden) masks of projected points against a true depth picture; pixels too close to call are in neither.

    A point is visible up to 1 % + 1 cm behind the farthest true depth of its 3x3 neighbourhood, hidden beyond 2 % + 3 cm.
    """
    known = torch.where(torch.isfinite(truth), truth, torch.full_like(truth, 1e4))[None, None]
    farthest = F.max_pool2d(F.pad(known, (1, 1, 1, 1), mode="replicate"), 3, 1)[0, 0]
    hit = torch.isfinite(depth)
    return hit & (depth <= farthest * 1.01 + 0.01), hit & (depth > farthest * 1.02 + 0.03)


Picture = Callable[[Raster, Tensor, float, float], Tensor]


def _network(path: Path) -> Picture:
    network, _ = load_weights(path)
    network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @torch.inference_mode()
    def make(raster: Raster, mask: Tensor, focal: float, spacing: float) -> Tensor:
        x = network_input(raster, mask, focal, spacing)[None].contiguous(memory_format=torch.channels_last)
        return network(x)[0, :3].clamp(0, 1)

    return make


def _filled(raster: Raster, mask: Tensor, focal: float, spacing: float) -> Tensor:
    return network_input(raster, mask, focal, spacing)[:3]


def evaluate(
    folder: Path, *, densities: tuple[float, ...] = (1.0, 0.1), weights: dict[str, Path] | None = None,
    distance_path: Path | None = None, views: int | None = None, seed: int = 11,
) -> dict:
    """Figures over a scene folder in the ``renders/`` form.

    weights: name -> file; a name that ends in ``unfiltered`` gets no filter.  views: how many, evenly chosen (None: all).
    Returns {"scene", "distance" (its name), "rows": [...]}, JSON-able.
    """
    scene = load_scene(folder)
    scan = scan_stations(scene, seed, ScanModel())
    pick = np.random.default_rng(0).choice(len(scan.xyz), min(len(scan.xyz), 2_000_000), replace=False)
    spacing_all = median_spacing(scan.xyz[pick]) * float(np.sqrt(len(pick) / len(scan.xyz)))
    distance, distance_name = perceptual(distance_path)
    networks = {name: _network(path) for name, path in (weights or {}).items()}
    shots = scene.views if views is None else [scene.views[i] for i in np.linspace(0, len(scene.views) - 1, views).astype(int)]
    figures: dict[tuple[str, float], list[tuple[float, ...]]] = {}
    for number, shot in enumerate(shots):
        seen = project_scan(scan, shot, seed=seed + number)
        truth = torch.from_numpy(shot.rgb().copy()).permute(2, 0, 1) / 255
        true_depth = torch.from_numpy(shot.depth())
        for density in densities:
            keep = seen.rank < density
            spacing = spacing_all / density**0.5
            raster = rasterise(
                seen.index[keep], seen.z[keep], seen.rgb[keep], shot.width, shot.height, SoftZ.preset("auto", spacing, 1.0)
            )
            visible, hidden = true_visibility(raster.depth, true_depth)
            masks = {
                "no filter": torch.isfinite(raster.depth),
                "paper's filter": keep_mask(raster.depth, "paper-code"),
                "our filter": keep_mask(raster.depth, "auto"),
                "true visibility": visible,
            }
            pictures: dict[str, tuple[Tensor, Tensor]] = {"raw": (raster.colour / 255, masks["no filter"])}
            for name, mask in masks.items():
                pictures[f"pull-push, {name}"] = _filled(raster, mask, shot.fl, spacing), mask
            for name, make in networks.items():
                mask = masks["no filter" if name.endswith("unfiltered") else "our filter"]
                pictures[f"network {name}"] = make(raster, mask, shot.fl, spacing), mask
            for name, (made, mask) in pictures.items():
                gap = float("nan")
                if distance is not None:
                    with torch.inference_mode():
                        gap = float(distance(made[None], truth[None]))
                figures.setdefault((name, density), []).append(
                    (
                        psnr(made, truth), psnr_after_gain(made, truth), ssim(made, truth), gap,
                        float((mask & visible).sum() / visible.sum().clamp_min(1)),
                        float((mask & hidden).sum() / (mask & (visible | hidden)).sum().clamp_min(1)),
                    )
                )
    rows = [Row(name, density, *np.mean(values, axis=0).tolist()) for (name, density), values in figures.items()]
    return {"scene": scene.name, "views": len(shots), "distance": distance_name, "rows": [vars(r) for r in rows]}


def format_table(result: dict) -> str:
    """The figures as text."""
    head = f"{'picture':34} {'points':>7} {'PSNR':>7} {'gain':>7} {'SSIM':>7} {'distance':>9} {'kept':>7} {'leaked':>7}"
    lines = [f"{result['scene']}, {result['views']} views; distance: {result['distance']}", head]
    for row in sorted(result["rows"], key=lambda r: (-r["density"], r["psnr"])):
        lines.append(
            f"{row['method']:34} {row['density']:7.0%} {row['psnr']:7.2f} {row['psnr_gain']:7.2f} {row['ssim']:7.3f} "
            f"{row['distance']:9.3f} {row['kept']:7.3f} {row['leaked']:7.3f}"
        )
    return "\n".join(lines)


def save(result: dict, path: Path) -> None:
    """Writes the figures as JSON."""
    path.write_text(json.dumps(result, indent=1))


__all__ = ["Row", "Shot", "evaluate", "format_table", "save", "true_visibility"]
