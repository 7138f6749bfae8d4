"""The commands of the command line: what each is for, and its options.  What they do is in viewer.cli."""

import argparse
from collections.abc import Callable
from pathlib import Path

from . import __version__
from .commands.options import Parser, add_columns, add_exposures, add_logging, add_memory, add_scans, add_settings
from .commands.workers_option import add_workers
from .picture.settings import BACKGROUNDS
from .readers.formats import KNOWN_FILES, KNOWN_FOLDERS


def _view_options(parser: argparse.ArgumentParser) -> None:
    add_scans(parser, least="*")
    add_exposures(parser)
    add_settings(parser)
    add_memory(parser)


def _demo_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR",
                        help="folder for the pictures, where there is no display (default out/demo)")
    add_settings(parser)


def _render_options(parser: argparse.ArgumentParser) -> None:
    from .work.cameras.camera_files import KNOWN_CAMERAS

    add_scans(parser)
    add_exposures(parser)
    cameras = parser.add_mutually_exclusive_group(required=True)
    cameras.add_argument("--cameras", type=Path, metavar="F", help=KNOWN_CAMERAS)
    cameras.add_argument("--like", type=Path, metavar="SHOT.png",
                         help="draw a picture again that pointglass saved: with its camera, settings, background and exposures")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR",
                        help="folder for the pictures, one NAME.png for each camera")
    parser.add_argument("--size", metavar="WxH", help="picture size in pixels (default: that of each camera)")
    parser.add_argument("--aux", action="store_true", help="also write depth, mask, provenance and statistics of each picture")
    texts = "; ".join(f"{key}: {text}" for key, text in BACKGROUNDS.items())
    parser.add_argument("--background", choices=list(BACKGROUNDS), default="black",
                        help=f"what is shown where there is no surface: {texts} (default black)")
    parser.add_argument("--shard", metavar="i/n", help="render only every n-th camera, starting with camera i (from 0)")
    parser.add_argument("--resume", action="store_true",
                        help="leave out cameras whose files in DIR are complete and were made from the same scan, camera and "
                             "settings")
    add_workers(parser, "pictures")
    add_settings(parser)
    add_memory(parser)


def _video_options(parser: argparse.ArgumentParser) -> None:
    from .commands.film.command import add_arguments

    add_scans(parser)
    add_exposures(parser)
    add_arguments(parser)
    add_settings(parser)
    add_memory(parser)


def _export_options(parser: argparse.ArgumentParser) -> None:
    from .commands.exporting.command import add_arguments

    add_scans(parser)
    add_exposures(parser, default="as-scanned")
    add_arguments(parser)


def _section_options(parser: argparse.ArgumentParser) -> None:
    from .commands.section.command import add_arguments

    add_scans(parser)
    add_exposures(parser)
    add_arguments(parser)


def _report_options(parser: argparse.ArgumentParser) -> None:
    from .commands.report.command import add_arguments

    add_exposures(parser)
    add_arguments(parser)


def _publish_options(parser: argparse.ArgumentParser) -> None:
    from .commands.publishing.command import add_arguments

    add_scans(parser)
    add_exposures(parser)
    add_arguments(parser)
    add_settings(parser)
    add_memory(parser)


def _align_options(parser: argparse.ArgumentParser) -> None:
    from .commands.align import add_arguments

    add_arguments(parser)


def _compare_options(parser: argparse.ArgumentParser) -> None:
    from .commands.comparing.command import add_arguments

    add_arguments(parser)


def _info_options(parser: argparse.ArgumentParser) -> None:
    add_scans(parser)
    parser.add_argument("--json", action="store_true", help="print everything that is known, as JSON")
    parser.add_argument("--plan", type=Path, metavar="FILE.html",
                        help="also write a page for a browser: a plan with the outline and name of each file, dates and points")


