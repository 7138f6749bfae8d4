"""Fine-tunes the shipped weights on a scan, evaluates them on held-out data, and keeps them if they are better."""

from pathlib import Path

import numpy as np
import torch

from ....model.common.files.folders import made_folder
from ....model.common.files.temporary import temporary_folder
from ....model.evaluation.metrics.image_metrics import masked_psnr
from ....model.network.qualities import DEFAULT
from ....model.network.weights import load_weights, save_weights
from ....model.network.weights_folder import shipped_qualities, weights_file, weights_name
from ....model.train.trainer import TrainConfig, train
from ...common.errors import InputError
from ...common.file_names import safe_name
from ...common.paths import weights_home
from ...common.replaced_files import replaced_told
from .material import HeldOutPicture, Material

RATE = 1e-4
"""Learning rate: a fifth of that of the recipe's last stages (model.train.recipes), from which the weights come."""


@torch.inference_mode()
def mean_psnr(network: torch.nn.Module, held_out: list[HeldOutPicture]) -> float:
    """Mean over pictures of the PSNR, dB, over known pixels."""
    values = [masked_psnr(network(j.input.float()[None])[0, :3].clamp(0, 1), j.truth, j.known) for j in held_out]
    return float(np.mean(values))


def material_of(path: Path, seed: int) -> Material:
    """The photographs in an E57 with camera and pose; without any, prints the reason and returns withheld points.

    Raises InputError if the photographs do not fit the points, or if the points have no colours.
    """
    from .photographs import photographs_in, registered_photographs
    from .withheld import withheld_points

    photos, why = photographs_in(path)
    if photos:
        return registered_photographs(path, photos, seed)
    print(f"{why}: learning from points withheld at random", flush=True)
    return withheld_points(path, seed)


def tune(scan: Path, out: Path | None = None, *, quality: str = DEFAULT, minutes: float = 10.0,
         perceptual: Path | None = None, seed: int = 1, steps: int = 20_000, device: str = "auto") -> Path:  # fmt: skip
    """Fine-tunes the shipped weights on ``scan`` and writes ``NAME-QUALITY-filtered.safetensors``.

    out: folder of the file (default: the folder that the viewer searches).  minutes: time limit of the training.
    Prints the held-out PSNR before and after.  Returns the path of the new weights, or of the shipped ones if they are not
    worse.  Raises InputError if the scan has no usable data.
    """
    shipped = weights_file(quality, filtered=True)
    if not shipped.is_file():
        there = " or ".join(shipped_qualities(trainable=True))
        raise InputError(f"no weights are shipped for quality {quality!r}", remedy=f"choose {there}")
    if not (np.isfinite(minutes) and minutes > 0):
        raise InputError(f"--minutes {minutes:g}: expected more than 0")
    material = material_of(scan, seed)
    held_out = material.held_out_pictures()
    before = mean_psnr(load_weights(shipped)[0], held_out)
    print(f"{material.learned} {material.noun} to learn from, {material.held} held out; shipped weights: {before:.2f} dB",
          flush=True)
    out = weights_home() if out is None else out
    name = safe_name(scan.stem, "scan")
    with made_folder(out), temporary_folder(out / f"tuning-{name}") as work:
        folders = material.pairs(work, name, seed)
        sides = [min(np.load(folder / "truth.npy", mmap_mode="r").shape[2:]) for folder, _ in folders]
        judge = str(perceptual) if perceptual and material.perceptual else None
        made = train(TrainConfig(
            pairs=tuple(str(folder) for folder, _ in folders), shares=tuple(float(n) for _, n in folders), out=str(work),
            quality=quality, steps=steps, minutes=minutes, rate=RATE, warmup=20, average=0.99, neighbours=0, device=device,
            recolour=False, crop=min(192, *(int(side) // 16 * 16 for side in sides)), seed=seed, start_from=str(shipped),
            perceptual_path=judge, perceptual_weight=0.1 if material.perceptual else 0.0,
            structure_weight=0.05 if material.perceptual else 0.0,
        ))  # fmt: skip
        network = load_weights(made)[0]
    after = mean_psnr(network, held_out)
    print(f"held-out {material.noun}: {before:.2f} dB with the shipped weights, {after:.2f} dB tuned", flush=True)
    if not after > before:
        print(f"no improvement: the shipped weights are kept, nothing is written ({shipped})")
        return shipped
    target = out / f"{name}-{weights_name(quality, filtered=True)}.safetensors"
    notes = {"tuned_on": scan.name, material.noun: material.learned, "judged": material.held, "psnr_before": before,
             "psnr_after": after, "minutes": minutes, "seed": seed, "start_from": shipped.name}  # fmt: skip
    with replaced_told([target]):
        save_weights(target, network, quality, filtered=True, notes=notes)
    print(f"weights in {target}")
    return target
