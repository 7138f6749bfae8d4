"""The command line: what a person types, turned into calls; every anticipated failure into one line and an exit code.

0 done; 1 a bench whose claims do not all hold; 2 bad usage or input; 3 no usable OpenGL or device; 130 stopped by Ctrl-C or
SIGTERM.  Nothing imports this module, and it imports nothing heavy before a command needs it.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path

from model.common.signals import importing
from model.evaluation import command as evaluation_command
from model.train import command as train_command
from viewer import __version__
from viewer.bench import add_arguments as bench_arguments
from viewer.errors import Cancelled, InputError, PointglassError
from viewer.options import Parser, add_columns, add_exposures, add_memory, add_scans, add_settings, memory_of, settings_of
from viewer.progress import progress
from viewer.readers.formats import KNOWN_FILES, KNOWN_FOLDERS
from viewer.settings import BACKGROUNDS
from viewer.text import counted

COMMANDS = ("view", "demo", "render", "info", "convert", "bench", "simulate", "train", "evaluate", "doctor")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="pointglass", description="Fly through a raw coloured laser scan as if it were a film of the place.")
    parser.add_argument("--version", action="version", version=f"pointglass {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)

    def command(name: str, text: str) -> argparse.ArgumentParser:
        """text: in the list of commands, and, as a sentence, above the options of this one."""
        return commands.add_parser(name, help=text, description=f"{text[:1].upper()}{text[1:]}.")

    view = command("view", "open the window (what `pointglass SCAN` does)")
    add_scans(view, least="*")
    add_exposures(view)
    add_settings(view)
    add_memory(view)

    demo = command("demo", "the shipped scan, in a window or as pictures")
    demo.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR",
                      help="where pictures go without a display (default out/demo)")
    add_settings(demo)

    render = command("render", "pictures of a list of cameras")
    add_scans(render)
    add_exposures(render)
    render.add_argument("--cameras", type=Path, required=True, metavar="F",
                        help="transforms.json, camera_path.json, a COLMAP folder or a TUM trajectory")
    render.add_argument("--out", type=Path, required=True, metavar="DIR", help="where pictures go, as NAME.png of each camera")
    render.add_argument("--size", metavar="WxH", help="picture size (default: the cameras' own)")
    render.add_argument("--aux", action="store_true", help="also depth, mask, provenance and stats of each picture")
    texts = "; ".join(f"{key}: {text}" for key, text in BACKGROUNDS.items())
    render.add_argument("--background", choices=list(BACKGROUNDS), default="black",
                        help=f"behind what is shown: {texts} (default black)")
    render.add_argument("--shard", metavar="i/n", help="only every n-th camera, starting at the i-th (from 0)")
    add_settings(render)
    add_memory(render)

    info = command("info", "what a scan holds")
    add_scans(info)
    info.add_argument("--json", action="store_true", help="everything that is known, for programs")

    convert = command("convert", "build the grid into a folder")
    convert.add_argument("scans", nargs="+", type=Path, metavar="SCAN",
                         help=f"{KNOWN_FILES} files, {KNOWN_FOLDERS} folders; several make one grid, or with --each one each")
    convert.add_argument("--out", type=Path, required=True, metavar="DIR",
                         help="a new or empty folder for the grid; open it like a scan")
    convert.add_argument("--each", action="store_true",
                         help="a grid for every scan (SCAN may be a folder of them), in DIR/NAME; what is up to date is kept")
    convert.add_argument("--shard", metavar="i/n", help="--each, but only every n-th scan, starting at the i-th (from 0)")
    add_columns(convert)
    add_exposures(convert)

    bench = command("bench", "run time, measured")
    bench_arguments(bench)
    add_settings(bench, view=False)

    simulate = command("simulate", "scan a procedural place with the virtual scanner")
    simulate.add_argument("--out", type=Path, required=True, metavar="FILE.laz",
                          help="the scan, .laz or .las; eight cameras for `render` go beside it, as FILE_cameras.json")
    simulate.add_argument("--points", type=int, default=1_200_000, metavar="N", help="1000 or more (default 1200000)")
    simulate.add_argument("--seed", type=int, default=1, metavar="N", help="another seed, another place (default 1)")

    train = command("train", "train the network on registered rooms")
    train_command.add_arguments(train)
    train.add_argument("--tune", type=Path, metavar="SCAN",
                       help="adapt the shipped weights to a scan, in minutes (default 10): to the photographs inside an E57, "
                            "else to points withheld from it")

    evaluate = command("evaluate", "judge pictures against registered truth, or by points withheld from a scan")
    evaluation_command.add_arguments(evaluate)

    doctor = command("doctor", "what works here, what is used, what to do")
    doctor.add_argument("--json", action="store_true", help="the same, for programs")
    return parser


def _view(options: argparse.Namespace) -> int:
    for path in options.scans:
        if not path.exists():
            raise InputError(f"{path}: no such file, folder or command (see `pointglass --help`)")
    if any(path.suffix.lower() == ".pointglass" for path in options.scans):
        from viewer.tools.project import check_projects

        check_projects(options.scans)  # refused before a window opens
    from viewer.window.app import run

    return run(options.scans, settings_of(options), cache=not options.no_cache, match=options.exposures == "matched",
               memory=memory_of(options), columns=options.columns)


def _demo(options: argparse.Namespace) -> int:
    from viewer.tools.demo import run_demo

    return run_demo(options.out, settings_of(options))


def _render(options: argparse.Namespace) -> int:
    from viewer.tools.camera_files import read_cameras
    from viewer.tools.export import export_pictures, parse_shard, parse_size

    settings, memory = settings_of(options), memory_of(options)
    size = parse_size(options.size) if options.size else None
    cameras = read_cameras(options.cameras, size=size)
    if options.shard:
        part, parts = parse_shard(options.shard)
        cameras = cameras[part::parts]
    if settings.view == "neural":
        with importing():
            from model.reconstruct import fitting_weights

        own = Path(settings.weights) if settings.weights else None
        fitting_weights(settings.quality, filtered=settings.filter != "off", weights=own)  # refused before the scan is read

    from viewer.grid.open_scene import open_scene
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer

    context = create_context()
    scene = open_scene(options.scans, cache=not options.no_cache, match=options.exposures == "matched",
                       columns=options.columns)
    renderer = Renderer(context, scene, memory=memory)
    try:
        count = export_pictures(renderer, cameras, settings, options.out, aux=options.aux, background=options.background)
    finally:
        renderer.release()
        context.release()
    print(f"{counted(count, 'picture')} in {options.out}")
    return 0


def _info(options: argparse.Namespace) -> int:
    from viewer.grid.info import describe, format_text

    facts = describe(options.scans, cache=not options.no_cache, columns=options.columns)
    print(json.dumps(facts, indent=1) if options.json else format_text(facts))
    return 0


def _convert(options: argparse.Namespace) -> int:
    from viewer.grid.convert import convert, convert_each

    if options.each or options.shard:
        from viewer.tools.export import parse_shard

        shard = parse_shard(options.shard) if options.shard else (0, 1)
        made = convert_each(options.scans, options.out, shard=shard, match=options.exposures == "matched",
                            columns=options.columns)
        print(f"{counted(len(made), 'grid')} in {options.out}")
        return 0
    convert(options.scans, options.out, match=options.exposures == "matched", columns=options.columns)
    print(f"grid in {options.out}")
    return 0


def _bench(options: argparse.Namespace) -> int:
    from viewer.bench import run_bench

    return run_bench(options, settings_of(options))


def _simulate(options: argparse.Namespace) -> int:
    from model.synth.demo import cameras_of, check, main

    check(options.out, options.points, options.seed)
    with progress(int(1.1 * options.points), "scanning", " pulses") as meter:
        count = main(options.out, options.points, options.seed, step=lambda n: meter.update(min(n, meter.total - meter.done)))
    print(f"{counted(count, 'point')}, scan in {options.out}, cameras in {cameras_of(options.out)}")
    return 0


def _train(options: argparse.Namespace) -> int:
    if options.tune is not None:
        train_command.check(options)
        from viewer.tools.tuning.tune import tune

        tune(options.tune, options.out, quality=options.quality, minutes=10.0 if options.minutes is None else options.minutes,
             perceptual=options.perceptual, seed=options.seed, device=options.device)
        return 0
    return train_command.run(options)


def _evaluate(options: argparse.Namespace) -> int:
    from viewer.tools.heldout import evaluate_scan as withheld

    scans = [path for path in options.data if withheld.is_scan(path)]
    if scans and len(scans) < len(options.data):
        raise InputError(f"{scans[0]}: is a scan, the others are folders of rooms; judge it by itself")
    return withheld.run(options) if scans else evaluation_command.run(options)


def _doctor(options: argparse.Namespace) -> int:
    from viewer.doctor import examine, exit_code, format_text

    found = examine()
    print(json.dumps(found, indent=1) if options.json else format_text(found))
    return exit_code(found)


_LONGEST = 1500  # characters of a message

_RUN = {
    "view": _view, "demo": _demo, "render": _render, "info": _info, "convert": _convert, "bench": _bench,
    "simulate": _simulate, "train": _train, "evaluate": _evaluate, "doctor": _doctor,
}


def _interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: compiled loops turn it into a SystemError, some imports into an ImportError."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command and returns its exit code."""
    for stream in (sys.stdout, sys.stderr):  # a file's name may hold what a terminal's encoding does not
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] not in (*COMMANDS, "-h", "--help", "--version"):
        given.insert(0, "view")
    try:
        options = _parser().parse_args(given)
        if options.command != "train":
            # The network's threads sleep when they have done their share: software OpenGL needs the processors (2 to 5 % of a
            # neural frame).  A training has them to itself and took 5 to 60 % longer.  Not heard once torch is imported.
            os.environ.setdefault("OMP_WAIT_POLICY", "passive")
        return _RUN[options.command](options)
    except (KeyboardInterrupt, Cancelled):
        print("pointglass: stopped", file=sys.stderr)
        return 130
    except PointglassError as error:
        message, code = str(error), error.exit_code
    except BrokenPipeError:
        sys.stdout = None  # type: ignore[assignment]  # whoever read our output has gone: nothing more to say
        return 0
    except OSError as error:
        message, code = f"{error.filename or 'input/output'}: {error.strerror or error}", 2
    except Exception as error:
        if _interrupted(error):
            print("pointglass: stopped", file=sys.stderr)
            return 130
        kind = type(error)  # by name: importing these would load torch and moderngl
        if kind.__name__ in ("DataError", "WeightsError"):
            message, code = str(error), 2
        elif kind.__name__ == "Error" and kind.__module__ in ("moderngl", "_moderngl"):
            message, code = f"OpenGL: {error}; choose a smaller --size or --gpu-memory, and see `pointglass doctor`", 3
        else:
            raise
    print(f"pointglass: {_one_line(message)}", file=sys.stderr)
    return code


def _one_line(message: str) -> str:
    """A message as a line to be read: what a damaged file put into it may be long, or commands to the terminal.  It begins
    with the file and ends with the remedy."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 200]} ... {line[-200:]}"


if __name__ == "__main__":
    sys.exit(main())
