"""Recipes: all networks trained by one command, in 25 minutes of one CUDA GPU or in a night of two CPU cores.

A recipe makes training pairs of the given folders and of procedural places on all cores until its share of the time is spent.
It then trains one network after the other, each for its share of the time, and evaluates them on a validation scene.  It needs
no OpenGL, and nothing but ``model/`` and the libraries that it imports: less than 1 MB of code.  Interrupted at any moment, the
same command continues: ``recipe.json`` stores the facts, the seconds spent on pairs and, once they are complete, the list of
pairs, which then stays fixed.
"""

import contextlib
import time
import zlib
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path

from ..common.errors import DataError
from ..common.files.folders import made_folder
from ..common.files.json_file import write_json
from ..common.process.interrupts import run_in_worker, workers
from ..common.process.processors import usable_processors, use_threads
from ..common.process.signals import cleaned
from ..data.crops import PairFolder
from ..data.dataset import MIN_CROP
from ..data.procedural import procedural_place
from ..network.weights_folder import weights_name
from .manifest import Facts, read_manifest, refuse_other, whereabouts
from .trainer import TrainConfig, train


@dataclass(frozen=True)
class Stage:
    """One network of a recipe.  share: of the recipe's time.  after: name of an earlier stage whose weights it starts from."""

    quality: str
    filtered: bool
    share: float
    after: str | None = None
    rate: float = 1e-3
    batch: int = 8
    crop: int = 192

    @property
    def name(self) -> str:
        """Name of its weights."""
        return weights_name(self.quality, filtered=self.filtered)


