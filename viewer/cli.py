"""The command line: turns what a person types into calls, and every anticipated failure into one line and an exit code.

Exit codes: 0 done; 1 a bench found a claim broken; 2 bad usage or input; 3 no usable OpenGL or device; 130 stopped by Ctrl-C or
SIGTERM.  Nothing imports this module, and it imports nothing heavy before a command needs it.
"""

import argparse
import contextlib
import gc
import json
import os
import sys
import threading
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path

from ..model.common.files.temporary import sweep_recorded
from ..model.common.loop_cache import NOTICE
from .command_table import COMMANDS, make_parser
from .commands.neural_setup import check_weights
from .commands.options import memory_of, settings_of
from .commands.photo_option import check_photographs
from .commands.workers_option import own_cache, workers_of
from .common.command_log import logging_to
from .common.errors import InputError
from .common.failures import report, tell
from .common.partial_torch import let_scipy_meet_torch
from .common.progress import progress
from .common.replaced_files import replaced_told
from .common.text import counted, escaped_output
from .readers.remote.address import is_address


def _view(options: argparse.Namespace) -> int:
    for path in options.scans:
        if not any(other.exists() or is_address(other) for other in options.scans):
            raise InputError("no such file, folder or command (see `pointglass --help`)", file=path)
    if any(path.suffix.lower() == ".pointglass" for path in options.scans):
        from .work.project import check_projects

        check_projects(options.scans, ask=True)  # refused before a window opens
    elif options.scans:
        from .readers.meshes.mesh_formats import scans_and_meshes

        scans_and_meshes(options.scans)  # meshes alone likewise
    if options.scans:
        _preload()
    if len(options.scans) == 1 and is_address(options.scans[0]):
        from .readers.remote.fetch import fetch_ahead

        fetch_ahead(options.scans[0])
    check_photographs(settings := settings_of(options))  # likewise before a window opens
    from .window.shell.run_window import run

    return run(options.scans, settings, cache=not options.no_cache, match=options.exposures == "matched",
               memory=memory_of(options), columns=options.columns, started=_end_of_start)


def _preload() -> None:
    """Imports, on another thread, what the first picture needs, while this one opens the window and the driver makes a context.

    scipy.ndimage is for views in the open (viewer.render.culling.occupancy).  Errors come again, and are reported, where it is
    used.
    """

    def load() -> None:
        with contextlib.suppress(Exception):
            from .render import renderer  # isort: skip  # noqa: F401
            import scipy.ndimage  # isort: skip  # noqa: F401

    threading.Thread(target=load, name="pointglass preload", daemon=True).start()


def _demo(options: argparse.Namespace) -> int:
    from .commands.demo import demo_camera, demo_pictures, demo_scan, has_display

    settings = settings_of(options)
    if has_display():
        from .window.shell.run_window import run

        return run([demo_scan()], settings, start=demo_camera())
    from ..model.common.process.torch_process import prepare_inference

    prepare_inference()
    files = demo_pictures(options.out, settings)
    print(f"no display here: {len(files) - 1} pictures (raw, filtered, filled, neural) in {options.out.resolve()}")
    print(f"look at {files[0].resolve()} first")
    return 0


def _render(options: argparse.Namespace) -> int:
    from .commands.render_command import run

    check_photographs(settings := settings_of(options))
    return run(options, settings, _end_of_start)


def _video(options: argparse.Namespace) -> int:
    from .commands.film.command import run

    check_photographs(settings := settings_of(options))
    check_weights(settings)
    return run(options, settings)


def _publish(options: argparse.Namespace) -> int:
    from .commands.publishing.command import run

    check_photographs(settings := settings_of(options))
    check_weights(settings)
    return run(options, settings)


def _plain(options: argparse.Namespace) -> int:
    """Commands that are one module's ``run``."""
    if options.command == "export":
        from .commands.exporting.command import run
    elif options.command == "section":
        from .commands.section.command import run
    elif options.command == "report":
        from .commands.report.command import run
    elif options.command == "align":
        from .commands.align import run
    elif options.command == "info":
        from .commands.show_info import run
    else:
        from .commands.comparing.command import run
    return run(options)


def _convert(options: argparse.Namespace) -> int:
    from .commands.convert import convert, convert_each

    workers = workers_of(options)
    if options.each or options.shard:
        from .commands.render_pictures import parse_shard

        shard = parse_shard(options.shard) if options.shard else (0, 1)
        with replaced_told(options.out.iterdir() if options.out.is_dir() else ()):
            made = convert_each(options.scans, options.out, shard=shard, match=options.exposures == "matched",
                                columns=options.columns, workers=workers)
        print(f"{counted(len(made), 'grid')} in {options.out}")
        return 0
    convert(options.scans, options.out, match=options.exposures == "matched", columns=options.columns, workers=workers)
    print(f"grid in {options.out}")
    return 0


def _bench(options: argparse.Namespace) -> int:
    from .bench import run_bench

    return run_bench(options, settings_of(options))


