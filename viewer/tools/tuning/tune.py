"""Trains the shipped weights on what a scan offers, judges them by what was kept apart, and keeps them where they gained."""

import re
import tempfile
from pathlib import Path

import numpy as np
import torch

from model.common.folders import made_folder
from model.evaluation.metrics import masked_psnr
from model.train.trainer import TrainConfig, train
from model.weights import load_weights, save_weights, weights_dir, weights_name
from viewer.errors import InputError
from viewer.paths import weights_home
from viewer.tools.tuning.material import Judged, Material

RATE = 1e-4


@torch.inference_mode()
def mean_psnr(network: torch.nn.Module, judged: list[Judged]) -> float:
    """Mean PSNR over pictures, of the pixels that are known."""
    values = [masked_psnr(network(j.input.float()[None])[0, :3].clamp(0, 1), j.truth, j.known) for j in judged]
    return float(np.mean(values))


def material_of(path: Path, seed: int) -> Material:
    """The photographs inside an E57 where it has any with camera and pose, else points to withhold.  Says which.

    Raises InputError where photographs do not fit their points, or where points have no colours.
    """
    from viewer.tools.tuning.photographs import photographs_in, registered_photographs
    from viewer.tools.tuning.withheld import withheld_points

    photos, why = photographs_in(path)
    if photos:
        return registered_photographs(path, photos, seed)
    print(f"{why}: learning from points withheld at random", flush=True)
    return withheld_points(path, seed)


def tune(scan: Path, out: Path | None = None, *, quality: str = "balanced", minutes: float = 10.0,
         perceptual: Path | None = None, seed: int = 1, steps: int = 20_000, device: str = "auto") -> Path:  # fmt: skip
    """Trains the shipped weights on ``scan`` and writes ``NAME-QUALITY-filtered.safetensors``.

    out: folder for it (default: the one the viewer looks into).  Prints the PSNR of what was kept apart, before and after.
    Returns the weights to use: the new ones, or the shipped ones where tuning made nothing better, with a line that says so.
    Raises InputError where the scan offers nothing to learn from.
    """
    shipped = weights_dir() / f"{weights_name(quality, filtered=True)}.safetensors"
    if not shipped.is_file():
        raise InputError(f"no weights are shipped for quality {quality!r}; choose fast or balanced")
    if not (np.isfinite(minutes) and minutes > 0):
        raise InputError(f"--minutes {minutes:g}: more than 0 are needed")
    material = material_of(scan, seed)
    judged = material.judged()
    before = mean_psnr(load_weights(shipped)[0], judged)
    print(f"{material.learned} {material.noun} to learn from, {material.held} to judge; shipped weights: {before:.2f} dB",
          flush=True)
    out = weights_home() if out is None else out
    name = re.sub(r"[^\w.-]+", "_", scan.stem) or "scan"
    with made_folder(out), tempfile.TemporaryDirectory(".partial", f".tuning-{name}.", out) as work:
        folders = material.pairs(Path(work), name, seed)
        sides = [min(np.load(folder / "truth.npy", mmap_mode="r").shape[2:]) for folder, _ in folders]
        judge = str(perceptual) if perceptual and material.perceptual else None
        made = train(TrainConfig(
            pairs=tuple(str(folder) for folder, _ in folders), shares=tuple(float(n) for _, n in folders), out=work,
            quality=quality, steps=steps, minutes=minutes, rate=RATE, warmup=20, average=0.99, neighbours=0, device=device,
            recolour=False, crop=min(192, *(int(side) // 16 * 16 for side in sides)), seed=seed, start_from=str(shipped),
            perceptual_path=judge, perceptual_weight=0.1 if material.perceptual else 0.0,
            structure_weight=0.05 if material.perceptual else 0.0,
        ))  # fmt: skip
        network = load_weights(made)[0]
    after = mean_psnr(network, judged)
    print(f"held-out {material.noun}: {before:.2f} dB with the shipped weights, {after:.2f} dB tuned", flush=True)
    if not after > before:
        print(f"tuning made nothing better: the shipped weights are kept, nothing is written ({shipped})")
        return shipped
    target = out / f"{name}-{weights_name(quality, filtered=True)}.safetensors"
    notes = {"tuned_on": scan.name, material.noun: material.learned, "judged": material.held, "psnr_before": before,
             "psnr_after": after, "minutes": minutes, "seed": seed, "start_from": shipped.name}  # fmt: skip
    save_weights(target, network, quality, filtered=True, notes=notes)
    print(f"weights in {target}")
    return target