def _convert_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scans", nargs="+", type=Path, metavar="SCAN",
                        help=f"{KNOWN_FILES} files, {KNOWN_FOLDERS} folders, or https:// and s3:// addresses of these; several "
                             "become one grid, with --each one grid each")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR",
                        help="a new or empty folder for the grid; pointglass opens it like a scan")
    parser.add_argument("--each", action="store_true",
                        help="build one grid for each scan (SCAN may be a folder of scans) in DIR/NAME; grids that are up to "
                             "date are kept")
    parser.add_argument("--shard", metavar="i/n",
                        help="with --each: convert only every n-th scan, starting with scan i (from 0)")
    add_workers(parser, "files",
                "as many as processors and memory allow for --each, else this process")
    add_columns(parser)
    add_exposures(parser)


def _bench_options(parser: argparse.ArgumentParser) -> None:
    from .bench import add_arguments

    add_arguments(parser)
    add_settings(parser, views=())


def _simulate_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.laz",
                        help="the scan, .laz or .las; eight cameras for `render` are written beside it, as FILE_cameras.json")
    parser.add_argument("--points", type=int, default=1_200_000, metavar="N",
                        help="number of points, at least 1000 (default 1200000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N",
                        help="random seed; another seed gives another place (default 1)")


def _train_options(parser: argparse.ArgumentParser) -> None:
    from ..model.train.command import add_arguments

    add_arguments(parser)
    parser.add_argument("--tune", type=Path, metavar="SCAN",
                        help="adapt the shipped weights to a scan, in minutes (default 10): to the photographs inside an E57, "
                             "otherwise to points withheld from the scan")


def _evaluate_options(parser: argparse.ArgumentParser) -> None:
    from ..model.evaluation.command import add_arguments

    add_arguments(parser)
    add_workers(parser, "views")


def _doctor_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print the same as JSON")


_COMMANDS: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None]]] = {
    "view": ("open the window (the same as `pointglass SCAN`)", _view_options),
    "demo": ("show the shipped scan, in a window or as pictures", _demo_options),
    "render": ("render pictures of a list of cameras", _render_options),
    "video": ("film a camera path as a video, a sequence of pictures or a panorama", _video_options),
    "export": ("write the measured points, or those in boxes, as LAZ, LAS, PLY or E57; or Gaussian splats", _export_options),
    "section": ("draw a plan, an elevation or a section to scale, as PNG, PDF or DXF", _section_options),
    "report": ("write viewpoints, notes and measurements of a project as PDF, its notes as BCF or CSV", _report_options),
    "publish": ("write a folder that any browser shows: panoramas to walk through and to measure on", _publish_options),
    "align": ("move a scan to its place beside another, by pairs of points and by surfaces (ICP)", _align_options),
    "compare": ("measure what changed between two scans of one place: points, table and picture", _compare_options),
    "info": ("show what a scan contains", _info_options),
    "convert": ("build the grid of a scan in a folder", _convert_options),
    "bench": ("measure run time, errors and stability", _bench_options),
    "simulate": ("scan a procedural place with a virtual scanner", _simulate_options),
    "train": ("train the network on registered rooms", _train_options),
    "evaluate": ("judge pictures against registered pictures, or against points withheld from a scan", _evaluate_options),
    "doctor": ("show what works on this machine, what is used, and what to do", _doctor_options),
}
"""Of each command: its line in the list of commands and, as a sentence, above its options; and what adds its options."""
COMMANDS = tuple(_COMMANDS)


def make_parser(only: str | None = None) -> argparse.ArgumentParser:
    """The whole command line.

    only: the one command whose options are added, None: all.  Adding the options of bench, train and evaluate imports them.
    """
    parser = Parser(prog="pointglass", description="Fly through a raw coloured laser scan as if it were a film of the place.")
    parser.add_argument("--version", action="version", version=f"pointglass {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)
    for name, (text, add_options) in _COMMANDS.items():
        command = commands.add_parser(name, help=text, description=f"{text[:1].upper()}{text[1:]}.")
        if only is None or name == only:
            add_options(command)
            add_logging(command)
    return parser
