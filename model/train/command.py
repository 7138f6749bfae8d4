"""The command line's part of training: what ``pointglass train`` takes, and doing it.  Importing this loads nothing heavy.

Runs alone, or as ``torchrun --nproc-per-node N -m viewer train ...``: the first process makes the pairs, the others wait.
"""

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.common.seeds import MOST_SEED
from model.common.signals import importing
from model.data.dataset import LEAST_CROP

if TYPE_CHECKING:
    from model.data.dataset import TruePlace
    from model.train.manifest import Facts

"""Pixels: of smaller crops the textures laid over them cannot be made, and a network learns nothing from them."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options :func:`run` reads."""
    parser.add_argument("data", nargs="*", type=Path, metavar="FOLDER",
                        help="folders with scene.json, of ScanNet++, or of RGB-D frames with poses")
    parser.add_argument("--out", type=Path, metavar="DIR",
                        help="pairs, checkpoint and weights; resumes there (--tune: where weights go, if not to the viewer)")
    parser.add_argument("--procedural", type=int, default=0, metavar="N",
                        help="also N places made up, of every kind in turn (default 0)")
    parser.add_argument("--recipe", choices=["gpu", "night"],
                        help="gpu: the most of one CUDA GPU in 25 minutes; night: of two CPU cores in 10 hours")
    parser.add_argument("--quality", default="balanced", choices=["fast", "balanced", "paper"],
                        help="which network (default balanced)")
    parser.add_argument("--unfiltered", action="store_true", help="for `--filter off`")
    parser.add_argument("--minutes", type=float, metavar="M",
                        help="of training (default 60; with --recipe, of everything: 25 or 600)")
    parser.add_argument("--steps", type=int, default=40_000, metavar="N", help="at most (default 40000)")
    parser.add_argument("--batch", type=int, default=8, metavar="N", help="crops a step and process (default 8)")
    parser.add_argument("--crop", type=int, default=192, metavar="PIXELS",
                        help=f"side of a crop, {LEAST_CROP} or more (default 192)")
    parser.add_argument("--rate", type=float, default=1e-3, metavar="X", help="learning rate (default 0.001)")
    parser.add_argument("--perceptual", type=Path, metavar="DIR", help="weights of the SqueezeNet distance")
    parser.add_argument("--textures", type=Path, metavar="DIR",
                        help="thumbnail sheets of photographic textures (ambientCG's, *.webp), painted onto half of the pairs")
    parser.add_argument("--validation", type=Path, metavar="FOLDER", help="with --recipe: a scene to judge the weights on")
    parser.add_argument("--start-from", type=Path, metavar="F", help="weights to go on from")
    parser.add_argument("--device", default="auto", choices=["auto", "cuda", "cpu"],
                        help="auto: CUDA where it works, else CPU (default auto)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of crops and places made up (default 1)")


def run(options: argparse.Namespace) -> int:
    """Makes the pairs where they are not there yet, trains, prints where the weights are.  Returns 0.

    Raises DataError where data is missing, unreadable or does not fit, before anything is made.
    """
    from model.data.dataset import DataError

    if options.out is None:
        raise DataError("--out DIR is needed: pairs, checkpoint and weights go there")
    check(options)
    if options.recipe:
        from model.train.recipes import RECIPES, follow

        recipe = RECIPES[options.recipe]
        follow(recipe, options.data, options.out, minutes=recipe.minutes if options.minutes is None else options.minutes,
               perceptual=options.perceptual, validation=options.validation, seed=options.seed, device=options.device,
               textures=options.textures)
        return 0
    if not options.data and not options.procedural:
        raise DataError("nothing to learn from: give folders with scene.json, or --procedural N")
    if any((options.out / name).exists() for name in ("recipe.json", "pairs/filtered", "pairs/unfiltered")):
        raise DataError(f"{options.out}: holds what --recipe made; choose another --out")
    with importing():
        from model.train.trainer import TrainConfig, train

    facts = _facts(options)
    path = train(TrainConfig(
        pairs=tuple(map(str, _pairs(options, facts))), sources=_sources(options), out=str(options.out), quality=options.quality,
        filtered=not options.unfiltered, steps=options.steps,
        minutes=60.0 if options.minutes is None else options.minutes, batch=options.batch,
        crop=options.crop, rate=options.rate, seed=options.seed, device=options.device,
        perceptual_path=str(options.perceptual) if options.perceptual else None,
        start_from=str(options.start_from) if options.start_from else None,
    ))
    if int(os.environ.get("RANK", 0)) == 0:
        print(f"weights in {path}")
    return 0


