"""Benchmarks: ``pointglass bench frame | grid | open | error | scale | campus | versus | stability | occlusion | raster |
cull | flight | photographs``.

Each result includes machine, driver, versions, scan and picture size.  Run times are measured here only; no test asserts them.
"""

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...model.common.files.atomic_write import passes_through
from ...model.common.files.json_file import write_json
from ...model.common.seeds import MAX_SEED
from ..common.errors import InputError
from ..picture.settings import CHOICES

if TYPE_CHECKING:
    from ..picture.settings import Settings
    from .bench_input import Subject

PROCEDURAL = 25_000_000
"""Default number of points of a procedural scan: five rooms (viewer.bench.procedural_scan)."""
_UNITS = {"k": 10**3, "m": 10**6, "g": 10**9}
"""Suffix of a number -> factor."""
_MOST_POINTS = 10**11
"""Largest number of points accepted, far above what machines can hold: 1.2 TB as packed points."""
LEAST_FRAMES = {"occlusion": 3, "flight": 12}
"""Least number of cameras of benches that need more than one.  Occlusion: the first frame, the one after the jump, and one with
a history.  Flight: the frames whose error is measured."""
PLOT_SUFFIXES = (".png", ".svg", ".pdf", ".eps", ".ps", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
"""File types of a plot: picture formats of matplotlib that common programs open."""


@dataclass(frozen=True)
class Kind:
    """One benchmark.

    text: for --help.  repeats: default number of rounds.  scan: default input: ``demo``, ``procedural``, or ``nothing`` if it
    takes no scan.  uses: options that it uses, besides those of all benches and those that choose a scan.
    """

    text: str
    repeats: int
    scan: str
    uses: tuple[str, ...]


SETTINGS = (*CHOICES, "filter_strength", "filter_levels", "lod", "weights")
"""Options that set a field of Settings."""
KINDS = {
    "frame": Kind("frame times by stage along a path", 1, "demo", (*SETTINGS, "size", "along", "repeats")),
    "flight": Kind("pictures per second in a window, and the error of the pictures shown", 1, "demo",
                   (*SETTINGS, "size", "frames")),
    "grid": Kind("time to build the grid", 3, "nothing", ("points", "repeats")),
    "open": Kind("time to the first picture and to full quality", 1, "demo", SETTINGS),
    "error": Kind("time saved and error caused by each approximation", 5, "demo", ("only", "repeats")),
    "campus": Kind("time and memory of places of 10 to 300 files", 2, "nothing",
                   (*SETTINGS, "size", "points", "files", "keep", "repeats", "seed")),
    "scale": Kind("time and memory from 1M to 1G points", 2, "nothing", (*SETTINGS, "points", "keep", "repeats", "seed")),
    "versus": Kind("comparison with the paper's pipeline and Open3D", 3, "procedural",
                   (*SETTINGS, "size", "frames", "repeats")),
    "stability": Kind("numerical limits of this machine's pictures", 1, "nothing", ("seed",)),
    "occlusion": Kind("time saved by occlusion culling, and its error", 1, "nothing",
                      ("lod", "points", "rooms", "frames", "seed")),
    "raster": Kind("the rasterisers on random points", 5, "nothing", ("points", "repeats", "seed")),
    "photographs": Kind("time that photographs take: none, 18, 300 panoramas", 8, "nothing", ("points", "repeats", "seed")),
    "cull": Kind("time to find the visible ones of a million cells", 5, "nothing", ("repeats", "seed")),
}
_OF_SCANS = ("procedural", "rooms", "seed")
"""Options that choose a procedural scan."""
NEURAL = ("open", "error", "scale", "versus", "flight")
"""Benches that always run a network."""


def parse_count(text: str, option: str) -> int:
    """``25M`` -> 25,000,000; suffixes k, M and G.  Raises InputError."""
    digits, unit = (text[:-1], text[-1:].lower()) if text[-1:].lower() in _UNITS else (text, "")
    try:
        count = float(digits) * _UNITS.get(unit, 1)
    except ValueError:
        count = 0.0
    if not (1 <= count <= _MOST_POINTS and count == int(count)):
        raise InputError("expected a whole number of points above 0, such as 500k, 25M or 1G", option=option, value=text)
    return int(count)


def parse_counts(text: str, option: str) -> list[int]:
    """``1M,10M`` -> [1,000,000, 10,000,000].  Raises InputError."""
    return [parse_count(part.strip(), option) for part in text.split(",")]


def parse_sizes(texts: list[str] | None) -> list[tuple[int, int]]:
    """Sizes of ``--size``, each a comma-separated list; 960x720 by default."""
    from ..commands.render_pictures import parse_size

    return [parse_size(part.strip()) for text in texts or ["960x720"] for part in text.split(",")]


def subject_of(options: argparse.Namespace) -> "Subject":
    """The scan of a bench.  Raises InputError for contradictory options."""
    from ..commands.demo import demo_scan
    from .bench_input import Subject
    from .procedural_scan import ProceduralScan

    wanted = KINDS[options.kind].scan
    points = PROCEDURAL if options.procedural is None else parse_count(options.procedural, "--procedural")
    if options.scans and options.procedural is not None:
        raise InputError(f"--procedural {options.procedural} and {options.scans[0]}: give one or the other")
    if options.scans:
        return Subject(tuple(options.scans))
    if options.procedural is not None or wanted == "procedural":
        return Subject(procedural=ProceduralScan(points, options.rooms, options.seed))
    return Subject((demo_scan(),))


def _check(options: argparse.Namespace) -> None:
    """Raises InputError naming the first invalid option, before the measurement."""
    for option, suffixes in (("json", None), ("plot", PLOT_SUFFIXES)):
        path = getattr(options, option)
        if path is None:
            continue
        if suffixes is not None and path.suffix.lower() not in suffixes:
            raise InputError(f"--{option} {path}: the name must end in {', '.join(suffixes)}")
        if passes_through(path):
            continue
        if not path.absolute().parent.is_dir():
            raise InputError(f"--{option} {path}: no such folder", remedy="create it first")
        if path.is_dir() or not os.access(path.absolute().parent, os.W_OK):
            raise InputError(f"--{option} {path}: cannot be written", remedy="choose a file in a writable folder")
    least_frames = LEAST_FRAMES.get(options.kind, 1)
    for option, least in (("repeats", 1), ("rooms", 1), ("frames", least_frames)):
        value = getattr(options, option)
        if value is not None and value < least:
            raise InputError(f"--{option} {value}: expected at least {least}")
    if not 0 <= options.seed <= MAX_SEED:
        raise InputError(f"expected 0 to {MAX_SEED}", option="--seed", value=options.seed)
    if options.keep is not None and options.keep.exists() and not options.keep.is_dir():
        raise InputError(f"--keep {options.keep}: is a file", remedy="give a folder")


def unused(options: argparse.Namespace, settings: "Settings") -> list[str]:
    """The given options that this bench ignores, as text."""
    kind = KINDS[options.kind]
    uses = {*kind.uses, *(() if kind.scan == "nothing" else _OF_SCANS)}
    defaults: dict[str, Any] = {name: getattr(type(settings)(), name) for name in SETTINGS}
    defaults |= {"procedural": None, "rooms": None, "seed": 1, "along": "path", "frames": None, "points": None, "keep": None,
              "files": None, "only": None, "repeats": None}  # fmt: skip
    found = [name for name, value in defaults.items() if name not in uses and getattr(options, name, value) != value]
    ignored = [f"--{name.replace('_', '-')} {getattr(options, name)}" for name in found]
    if "size" not in uses and len(parse_sizes(options.size)) > 1:
        ignored.append("more than one --size")
    return ignored


def run_bench(options: argparse.Namespace, settings: "Settings") -> int:
    """Runs the chosen bench, prints a table, and writes the requested JSON and plot.  Returns the exit status."""
    from .bench_input import described, machine

    _check(options)
    repeats = KINDS[options.kind].repeats if options.repeats is None else options.repeats
    if KINDS[options.kind].scan == "nothing" and options.scans:
        raise InputError(f"`bench {options.kind}` makes its own points and takes no scan", file=options.scans[0])
    if ignored := unused(options, settings):
        print(f"pointglass: `bench {options.kind}` ignores {', '.join(ignored)}", file=sys.stderr)
    if options.kind in NEURAL or (options.kind == "frame" and settings.view == "neural"):
        from ...model.common.process.torch_process import prepare_inference

        prepare_inference()
    result, rows, plot = _RUN[options.kind](options, settings, repeats)
    result = {"bench": options.kind, "machine": machine(), **result}
    print(described(result))
    for name, text in rows(result):
        print(f"  {name:48} {text}")
    if options.json:
        write_json(options.json, result)
    if options.plot and plot is not None:
        plot(result, options.plot)
    return 1 if result.get("failed") else 0


Outcome = tuple[dict, Callable[[dict], list[tuple[str, str]]], Callable | None]
"""A result, the function of its table, and that of its plot, None if the bench has written the plot."""


def _frame(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import frame_times

    sizes = parse_sizes(options.size)
    found = frame_times.run_frames(subject_of(options), sizes, settings, repeats, options.along)
    return found, frame_times.rows, frame_times.plot


def _flight(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import flight_rate

    size = parse_sizes(options.size or ["1280x720"])[0]
    frames = options.frames or flight_rate.FRAMES
    return flight_rate.run_flight(subject_of(options), size, settings, frames), flight_rate.rows, flight_rate.plot


def _grid(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import grid

    return grid.run(parse_count(options.points or "10M", "--points"), repeats), grid.rows, grid.plot


def _open(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import opening

    return opening.run_open(subject_of(options), parse_sizes(options.size)[0], settings), opening.rows, opening.plot


def _error(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import approximation_errors

    result = approximation_errors.run_errors(subject_of(options), parse_sizes(options.size)[0], repeats, options.only)
    return result, approximation_errors.rows, approximation_errors.plot


def _scale(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import scaling

    counts = parse_counts(options.points, "--points") if options.points else scaling.LADDER
    size = parse_sizes(options.size)[0]
    return scaling.run_scale(counts, size, settings, repeats, options.seed, options.keep), scaling.rows, scaling.plot


def _versus(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import versus

    result = versus.run_versus(subject_of(options), parse_sizes(options.size), settings, repeats, options.frames)
    return result, versus.rows, versus.plot


def _stability(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import stability

    size = parse_sizes(options.size)[0] if options.size else (320, 240)
    return stability.run_stability(size, options.seed), stability.rows, stability.plot


def _occlusion(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import occlusion_walk

    points, rooms = parse_count(options.points or "100M", "--points"), options.rooms or occlusion_walk.ROOMS
    frames = options.frames or occlusion_walk.FRAMES
    result = occlusion_walk.run_occlusion(
        rooms, points, parse_sizes(options.size)[0], frames, seed=options.seed, lod=settings.lod
    )
    return result, occlusion_walk.rows, occlusion_walk.plot


def _raster(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import rasters

    count = parse_count(options.points or "2M", "--points")
    return rasters.run_rasters(count, parse_sizes(options.size)[0], repeats, options.seed), rasters.rows, rasters.plot


def _cull(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import culling

    return culling.run_culling(parse_sizes(options.size)[0], repeats, options.seed), culling.rows, culling.plot


def _photographs(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from .cases import photograph_times as case

    points = parse_count(options.points or "2M", "--points")
    return case.run_photographs(points, parse_sizes(options.size)[0], repeats, options.seed), case.rows, case.plot


def _campus(options: argparse.Namespace, settings: "Settings", repeats: int) -> Outcome:
    from pathlib import Path

    from .cases import campus

    counts = parse_counts(options.files, "--files") if options.files else campus.FILES
    points = parse_count(options.points, "--points") if options.points else campus.POINTS
    folder = options.keep or Path("out/campus")
    result = campus.run_campus(folder, counts, points, parse_sizes(options.size)[0], settings, repeats, options.seed)
    return result, campus.rows, campus.plot


_RUN: dict[str, Callable[[argparse.Namespace, "Settings", int], Outcome]] = {
    "frame": _frame, "grid": _grid, "open": _open, "error": _error, "scale": _scale, "versus": _versus,
    "stability": _stability, "occlusion": _occlusion, "raster": _raster, "cull": _cull, "flight": _flight,
    "campus": _campus, "photographs": _photographs,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of ``bench``, except those that set a field of Settings."""
    from pathlib import Path

    kinds = "; ".join(f"{name}: {kind.text}" for name, kind in KINDS.items())
    parser.add_argument("kind", nargs="?", default="frame", choices=list(KINDS), help=kinds)
    parser.add_argument("scans", nargs="*", type=Path, metavar="SCAN", help="default: the demo scan; versus: a procedural one")
    parser.add_argument("--procedural", metavar="N", help="instead of a scan: procedural rooms with N points (25M)")
    parser.add_argument("--rooms", type=int, metavar="N",
                        help="procedural: number of rooms (default: one per 5M points)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of procedural points (default 1)")
    parser.add_argument("--size", action="append", metavar="WxH[,WxH]",
                        help="picture size (default 960x720, flight: 1280x720); frame and versus accept several")
    parser.add_argument("--along", choices=["path", "views"], default="path",
                        help="frame: the fixed path of 48 frames, or the eight named views (default path)")
    parser.add_argument("--frames", type=int, metavar="N",
                        help="versus, occlusion (at least 3), flight (at least 12): number of cameras along the path")
    parser.add_argument("--points", metavar="N[,N]",
                        help="grid, occlusion, raster, photographs: number of points (10M, 100M, 2M, 2M); scale: the sizes")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="scale: keep the grids in this folder, and use existing ones; "
                                                                 "campus: the folder of the files (out/campus)")
    parser.add_argument("--files", metavar="N,N,...", help="campus: numbers of files (10,30,100,300)")
    parser.add_argument("--only", metavar="GROUP", help="error: only one group of approximations, such as background")
    parser.add_argument("--repeats", type=int, metavar="N", help="number of rounds (default: depends on the bench)")
    parser.add_argument("--json", type=Path, metavar="F", help="write all figures")
    parser.add_argument("--plot", type=Path, metavar="F.png", help="write a plot; also .svg, .pdf and others")
