"""Command line of ``pointglass train``: options, their checks, and the run.  Importing this loads nothing heavy.

Runs in one process, or as ``torchrun --nproc-per-node N -m pointglass.viewer train ...``: the first process then makes the
training pairs and the others wait.
"""

import argparse
import logging
import math
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..common.seeds import MAX_SEED
from ..data.dataset import MIN_CROP
from ..network.qualities import DEFAULT, trainable

if TYPE_CHECKING:
    from ..data.dataset import TruePlace
    from .manifest import Facts

_log = logging.getLogger(__name__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options that :func:`run` reads."""
    parser.add_argument("data", nargs="*", type=Path, metavar="FOLDER",
                        help="training data: folders with scene.json, of ScanNet++, or of RGB-D frames with poses")
    parser.add_argument("--out", type=Path, metavar="DIR",
                        help="folder for pairs, checkpoint and weights, from which an interrupted training resumes "
                             "(--tune: folder for the weights, by default the viewer's own)")
    parser.add_argument("--procedural", type=int, default=0, metavar="N",
                        help="add N procedural places: streets, objects and rooms in turn (default 0)")
    parser.add_argument("--recipe", choices=["gpu", "night"],
                        help="train all networks; gpu: 25 minutes on one CUDA GPU, night: 10 hours on two CPU cores")
    parser.add_argument("--quality", default=DEFAULT, choices=trainable(),
                        help=f"size of the network (default {DEFAULT})")
    parser.add_argument("--unfiltered", action="store_true", help="train for `--filter off`: input without the depth filter")
    parser.add_argument("--minutes", type=float, metavar="M",
                        help="training time (default 60; with --recipe, total time: 25 or 600)")
    parser.add_argument("--steps", type=int, default=40_000, metavar="N", help="largest number of steps (default 40000)")
    parser.add_argument("--batch", type=int, default=8, metavar="N", help="crops per step and process (default 8)")
    parser.add_argument("--crop", type=int, default=192, metavar="PIXELS",
                        help=f"side of a crop, {MIN_CROP} or more (default 192)")
    parser.add_argument("--rate", type=float, default=1e-3, metavar="X", help="learning rate (default 0.001)")
    parser.add_argument("--perceptual", type=Path, metavar="DIR", help="folder with the weights of the SqueezeNet distance")
    parser.add_argument("--textures", type=Path, metavar="DIR",
                        help="thumbnail sheets of photographic textures (ambientCG's, *.webp), painted onto most pairs")
    parser.add_argument("--validation", type=Path, metavar="FOLDER", help="with --recipe: scene to evaluate the weights on")
    parser.add_argument("--start-from", type=Path, metavar="F", help="initial weights, of the same or a smaller network")
    parser.add_argument("--device", default="auto", choices=["auto", "cuda", "cpu"],
                        help="auto: CUDA where it works, else CPU (default auto)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of crops and procedural places (default 1)")


def run(options: argparse.Namespace) -> int:
    """Makes the pairs if they do not exist yet, trains, and prints the path of the weights.  Returns 0.

    Raises DataError where data is missing, unreadable or does not fit, before anything is written.
    """
    from ..common.errors import DataError
    from ..common.process.torch_process import prepare_training

    if options.out is None:
        raise DataError("--out DIR is missing: the folder for pairs, checkpoint and weights")
    check(options)
    prepare_training()
    if options.recipe:
        from .recipes import RECIPES, follow

        recipe = RECIPES[options.recipe]
        follow(recipe, options.data, options.out, minutes=recipe.minutes if options.minutes is None else options.minutes,
               perceptual=options.perceptual, validation=options.validation, seed=options.seed, device=options.device,
               textures=options.textures)
        return 0
    if not options.data and not options.procedural:
        raise DataError("no training data: give folders with scene.json, or --procedural N")
    if any((options.out / name).exists() for name in ("recipe.json", "pairs/filtered", "pairs/unfiltered")):
        raise DataError("contains a training with --recipe", file=options.out, remedy="choose another --out")
    from .trainer import TrainConfig, train

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


_UNUSED_OPTIONS = {
    "": ("validation",),
    "--recipe": ("procedural", "quality", "unfiltered", "steps", "batch", "crop", "rate", "start_from"),
    "--tune": ("data", "procedural", "recipe", "unfiltered", "steps", "batch", "crop", "rate", "validation", "start_from",
               "textures"),
}
"""Options that each mode of training ignores; "" is the mode with neither --recipe nor --tune."""


def _mode(options: argparse.Namespace) -> str:
    """A key of _UNUSED_OPTIONS.  ``--tune`` is an option of the viewer, which reads the scan."""
    return "--tune" if getattr(options, "tune", None) is not None else "--recipe" if options.recipe else ""


def unused(options: argparse.Namespace) -> list[str]:
    """The given options that this mode of training ignores, as they were given."""
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    given = []
    for name in _UNUSED_OPTIONS[_mode(options)]:
        value: Any = getattr(options, name)
        if name == "data":
            given += map(str, value)
        elif value != parser.get_default(name):
            given.append(f"--{name.replace('_', '-')}" + ("" if value is True else f" {value}"))
    return given


def check(options: argparse.Namespace) -> None:
    """Raises DataError naming the first invalid option; called before any long work.

    Prints the options that this mode ignores to standard error.
    """
    from ..common.errors import DataError

    mode = _mode(options)
    if mode and int(os.environ.get("WORLD_SIZE", 1)) > 1:
        raise DataError(f"{mode} trains in one process, not in {os.environ['WORLD_SIZE']}", remedy="start it without torchrun")
    if mode and options.minutes == 0:
        raise DataError(f"--minutes 0: {mode} needs more than 0 minutes")
    for name, least in (("procedural", 0), ("steps", 1), ("batch", 1), ("crop", MIN_CROP), ("seed", 0)):
        if (value := getattr(options, name)) < least:
            raise DataError(f"--{name} {value}: expected at least {least}")
    if options.seed > MAX_SEED:
        raise DataError(f"expected at most {MAX_SEED}", option="--seed", value=options.seed)
    if not (math.isfinite(options.rate) and options.rate > 0):
        raise DataError(f"--rate {options.rate:g}: expected a learning rate above 0, such as 0.001")
    if options.minutes is not None and not (math.isfinite(options.minutes) and options.minutes >= 0):
        raise DataError(f"--minutes {options.minutes:g}: expected a number of minutes, 0 to stop at --steps only")
    if options.out is not None and options.out.exists() and not options.out.is_dir():
        raise DataError("is a file", option="--out", value=options.out, remedy="give a folder")
    if options.textures is not None:
        from ..data.surfaces.painting import load_textures

        load_textures(options.textures)
    if options.perceptual is not None:
        from ..evaluation.metrics.perceptual import SQUEEZE_FILES

        for name in SQUEEZE_FILES:
            if not (options.perceptual / name).is_file():
                raise DataError(f"--perceptual {options.perceptual}: {name} is missing",
                                remedy=f"give the folder with {' and '.join(SQUEEZE_FILES)}, or leave the option out")
    if options.start_from is not None and "start_from" not in _UNUSED_OPTIONS[mode]:
        _check_start(options.start_from, options.quality)
    if options.device == "cuda":
        from ..common.errors import Option
        from ..network.reconstruct import cuda_problem

        if problem := cuda_problem():
            raise DataError(problem, option=Option("--device", "cuda"), remedy="see `pointglass doctor`, or use --device cpu")
    if (ignored := unused(options)) and int(os.environ.get("RANK", 0)) == 0:
        command = f"train {mode}".strip()
        print(f"pointglass: `{command}` ignores {', '.join(ignored)}", file=sys.stderr)


def _check_start(path: Path, quality: str) -> None:
    """Raises DataError where a network of ``quality`` cannot start from the weights at ``path``."""
    from ..common.errors import DataError
    from ..network.unet import make_network
    from ..network.weights import WeightsError, load_weights
    from .net2net import started_from

    try:
        started_from(make_network(quality), load_weights(path)[0])
    except WeightsError as error:
        raise DataError(f"--start-from {error}") from None
    except ValueError as error:
        raise DataError(f"cannot be the start of a {quality} network ({error})", option="--start-from", value=path) from None


def _check_sizes(places: "Sequence[TruePlace]", crop: int) -> None:
    """Raises DataError where crops do not fit into a place's pictures at half resolution."""
    from ..common.errors import DataError

    for place in places:
        for least, view in ((min(view.width, view.height) // 2, view) for view in place.views):
            if least < crop:
                raise DataError(f"{place.name} has pictures of {view.width}x{view.height}, and half of that is less than a "
                                "crop", option="--crop", value=crop, remedy=f"choose at most {least}")


def _facts(options: argparse.Namespace) -> "Facts":
    """Facts from which the pairs are made (model/train/manifest.py)."""
    from .manifest import whereabouts

    return {**whereabouts(options.out, options.data), "procedural": options.procedural, "seed": options.seed,
            "textures": None if options.textures is None else options.textures.resolve().name}


def _sources(options: argparse.Namespace) -> tuple[str, ...]:
    """The same for the weights' header: folders and options."""
    procedural = (f"--procedural {options.procedural} --seed {options.seed}",) if options.procedural else ()
    return (*(str(Path(folder).resolve()) for folder in options.data), *procedural)


def _folders(listed: Path) -> list[Path]:
    """The folders of pairs named in a list file; empty where there is no list, or where a folder of it is missing."""
    folders = [listed.parent / name for name in listed.read_text().split()] if listed.is_file() else []
    return folders if all(folder.is_dir() for folder in folders) else []


def _pairs(options: argparse.Namespace, facts: "Facts") -> list[Path]:
    """Folders of pairs: for every picture size one at full and one, with neighbouring cameras, at half resolution.

    Pairs that exist are reused.  A manifest beside them names what they are made from; it is written first.  Raises DataError
    where existing pairs were made from something else.
    """
    first = int(os.environ.get("RANK", 0)) == 0
    name = f"pairs-{'unfiltered' if options.unfiltered else 'filtered'}"
    listed, manifest = options.out / f"{name}.txt", options.out / f"{name}.json"
    while not first and not _folders(listed):
        time.sleep(1.0)
    from ..common.errors import DataError
    from ..common.files.folders import made_folder, replace_text
    from ..common.files.json_file import write_json
    from ..common.process.signals import undone
    from ..data.procedural import procedural_places
    from ..data.sources import open_places
    from .manifest import EARLIER, read_manifest, refuse_other

    made = sorted(path for path in options.out.glob(f"{name}-*-[12]") if path.is_dir())
    kept, complete = read_manifest(manifest) if made else None, _folders(listed)
    if kept is not None:
        refuse_other(options.out, "its pairs were", kept, facts)
        if complete:
            _log.info("training pairs are reused: %s", ", ".join(map(str, complete)))
            return complete
        _log.info("training pairs are incomplete: the missing folders are made again")
    elif made:
        raise DataError(EARLIER, file=made[0])
    numbers = range(options.seed, options.seed + options.procedural)
    places = open_places(options.data)
    places += list(procedural_places(seeds=numbers))
    if not places:
        raise DataError("contains no training data", file=options.data[0], remedy="give other folders, or --procedural N")
    _check_sizes(places, options.crop)
    with made_folder(options.out):
        write_json(manifest, facts)
        folders = complete

        def remove() -> None:  # a manifest of nothing would refuse the next run
            if not any(path.is_dir() for path in options.out.glob(f"{name}-*-[12]")):
                manifest.unlink(missing_ok=True)

        with undone(remove):
            folders = folders or _build(places, options.out, name, unfiltered=options.unfiltered, seed=options.seed,
                                        textures=options.textures)
        replace_text(listed, "\n".join(folder.name for folder in folders) + "\n")
    return folders


def _build(places: "Sequence[TruePlace]", out: Path, name: str, *, unfiltered: bool, seed: int,
           textures: Path | None) -> list[Path]:
    from ..data.pairs import build, by_size
    from ..data.surfaces.cutout import with_cut_outs
    from ..data.surfaces.painting import load_textures

    folders, paint = [], load_textures(textures) if textures is not None else []
    for number, alike in enumerate(by_size(places)):
        for reduce in (1, 2):  # at half resolution more points fall into a pixel
            folder = out / f"{name}-{number}-{reduce}"
            folders.append(folder)
            if not folder.is_dir():
                build(with_cut_outs(alike, seed) if reduce == 1 else alike, folder, seed=seed,
                      preset="off" if unfiltered else "auto", reduce=reduce, neighbours=reduce == 2, textures=paint)
    return folders
