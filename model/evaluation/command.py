"""The options of ``pointglass evaluate``, and the command itself.  Importing this loads no heavy module."""

import argparse
import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..network.weights_folder import weights_path

if TYPE_CHECKING:
    from .rooms.shared_rooms import Share

CHOICES = {"both": ("scanned", "matched"), "scanned": ("scanned",), "matched": ("matched",)}
"""Value of ``--exposures`` -> exposures that are evaluated."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of :func:`run`."""
    parser.add_argument("data", nargs="+", type=Path, metavar="FOLDER|SCAN",
                        help="rooms (folders with scene.json, stations, views) and folders of rooms, each room evaluated "
                             "separately, the worst first; or scans, as for the viewer, one after the other, evaluated at a "
                             "tenth of their points, withheld from the pictures")
    parser.add_argument("--weights", nargs="*", type=weights_path, default=[], metavar="F",
                        help="weights files or names of shipped ones (default: all shipped; for a scan: balanced)")
    parser.add_argument("--densities", nargs="*", type=float, default=[1.0, 0.1], metavar="D",
                        help="shares of the points (default 1 0.1)")
    parser.add_argument("--views", type=int, metavar="N", help="number of views, evenly spaced (default: all; for a scan: 8)")
    parser.add_argument("--perceptual", type=Path, metavar="DIR", help="weights of the SqueezeNet distance")
    parser.add_argument("--exposures", choices=list(CHOICES), default="both",
                        help="colours as recorded, with exposure compensation (matched), or both (default both)")
    parser.add_argument("--outside", action="append", default=[], metavar="NAME=FOLDER",
                        help="pictures of another method: PNG files named after the views; may be repeated")
    parser.add_argument("--method", action="append", default=[], metavar="NAME=FILE.py:FUNCTION",
                        help="a method of your own: a function of a scan and a camera that returns a picture "
                             "(model/README.md); may be repeated")
    parser.add_argument("--network", action="append", default=[], metavar="NAME=FILE.py:FACTORY",
                        help="a network of your own: a function that returns a torch module, which gets the input of "
                             "pointglass's networks; may be repeated")
    parser.add_argument("--flicker", action=argparse.BooleanOptionalAction, default=True,
                        help="measure flicker along the scene's path, if it has one (default: yes)")
    parser.add_argument("--frames", type=int, default=20, metavar="N",
                        help="number of frames from the middle of the path (0: all; default 20)")
    parser.add_argument("--paper-table", action="store_true",
                        help="print the paper's table instead, for a folder of ScanNet++ or other data: two sizes, 100 %% and "
                             "10 %% of the points; with --json, a run that ended early is continued")
    parser.add_argument("--split", default="val", metavar="NAME",
                        help="split of ScanNet++ (--paper-table): train, val, test or a file in splits/ (default val)")
    parser.add_argument("--camera", choices=["dslr", "iphone"], default="dslr",
                        help="camera of ScanNet++ (--paper-table; default dslr)")
    parser.add_argument("--fast", action="store_true",
                        help="only the filled picture and the networks: no other baselines, Open3D, durations or flicker")
    parser.add_argument("--worst", type=Path, metavar="F.png",
                        help="write the view in which a network is worst relative to the filled picture: filled, neural, truth")
    parser.add_argument("--json", type=Path, metavar="F", help="write all figures")
    parser.add_argument("--csv", type=Path, metavar="F.csv", help="write the figures of each picture (--paper-table)")
    parser.add_argument("--latex", type=Path, metavar="F.tex", help="write the table for a paper (--paper-table)")
    parser.add_argument("--plot", type=Path, metavar="F",
                        help="plot PSNR and distance against ms (.png, .svg, .pdf); for a scan, pictures (.png): filled, "
                             "neural, and which of them is closer to the withheld points")


def names_of(files: Sequence[Path]) -> dict[str, Path]:
    """Unique name -> weights file: its stem, after the folder's name if stems repeat.  Raises DataError if two are equal."""
    from ..common.errors import DataError

    stems = [path.stem for path in files]
    names: dict[str, Path] = {}
    for path in files:
        name = path.stem if stems.count(path.stem) == 1 else f"{path.absolute().parent.name}/{path.stem}"
        if name in names:
            raise DataError(f"{names[name]} has the same name, {name}", option="--weights", value=path, remedy="rename one")
        names[name] = path
    return names