def _simulate(options: argparse.Namespace) -> int:
    from ..model.synth.demo import cameras_of, check, main

    check(options.out, options.points, options.seed)
    with progress(int(1.1 * options.points), "scanning", " pulses") as meter:
        count = main(options.out, options.points, options.seed, step=lambda n: meter.update(min(n, meter.total - meter.done)))
    print(f"{counted(count, 'point')}, scan in {options.out}, cameras in {cameras_of(options.out)}")
    return 0


def _train(options: argparse.Namespace) -> int:
    from ..model.train import command as train_command

    if options.tune is not None:
        train_command.check(options)
        from ..model.common.process.torch_process import prepare_training
        from .commands.tuning.tune import tune

        prepare_training()
        tune(options.tune, options.out, quality=options.quality, minutes=10.0 if options.minutes is None else options.minutes,
             perceptual=options.perceptual, seed=options.seed, device=options.device)
        return 0
    return train_command.run(options)


def _evaluate(options: argparse.Namespace) -> int:
    from ..model.evaluation import command as evaluation_command
    from .commands.heldout import evaluate_scan as withheld

    scans = [path for path in options.data if withheld.is_scan(path)]
    if scans and len(scans) < len(options.data):
        raise InputError("is a scan, but the others are folders of rooms", file=scans[0], remedy="evaluate it alone")
    if scans:
        return withheld.run(options)
    if (workers := workers_of(options)) is not None:
        from .common.workers.run_tasks import run_tasks

        def share(rooms, tasks):
            return run_tasks(rooms, tasks, workers, label="evaluating", unit=" views",
                             name=lambda task: f"{rooms.folders[task[0]].name}, view {task[1]}")  # fmt: skip

        return evaluation_command.run(options, share)
    return evaluation_command.run(options)


def _doctor(options: argparse.Namespace) -> int:
    from .doctor import examine, exit_code, format_text

    found = examine()
    print(json.dumps(found, indent=1) if options.json else format_text(found))
    return exit_code(found)


_LONGEST = 1500  # characters of a message
_RUN = {
    "view": _view, "demo": _demo, "render": _render, "video": _video, "publish": _publish, "convert": _convert,
    "bench": _bench, "simulate": _simulate, "train": _train, "evaluate": _evaluate, "doctor": _doctor,
    **dict.fromkeys(("info", "export", "section", "report", "align", "compare"), _plain),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command and returns its exit code.  arguments: without the program's name; None: those of the process."""
    for stream in (sys.stdout, sys.stderr):  # a file name may hold characters that a terminal's encoding lacks
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    let_scipy_meet_torch()
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] not in (*COMMANDS, "-h", "--help", "--version"):
        given.insert(0, "view")
    with escaped_output():
        try:
            options = make_parser(given[0]).parse_args(given)
            if options.command != "train":
                # Threads of the network sleep while they wait: software OpenGL needs the processors (2 to 5 % of a neural
                # frame).  Training needs them for itself and took 5 to 60 % longer.  torch reads this when it is imported.
                os.environ.setdefault("OMP_WAIT_POLICY", "passive")
                # Those of OpenBLAS, of which NumPy and SciPy bring one each, spun for 0.1 s of a processor when they were
                # loaded, each beside the imports of a start; now for 2**4 cycles.
                os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")
            NOTICE.tell = tell
            with logging_to(verbose=options.verbose, file=options.log_file, arguments=given):
                return _run_logged(options)
        except BrokenPipeError:
            sys.stdout = None  # type: ignore[assignment]  # whoever read the output has gone
            return 0
        except BaseException as error:  # raised while the command line was parsed, or the log file opened or closed
            if isinstance(error, SystemExit) or (code := report(error)) is None:
                raise
            return code


def _run_logged(options: argparse.Namespace) -> int:
    """Runs a command; the log gets the traceback of what fails, the person one line."""
    try:
        if options.command not in ("render", "view"):  # which do without garbage collection until their first picture
            _end_of_start()
        sweep_recorded()
        with own_cache(options), replaced_told(_files_of(options)):
            code = _RUN[options.command](options)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except (Exception, KeyboardInterrupt) as error:
        from .readers.remote.local_copies import name_by_address

        name_by_address(error)
        if (code := report(error)) is None:
            raise
        return code


def _files_of(options: argparse.Namespace) -> list[Path]:
    """The files, and the grid, that a command line names to be written."""
    given = [getattr(options, name, None) for name in ("out", "json", "plot", "worst", "plan")]
    found = [path for path in given if isinstance(path, Path)]
    if options.command == "simulate":
        from ..model.synth.demo import cameras_of

        found.append(cameras_of(options.out))
    return found


def _end_of_start() -> None:
    """Turns on the garbage collection that ``viewer.__main__`` turned off; what was loaded so far is exempt from it."""
    gc.freeze()
    gc.enable()


if __name__ == "__main__":
    sys.exit(main())
