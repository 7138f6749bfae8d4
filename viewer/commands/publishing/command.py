"""``pointglass publish``: a folder that any browser shows: panoramas to look around in, to walk through and to measure on."""

import argparse
import logging
from pathlib import Path

from ...common.text import bytes_text, counted, with_whole_characters
from ...picture.settings import Settings
from ...picture.views import VIEWS
from ...preprocess.scan_description import ScanWarning, WarningTopic
from ..options import memory_of

_log = logging.getLogger(__name__)

SIDES = (512, 1024, 2048)
"""Pixels of a cube's face."""
VIEWS_SHOWN = "filled", "neural"
"""In the others there are holes."""
_SECOND = [name for name, view in VIEWS.items() if "network" not in view.passes]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans, settings and memory."""
    parser.add_argument("--out", type=Path, required=True, metavar="DIR",
                        help="a new or empty folder, or an earlier publication; open index.html in it with a browser")
    parser.add_argument("--places", default="auto", metavar="N|viewpoints|stations",
                        help="where panoramas are made: at most N planned places from which every surface is seen, the "
                             "project's viewpoints, or the scanner positions (default: scanner positions where known, else "
                             "viewpoints, else planned)")
    parser.add_argument("--face-size", type=int, choices=SIDES, default=1024,
                        help="pixels of a side of the six pictures around a place (default 1024)")
    parser.add_argument("--second", choices=[*_SECOND, "none"], default="raw",
                        help="a second view, shown beside the first by a handle (default raw)")
    parser.add_argument("--title", default="", metavar="TEXT", help="of the page (default: the name of the scan or project)")


def _warn(text: str) -> None:
    _log.warning("%s", ScanWarning(text, WarningTopic.LEFT_OUT))


def run(options: argparse.Namespace, settings: Settings) -> int:
    """The command.  Returns the exit code.  Raises PointglassError."""
    from .places import chosen_places, parse_places
    from .publication import Form, Publication, check_folder

    wanted = parse_places(options.places)
    check_folder(options.out)
    from ...render.described_picture import Composer
    from ...render.device.context import create_context
    from ...render.renderer import Renderer
    from ...work.project import is_project
    from ..open_project import opened

    context = create_context()
    scene, document = opened(options)
    renderer, composer = Renderer(context, scene, memory=memory_of(options)), Composer(context)
    try:
        places = chosen_places(scene, document, wanted)
        form = Form(side=options.face_size, second=None if options.second == "none" else options.second)
        project = options.scans[0] if is_project(options.scans[0]) else None
        title = with_whole_characters(options.title or options.scans[0].resolve().stem)
        made = Publication(scene, document, settings, places, options.out, title, form, project)
        rendered, size = made.write(renderer, composer, _warn)
    finally:
        composer.release()
        renderer.release()
        context.release()
    kept = f", {len(places) - rendered:,} kept" if rendered < len(places) else ""
    print(f"{counted(len(places), 'place')}{kept}, {bytes_text(size)}: open {options.out / 'index.html'}")
    return 0


