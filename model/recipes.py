"""Whole trainings by one command: the most of one CUDA GPU in 25 minutes, or of two CPU cores in a night.

A recipe makes procedural places (and pairs of the folders it is given) on all cores until its share of the time is spent,
then trains one network after the other, each for its share, and last judges them on a validation scene.  No OpenGL is
needed, and nothing but ``model/`` and the libraries it imports has to be carried to the machine: under 1 MB of code.
Stopped at any moment, the same command goes on where it was.
"""

import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from model.processors import usable_processors
from model.train import TrainConfig, train
from model.weights import weights_name


@dataclass(frozen=True)
class Stage:
    """One network of a recipe.  share: of the recipe's time.  after: weights of an earlier stage to go on from."""

    quality: str
    filtered: bool
    share: float
    after: str | None = None
    rate: float = 1e-3
    batch: int = 8
    crop: int = 192


@dataclass(frozen=True)
class Recipe:
    """minutes: in all.  data_share: of them, for making places and pairs; the stages' shares add up to the rest."""

    minutes: float
    data_share: float
    stages: tuple[Stage, ...]


RECIPES = {
    # The 31M network first: what can be learned from this data at all is the scale for the small ones.
    "gpu": Recipe(25.0, 0.20, (
        Stage("paper", True, 0.22, batch=16, crop=256, rate=5e-4),
        Stage("balanced", True, 0.20, batch=32, crop=256),
        Stage("best", True, 0.16, after="balanced-filtered", batch=32, crop=256),
        Stage("fast", True, 0.10, batch=32, crop=256),
        Stage("balanced", False, 0.05, after="balanced-filtered", batch=32, crop=256, rate=5e-4),
        Stage("best", False, 0.04, after="best-filtered", batch=32, crop=256, rate=5e-4),
        Stage("fast", False, 0.03, after="fast-filtered", batch=32, crop=256, rate=5e-4),
    )),
    "night": Recipe(600.0, 0.15, (
        Stage("balanced", True, 0.33),
        Stage("best", True, 0.25, after="balanced-filtered"),
        Stage("fast", True, 0.12),
        Stage("balanced", False, 0.06, after="balanced-filtered", rate=5e-4),
        Stage("best", False, 0.06, after="best-filtered", rate=5e-4),
        Stage("fast", False, 0.03, after="fast-filtered", rate=5e-4),
    )),
}


def follow(recipe: Recipe, folders: Sequence[Path], out: Path, *, minutes: float, perceptual: Path | None,
           validation: Path | None = None, seed: int = 1, device: str = "auto", most_places: int = 4096) -> list[Path]:
    """Follows a recipe into ``out``; returns the weights, in the order of its stages.

    folders: data to learn from besides the procedural places.  minutes: in all.  most_places: procedural ones.
    Raises DataError where a folder cannot be used, before anything is made.
    """
    from model.data.sources import open_places

    open_places(folders)  # refused now, not after the places are made
    out.mkdir(parents=True, exist_ok=True)
    pairs = make_pairs(recipe, folders, out / "pairs", minutes * 60 * recipe.data_share, seed, most_places)
    made: dict[str, Path] = {}
    for stage in recipe.stages:
        name = weights_name(stage.quality, filtered=stage.filtered)
        after = str(made[stage.after]) if stage.after else None
        kind = "filtered" if stage.filtered else "unfiltered"
        print(f"{name}: {minutes * stage.share:.1f} minutes on {len(pairs[kind])} folders of pairs", flush=True)
        made[name] = train(TrainConfig(
            pairs=tuple(map(str, pairs[kind])), out=str(out / name), quality=stage.quality, filtered=stage.filtered,
            steps=10**9, minutes=minutes * stage.share, batch=stage.batch, neighbours=stage.batch // 4, crop=stage.crop,
            rate=stage.rate, seed=seed, device=device, start_from=after,
            perceptual_path=str(perceptual) if perceptual else None,
        ))
    if validation is not None:
        _judge(validation, made, out, perceptual)
    return list(made.values())


def make_pairs(recipe: Recipe, folders: Sequence[Path], out: Path, seconds: float, seed: int,
               most_places: int) -> dict[str, list[Path]]:
    """Pairs of the given folders and of as many procedural places as the time allows, on all cores.

    Returns the folders of pairs for filtered and for unfiltered input.  What an earlier call made is kept.
    """
    kinds = sorted({stage.filtered for stage in recipe.stages}, reverse=True)
    workers = usable_processors()
    end = time.monotonic() + seconds
    jobs: list[tuple] = [("folder", str(folder)) for folder in folders]
    with ProcessPoolExecutor(workers) as pool:
        waiting = {pool.submit(_make, job, str(out), kinds, seed) for job in jobs}
        number = 0
        while waiting or (number < most_places and time.monotonic() < end):
            while len(waiting) < workers and number < most_places and time.monotonic() < end:
                waiting.add(pool.submit(_make, ("place", number), str(out), kinds, seed))
                number += 1
            done = next(as_completed(waiting))
            waiting.remove(done)
            print(f"pairs: {done.result()}", flush=True)
    return {
        "filtered" if filtered else "unfiltered": sorted((out / ("filtered" if filtered else "unfiltered")).glob("*[0-9]"))
        for filtered in kinds
    }


def _make(job: tuple, out: str, kinds: list[bool], seed: int) -> str:
    """One place's or folder's pairs, in a process of its own.  Returns its name."""
    import torch

    from model.data.pairs import build, by_size
    from model.data.procedural import procedural_place
    from model.data.sources import open_places

    torch.set_num_threads(1)
    source, what = job
    name = f"place-{what}" if source == "place" else f"folder-{Path(what).name}"
    wanted = [
        (filtered, reduce, Path(out) / ("filtered" if filtered else "unfiltered") / f"{name}-{reduce}")
        for filtered in kinds for reduce in ((1, 2) if filtered else (1,))
    ]
    if all(folder.is_dir() for *_, folder in wanted):
        return f"{name} (kept)"
    places = [procedural_place(seed * 100_000 + what)] if source == "place" else open_places([Path(what)])
    for filtered, reduce, folder in wanted:
        for alike in by_size(places)[:1]:
            if not folder.is_dir():
                folder.parent.mkdir(parents=True, exist_ok=True)
                build(alike, folder, seed=seed, scans=2, variants=2 if filtered else 1,
                      preset="auto" if filtered else "off", reduce=reduce, neighbours=reduce == 2)
    return name


def _judge(validation: Path, made: dict[str, Path], out: Path, perceptual: Path | None) -> None:
    from model.evaluation import evaluate, format_table

    result = evaluate(validation, weights=made, distance_path=perceptual)
    print(format_table(result), flush=True)
    (out / "validation.json").write_text(json.dumps(result, indent=1))