def run(options: argparse.Namespace, share: "Share | None" = None) -> int:
    """Evaluates each room that the folders are or contain, prints the tables and writes the requested files.  Returns 0.
    Raises DataError and WeightsError.

    share: gives the results of tasks that other processes compute, see model.evaluation.shared_rooms; None: this one does all.

    JSON of one scene: the result of :func:`model.evaluation.evaluate`; of several: ``scenes``, a list of results, worst first.
    """
    from ..common.errors import DataError
    from ..common.files.json_file import write_json
    from ..data.sources import room_folders
    from ..network.weights_folder import weights_dir
    from .outside import parse_outside
    from .own_methods import own_methods, own_networks
    from .report import PLOT_SUFFIXES, check_output, format_table, plot, save_picture
    from .room_scores import evaluate
    from .rooms.shared_rooms import SharedRooms, evaluate_shared
    from .worse import Worst, ratio_of_room

    for path, suffixes in ((options.json, ()), (options.plot, PLOT_SUFFIXES), (options.worst, (".png",)),
                           (options.csv, (".csv",)), (options.latex, (".tex",))):
        if path:
            check_output(path, suffixes)
    for name in ("csv", "latex"):
        if getattr(options, name) and not options.paper_table:
            raise DataError("only with --paper-table", option=f"--{name}", value=getattr(options, name))
    rooms = options.data if options.paper_table else room_folders(options.data)
    for name in ("plot", "outside", "paper_table"):
        if getattr(options, name) and len(rooms) > 1:
            raise DataError(f"--{name.replace('_', '-')}: for one folder, but {len(rooms)} are given", remedy="omit it")
    files = options.weights or sorted(weights_dir().glob("*.safetensors"))
    if options.paper_table:
        if share is not None:
            raise DataError("--paper-table is made by one process", remedy="leave --workers or --scheduler out")
        return _paper_table(options, names_of(files))
    worst = Worst() if options.worst else None
    settings = {
        "densities": tuple(options.densities), "weights": names_of(files), "distance_path": options.perceptual,
        "views": options.views, "exposures": CHOICES[options.exposures], "outside": parse_outside(options.outside),
        "flicker": options.flicker, "frames": options.frames or None, "fast": options.fast,
    }
    if share is None:
        own = {"functions": own_methods(options.method), "networks": own_networks(options.network)}
        results = [evaluate(folder, **settings, **own, worst=worst) for folder in rooms]
    else:
        results = evaluate_shared(SharedRooms(tuple(rooms), settings, tuple(options.method), tuple(options.network),
                                              worst is not None), share, worst)
    results.sort(key=ratio_of_room, reverse=True)
    print("\n\n".join(format_table(result) for result in results))
    if options.json:
        write_json(options.json, results[0] if len(results) == 1 else {"scenes": results})
    if options.plot:
        plot(results[0], options.plot)
    if worst is not None and worst.case is not None:
        save_picture(worst.sheet(), options.worst)
        print(f"worst view: {worst.case.label}, error ratio {worst.case.ratio:.3f}: {options.worst}")
    return 0


_NOT_IN_PAPER_TABLE = {"plot": None, "exposures": "both", "flicker": True, "frames": 20, "fast": False, "worst": None}
"""Options that ``--paper-table`` ignores, with their defaults."""


def _paper_table(options: argparse.Namespace, weights: dict[str, Path]) -> int:
    from ..common.files.json_file import write_json
    from ..data.images.scannetpp import load_scannetpp, scenes
    from ..data.sources import open_places
    from .outside import parse_outside
    from .own_methods import own_methods, own_networks
    from .paper_report import format_paper_table, write_csv, write_latex
    from .paper_table import paper_table

    folder = options.data[0]
    if ignored := [f"--{name}" for name, default in _NOT_IN_PAPER_TABLE.items() if getattr(options, name) != default]:
        print(f"pointglass: --paper-table ignores {', '.join(ignored)}", file=sys.stderr)
    if (folder / "splits").is_dir():
        names = scenes(folder, options.split)
        places = [load_scannetpp(folder, name, options.camera) for name in names]
    else:
        places = open_places([folder])
    earlier = _unfinished_table(options.json)
    if earlier is not None:
        print(f"pointglass: {options.json}: continued after {len(earlier['places'])} of {len(places)} places", file=sys.stderr)
    result = paper_table(
        places, weights, densities=tuple(options.densities), views=options.views, distance_path=options.perceptual,
        outside=parse_outside(options.outside), functions=own_methods(options.method), networks=own_networks(options.network),
        earlier=earlier, save=partial(write_json, options.json) if options.json else None,
    )
    print(format_paper_table(result))
    for path, write in ((options.json, lambda result, path: write_json(path, result)), (options.csv, write_csv),
                        (options.latex, write_latex)):
        if path:
            write(result, path)
    return 0


def _unfinished_table(path: Path | None) -> dict | None:
    """The result in a file that a run of ``--paper-table`` left unfinished; None where there is none."""
    if path is None or not path.is_file():
        return None
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return held if isinstance(held, dict) and held.get("complete") is False and isinstance(held.get("places"), list) else None