_NO_USE_FOR = {
    "": ("validation",),
    "--recipe": ("procedural", "quality", "unfiltered", "steps", "batch", "crop", "rate", "start_from"),
    "--tune": ("data", "procedural", "recipe", "unfiltered", "steps", "batch", "crop", "rate", "validation", "start_from",
               "textures"),
}
"""What each way of training, "" being neither of the two others, has no use for."""


def _way(options: argparse.Namespace) -> str:
    """A key of _NO_USE_FOR.  ``--tune`` is the viewer's own, as what it learns from is."""
    return "--tune" if getattr(options, "tune", None) is not None else "--recipe" if options.recipe else ""


def unused(options: argparse.Namespace) -> list[str]:
    """The options given that this way of training has no use for, as a person gave them."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    said = []
    for name in _NO_USE_FOR[_way(options)]:
        value: Any = getattr(options, name)
        if name == "data":
            said += map(str, value)
        elif value != parser.get_default(name):
            said.append(f"--{name.replace('_', '-')}" + ("" if value is True else f" {value}"))
    return said


def check(options: argparse.Namespace) -> None:
    """Raises DataError naming the first option that cannot be followed; to be asked before minutes of work.

    Says which of the others are left out of account.
    """
    from model.data.dataset import DataError

    way = _way(options)
    if way and int(os.environ.get("WORLD_SIZE", 1)) > 1:
        raise DataError(f"{way} trains in one process, not in {os.environ['WORLD_SIZE']}; start it without torchrun")
    if way and options.minutes == 0:
        raise DataError(f"--minutes 0: more than 0 minutes are needed with {way}")
    for name, least in (("procedural", 0), ("steps", 1), ("batch", 1), ("crop", LEAST_CROP), ("seed", 0)):
        if (value := getattr(options, name)) < least:
            raise DataError(f"--{name} {value}: expected at least {least}")
    if options.seed > MOST_SEED:
        raise DataError(f"--seed {options.seed}: expected at most {MOST_SEED}")
    if not (math.isfinite(options.rate) and options.rate > 0):
        raise DataError(f"--rate {options.rate:g}: expected a learning rate above 0, such as 0.001")
    if options.minutes is not None and not (math.isfinite(options.minutes) and options.minutes >= 0):
        raise DataError(f"--minutes {options.minutes:g}: expected a number of minutes, 0 to go by --steps alone")
    if options.out is not None and options.out.exists() and not options.out.is_dir():
        raise DataError(f"--out {options.out}: is a file; give a folder")
    if options.textures is not None:
        from model.data.painting import load_textures

        load_textures(options.textures)
    if options.perceptual is not None:
        from model.perceptual import SQUEEZE_FILES

        for name in SQUEEZE_FILES:
            if not (options.perceptual / name).is_file():
                raise DataError(f"--perceptual {options.perceptual}: holds no {name}; give the folder with "
                                f"{' and '.join(SQUEEZE_FILES)}, or leave the option out")
    if options.start_from is not None and "start_from" not in _NO_USE_FOR[way]:
        _check_start(options.start_from, options.quality)
    if options.device == "cuda":
        from model.reconstruct import cuda_problem

        if problem := cuda_problem():
            raise DataError(f"--device cuda: {problem}; see `pointglass doctor`, or use --device cpu")
    if (ignored := unused(options)) and int(os.environ.get("RANK", 0)) == 0:
        command = f"train {way}".strip()
        print(f"pointglass: `{command}` has no use for {', '.join(ignored)}: left out of account", file=sys.stderr)


def _check_start(path: Path, quality: str) -> None:
    """Raises DataError where a network of ``quality`` cannot begin with the weights at ``path``."""
    from model.data.dataset import DataError
    from model.train.net2net import started_from
    from model.unet import make_network
    from model.weights import WeightsError, load_weights

    try:
        started_from(make_network(quality), load_weights(path)[0])
    except WeightsError as error:
        raise DataError(f"--start-from {error}") from None
    except ValueError as error:
        raise DataError(f"--start-from {path}: cannot begin a {quality} network ({error})") from None


def _check_sizes(places: "Sequence[TruePlace]", crop: int) -> None:
    """Raises DataError where crops do not fit into a place's pictures at half their size."""
    from model.data.dataset import DataError

    for place in places:
        for least, view in ((min(view.width, view.height) // 2, view) for view in place.views):
            if least < crop:
                raise DataError(f"--crop {crop}: {place.name} has pictures of {view.width}x{view.height}, and half of that is "
                                f"smaller than such crops; choose at most {least}")


def _facts(options: argparse.Namespace) -> "Facts":
    """What the pairs are made from."""
    from model.train.manifest import whereabouts

    return {**whereabouts(options.out, options.data), "procedural": options.procedural, "seed": options.seed,
            "textures": None if options.textures is None else options.textures.resolve().name}


def _sources(options: argparse.Namespace) -> tuple[str, ...]:
    """The same as a person would say it."""
    made_up = (f"--procedural {options.procedural} --seed {options.seed}",) if options.procedural else ()
    return (*(str(Path(folder).resolve()) for folder in options.data), *made_up)


def _folders(listed: Path) -> list[Path]:
    """The folders of pairs named in a list; none where there is no list, or where not all of them are there."""
    folders = [listed.parent / name for name in listed.read_text().split()] if listed.is_file() else []
    return folders if all(folder.is_dir() for folder in folders) else []


def _pairs(options: argparse.Namespace, facts: "Facts") -> list[Path]:
    """Folders of pairs at the pictures' own size and, with neighbours, at half of it, one of each for every picture size.

    What they are made from lies beside them from the first on.  Raises DataError where that is something else.
    """
    first = int(os.environ.get("RANK", 0)) == 0
    name = f"pairs-{'unfiltered' if options.unfiltered else 'filtered'}"
    listed, record = options.out / f"{name}.txt", options.out / f"{name}.json"
    while not first and not _folders(listed):
        time.sleep(1.0)
    from model.common.folders import made_folder, replace_text
    from model.data.dataset import DataError
    from model.data.procedural import procedural_places
    from model.data.sources import open_places
    from model.train.manifest import EARLIER, read_record, refuse_other

    made = sorted(path for path in options.out.glob(f"{name}-*-[12]") if path.is_dir())
    kept, whole = read_record(record) if made else None, _folders(listed)
    if kept is not None:
        refuse_other(options.out, "its pairs were", kept, facts)
        if whole:
            return whole
    elif made:
        raise DataError(f"{made[0]}: {EARLIER}")
    numbers = range(options.seed, options.seed + options.procedural)
    places = open_places(options.data)
    places += list(procedural_places(seeds=numbers))
    if not places:
        raise DataError(f"{options.data[0]}: holds no places to learn from; give other folders, or --procedural N")
    _check_sizes(places, options.crop)
    with made_folder(options.out):
        replace_text(record, json.dumps(facts, indent=1))
        folders = whole
        try:
            folders = folders or _build(places, options.out, name, unfiltered=options.unfiltered, seed=options.seed,
                                        textures=options.textures)
        except BaseException:
            if not any(path.is_dir() for path in options.out.glob(f"{name}-*-[12]")):
                record.unlink(missing_ok=True)
            raise
        replace_text(listed, "\n".join(folder.name for folder in folders) + "\n")
    return folders


def _build(places: "Sequence[TruePlace]", out: Path, name: str, *, unfiltered: bool, seed: int,
           textures: Path | None) -> list[Path]:
    from model.data.cutout import with_cut_outs
    from model.data.painting import load_textures
    from model.data.pairs import build, by_size

    folders, paint = [], load_textures(textures) if textures is not None else []
    for number, alike in enumerate(by_size(places)):
        for reduce in (1, 2):  # at half the size many points meet in a pixel
            folder = out / f"{name}-{number}-{reduce}"
            folders.append(folder)
            if not folder.is_dir():
                build(with_cut_outs(alike, seed) if reduce == 1 else alike, folder, seed=seed,
                      preset="off" if unfiltered else "auto", reduce=reduce, neighbours=reduce == 2, textures=paint)
    return folders