@dataclass(frozen=True)
class Recipe:
    """minutes: total time.  data_share: share of it for making pairs; the stages' shares add up to the rest."""

    minutes: float
    data_share: float
    stages: tuple[Stage, ...]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of input of its networks: "filtered", "unfiltered"."""
        return tuple(sorted({_kind(stage) for stage in self.stages}))


def _kind(stage: Stage) -> str:
    return "filtered" if stage.filtered else "unfiltered"


RECIPES = {
    # The paper's network of 31M parameters first: it shows what can be learned from this data.
    "gpu": Recipe(25.0, 0.20, (
        Stage("paper", True, 0.22, batch=16, crop=256, rate=5e-4),
        Stage("balanced", True, 0.34, batch=32, crop=256),
        Stage("fast", True, 0.13, batch=32, crop=256),
        Stage("balanced", False, 0.07, after="balanced-filtered", batch=32, crop=256, rate=5e-4),
        Stage("fast", False, 0.04, after="fast-filtered", batch=32, crop=256, rate=5e-4),
    )),
    "night": Recipe(600.0, 0.15, (
        Stage("balanced", True, 0.50),
        Stage("fast", True, 0.20),
        Stage("balanced", False, 0.10, after="balanced-filtered", rate=5e-4),
        Stage("fast", False, 0.05, after="fast-filtered", rate=5e-4),
    )),
}


def follow(recipe: Recipe, folders: Sequence[Path], out: Path, *, minutes: float, perceptual: Path | None,
           validation: Path | None = None, seed: int = 1, device: str = "auto", most_places: int = 4096,
           textures: Path | None = None) -> list[Path]:
    """Runs a recipe in the folder ``out``; returns the paths of the weights, in the order of its stages.

    folders: training data besides the procedural places.  minutes: total time.  most_places: limit of procedural places.
    textures: folder of texture sheets.  validation: scene to evaluate the weights on.
    Raises DataError where a folder cannot be used, or ``out`` holds another training, before anything is written.
    """
    name = next((name for name, known in RECIPES.items() if known == recipe), "of its own")
    facts: Facts = {"recipe": name, **whereabouts(out, folders), "seed": seed, "perceptual": "given" if perceptual else "none",
                    "textures": None if textures is None else textures.resolve().name}
    sources = (*facts["folders"], "procedural places")
    pairs = make_pairs(recipe, folders, out, facts, minutes * 60 * recipe.data_share, most_places, textures)
    made: dict[str, Path] = {}
    for stage in recipe.stages:
        mine = pairs[_kind(stage)]
        print(f"{stage.name}: {minutes * stage.share:.1f} minutes on {len(mine)} folders of pairs", flush=True)
        made[stage.name] = train(TrainConfig(
            pairs=tuple(map(str, mine)), out=str(out), quality=stage.quality, filtered=stage.filtered,
            steps=10**9, minutes=minutes * stage.share, batch=stage.batch, neighbours=stage.batch // 4, crop=_crop(stage, mine),
            rate=stage.rate, seed=seed, device=device, start_from=str(made[stage.after]) if stage.after else None,
            perceptual_path=str(perceptual) if perceptual else None, sources=sources,
        ))
    if validation is not None:
        _judge(validation, made, out, perceptual)
    return list(made.values())


def _crop(stage: Stage, pairs: Sequence[Path]) -> int:
    """Side of the stage's crops: the recipe's, or a smaller multiple of 16 that fits into all pictures."""
    sides = [min(PairFolder(folder).measured.shape[2:]) for folder in pairs]
    return min(stage.crop, max(MIN_CROP, min(sides) // 16 * 16))


@dataclass(frozen=True)
class _Job:
    """Pairs to be made by one process.

    name: prefix of their folders.  folder, group: a data folder and the index of one of its picture sizes; without a folder,
    ``number`` identifies a procedural place.
    """

    name: str
    folder: str = ""
    group: int = 0
    number: int = 0

    @property
    def kind(self) -> str:
        """Kind of place, by which durations are recorded."""
        return self.name if self.folder else procedural_place(self.number).kind

    def seed(self, seed: int) -> int:
        """Seed of its pairs.  A common seed would remove the same patches and stations at the same densities everywhere."""
        return seed * 100_000 + zlib.crc32(self.name.encode()) % 100_000

    def targets(self, out: Path, kinds: Sequence[str]) -> list[tuple[str, int, Path]]:
        """(kind of input, reduction, folder) of all pairs to be made."""
        return [(kind, reduce, out / "pairs" / kind / f"{self.name}-{reduce}")
                for kind in kinds for reduce in ((1, 2) if kind == "filtered" else (1,))]

    def done(self, out: Path, kinds: Sequence[str]) -> bool:
        return all(folder.is_dir() for *_, folder in self.targets(out, kinds))


def make_pairs(recipe: Recipe, folders: Sequence[Path], out: Path, facts: Facts, seconds: float,
               most_places: int, textures: Path | None = None) -> dict[str, list[Path]]:
    """Makes pairs of the given folders and of as many procedural places as fit in the time, on all cores.

    facts: of the recipe.  seconds: for all calls together.  Returns the folders of pairs for each kind of input.  Pairs of
    earlier calls are kept, and once an earlier call has completed the list, nothing is added.
    """
    manifest = out / "recipe.json"
    kept = read_manifest(manifest, "pairs", "seconds", "made_from")
    if kept is not None and (kept["pairs"] or _made(out, recipe)):  # a manifest without pairs binds nothing
        refuse_other(out, "its pairs were", kept["made_from"], facts)
    else:
        _refuse_others(out, recipe)
        kept = {"pairs": None, "seconds": 0.0, "made_from": facts}
    progress = _Progress(manifest, kept)
    if not kept["pairs"]:
        jobs = _folder_jobs(folders)  # refuses bad folders before places are made
        with contextlib.ExitStack() as stack:
            for kind in recipe.kinds:
                stack.enter_context(made_folder(out / "pairs" / kind))

            def keep() -> None:
                if _made(out, recipe):
                    progress.keep()
                else:
                    manifest.unlink(missing_ok=True)

            with cleaned(keep):
                progress.keep()
                _make_all(jobs, out, recipe, facts["seed"], progress, seconds, most_places,
                          None if textures is None else str(textures))
            kept["pairs"] = _listed(out, recipe)
    progress.keep()
    return {kind: [out / "pairs" / kind / name for name in names] for kind, names in kept["pairs"].items()}


def _refuse_others(out: Path, recipe: Recipe) -> None:
    """Raises DataError where a folder without a manifest contains another training."""
    if any(out.glob("pairs-*filtered.*")):
        raise DataError("contains a training without --recipe", file=out, remedy="choose another --out")
    checkpoints = (folder / "checkpoint.pt" for folder in (out, *(out / stage.name for stage in recipe.stages)))
    for made in (*_made(out, recipe), *checkpoints):
        if made.exists():
            raise DataError("was not made by this recipe", file=made, remedy="choose another --out")


class _Progress:
    """Seconds spent on pairs in all calls together, the longest duration of each kind of place, and their manifest."""

    def __init__(self, path: Path, kept: Facts):
        self.path, self.kept = path, kept
        self.start = time.monotonic() - kept["seconds"]
        self.most: dict[str, float] = kept.setdefault("most", {})

    def spent(self) -> float:
        return time.monotonic() - self.start

    def done(self, kind: str, begun: float) -> None:
        """Records a finished place.  begun: :meth:`spent` when it began."""
        self.most[kind] = round(max(self.most.get(kind, 0.0), self.spent() - begun), 1)

    def in_time(self, kind: str, seconds: float) -> bool:
        """Whether a place begun now is expected to finish before ``seconds``; a kind not yet timed is assumed to take half."""
        return self.spent() + self.most.get(kind, seconds / 2) <= seconds

    def keep(self) -> None:
        """Writes the manifest.  The time stops once the pairs are listed."""
        if not self.kept["pairs"]:
            self.kept["seconds"] = round(self.spent(), 1)
        write_json(self.path, self.kept)


def _make_all(jobs: list[_Job], out: Path, recipe: Recipe, seed: int, progress: _Progress, seconds: float,
              most_places: int, textures: str | None) -> None:
    """Runs the jobs, then procedural places that an earlier call began, then new ones as long as they finish in time."""
    begun = {path.name.rsplit("-", 1)[0] for path in _made(out, recipe)}
    places = [_Job(f"place-{number}", number=number) for number in range(most_places)]
    ready = [job for job in (*jobs, *(place for place in places if place.name in begun)) if not job.done(out, recipe.kinds)]
    # A place that does not fit in the time now will not fit later, so a generator that skips it is enough.
    new = (place for place in places if place.name not in begun and progress.in_time(place.kind, seconds))
    count, waiting = usable_processors(), dict[Future[str], tuple[str, float]]()
    with workers(count) as pool:
        while True:
            while len(waiting) < count and (job := ready.pop(0) if ready else next(new, None)) is not None:
                spent = progress.spent()
                waiting[pool.submit(run_in_worker, _make, job, str(out), recipe.kinds, seed, textures)] = job.kind, spent
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                progress.done(*waiting.pop(future))
                print(f"pairs: {future.result()}", flush=True)
            progress.keep()


def _made(out: Path, recipe: Recipe) -> list[Path]:
    """All folders of pairs that exist."""
    return sorted(path for kind in recipe.kinds for path in (out / "pairs" / kind).glob("*[0-9]") if path.is_dir())


def _listed(out: Path, recipe: Recipe) -> dict[str, list[str]]:
    return {kind: [path.name for path in _made(out, recipe) if path.parent.name == kind] for kind in recipe.kinds}


def _folder_jobs(folders: Sequence[Path]) -> list[_Job]:
    """One job for every folder and picture size in it.  Raises DataError where a folder cannot be used."""
    from ..data.pairs import by_size
    from ..data.sources import open_places

    jobs: list[_Job] = []
    for index, folder in enumerate(folders):
        for group in range(len(by_size(open_places([folder])))):
            name = folder.name or folder.resolve().name
            taken = group > 0 or any(job.name == f"folder-{name}" for job in jobs)
            jobs.append(_Job(f"folder{index}.{group}-{name}" if taken else f"folder-{name}", str(folder), group))
    return jobs


def _make(job: _Job, out: str, kinds: Sequence[str], seed: int, textures: str | None) -> str:
    """Makes the pairs of a job, in a worker process.  Returns the job's name."""
    import torch

    from ..data.pairs import build, by_size
    from ..data.sources import open_places
    from ..data.surfaces.cutout import with_cut_outs
    from ..data.surfaces.painting import load_textures

    torch.set_num_threads(1)
    use_threads(1)
    if job.folder:
        places = by_size(open_places([Path(job.folder)]))[job.group]
    else:
        places = [procedural_place(seed * 100_000 + job.number)]
    paint = load_textures(Path(textures)) if textures is not None else []
    for kind, reduce, folder in job.targets(Path(out), kinds):
        if not folder.is_dir():
            filtered = kind == "filtered"
            build(with_cut_outs(places, seed) if reduce == 1 else places, folder, seed=job.seed(seed), scans=2,
                  variants=2 if filtered else 1, preset="auto" if filtered else "off", reduce=reduce, neighbours=reduce == 2,
                  textures=paint)
    return job.name


def _judge(validation: Path, made: dict[str, Path], out: Path, perceptual: Path | None) -> None:
    from ..evaluation.report import format_table
    from ..evaluation.room_scores import evaluate

    result = evaluate(validation, weights=made, distance_path=perceptual)
    print(format_table(result), flush=True)
    write_json(out / "validation.json", result)
