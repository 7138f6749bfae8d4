"""``pointglass publish``: a folder that any browser shows: panoramas to look around in, to walk through and to measure on."""

import argparse
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...common.errors import InputError
from ...common.text import bytes_text, counted, with_whole_characters
from ...picture.settings import Settings
from ...picture.views import VIEWS
from ...preprocess.scan_description import ScanWarning, WarningTopic
from ...work.cameras.camera_files import KNOWN_CAMERAS
from ..comparing.published_change import CHANGE
from ..neural_setup import check_weights
from ..options import memory_of
from ..photo_option import give_photographs, photographs_of_folder
from ..workers_option import add_workers, workers_of
from .place_choice import PLANNED, parse_places

if TYPE_CHECKING:
    from ...common.workers.worker_choice import Workers
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...render.described_picture import Composer
    from ...render.renderer import Renderer
    from ...work.document import Document
    from .place_choice import PlaceChoice
    from .places import Place
    from .publication import Form

_log = logging.getLogger(__name__)

SIDES = (512, 1024, 2048)
"""Pixels of a cube's face."""
_SECOND = [name for name, view in VIEWS.items() if "network" not in view.passes]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options besides scans, settings and memory."""
    parser.add_argument("--out", type=Path, required=True, metavar="DIR",
                        help="a new or empty folder, or an earlier publication; open index.html in it with a browser")
    parser.add_argument("--at", "--places", default="auto", metavar="auto|stations|viewpoints|FILE|N",
                        help="where panoramas are made: stations: the scanner positions; viewpoints: the project's; FILE: "
                             f"where its cameras stand ({KNOWN_CAMERAS}); N: at most N planned places from which every "
                             "surface is seen; auto: the stations where they are known, else the viewpoints, else at most "
                             f"{PLANNED} planned places (default auto)")
    parser.add_argument("--size", "--face-size", type=int, choices=SIDES, default=1024,
                        help="pixels of a side of the six pictures around a place (default 1024)")
    parser.add_argument("--second", choices=[*_SECOND, CHANGE, "none"],
                        help=f"a second view, shown beside the first by a handle; {CHANGE}: the distances of the comparison "
                             f"that the project shows, with legend and histogram (default: {CHANGE} where there is one, else "
                             "raw, none where the first is raw)")
    add_workers(parser, "places")
    parser.add_argument("--title", default="", metavar="TEXT",
                        help="of the page (default: the name of the scan or project; of several, of the first)")


def second_view(view: str, asked: str | None = None, document: "Document | None" = None) -> str | None:
    """The view beside ``view``, None for none.  asked: of the option.  document: whose comparison may be that view.  Raises
    InputError where it is the same, or a comparison that is not there."""
    compared = document is not None and document.comparison is not None
    if asked == CHANGE and not compared:
        raise InputError("there is no comparison", option="--second", value=asked,
                         remedy="give a project in which Compare shows one")
    if asked == CHANGE or (asked is None and compared):
        return CHANGE
    if asked == view:
        raise InputError("is the first view already", option="--second", value=asked, remedy="give another view, or none")
    return None if asked == "none" or (asked is None and view == "raw") else asked or "raw"


def _warn(text: str) -> None:
    _log.warning("%s", ScanWarning(text, WarningTopic.LEFT_OUT))


def _cameras(document: "Document", *, wanted: "PlaceChoice", side: int) -> "list[Camera]":
    """The cameras of the places, where they are known before the scan is read; else none."""
    import numpy as np

    from .cube_faces import rendered_faces

    if isinstance(wanted, tuple):
        positions = [camera.position for camera in wanted if camera.orthographic is None]
    elif wanted == "viewpoints":
        positions = [np.array(view.camera_to_world)[:3, 3] for view in document.viewpoints if view.orthographic is None]
    else:
        positions = []
    return [camera for position in positions for camera in rendered_faces(position, side, document.up)]


def _opened(options: argparse.Namespace, *, workers: "Workers | None" = None, say: bool = True) -> "tuple[Scene, Document]":
    """As viewer.commands.open_project.opened, for the places that are asked for."""
    from ..open_project import opened

    return opened(options, meshes=True, workers=workers, say=say,
                  cameras=partial(_cameras, wanted=parse_places(options.at), side=options.size))


@contextmanager
def _opened_renderer(options: argparse.Namespace, settings: Settings, *,
                     say: bool = True) -> "Iterator[tuple[Scene, Document, Renderer, Composer]]":
    from ...render.described_picture import Composer
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    photographs = photographs_of_folder(settings)
    context = create_context()
    scene, document = _opened(options, say=say)
    renderer, composer = Renderer(context, scene, memory=memory_of(options)), Composer(context)
    give_photographs(renderer, settings, photographs)
    try:
        yield scene, document, renderer, composer
    finally:
        composer.release()
        renderer.release()
        context.release()


@dataclass(frozen=True)
class _Places:
    """What each worker opens to make places, which it is given by their numbers."""

    options: argparse.Namespace
    settings: Settings
    places: "list[Place]"
    form: "Form"

    @contextmanager
    def opened(self) -> "Iterator[Callable[[int], Any]]":
        from .publication import Publication

        check_weights(self.settings)
        with _opened_renderer(self.options, self.settings, say=False) as (scene, document, renderer, composer):
            made = Publication(scene, document, self.settings, self.places, self.options.out, "", self.form)
            yield lambda number: made.write_place(number, renderer, composer)


def run(options: argparse.Namespace, settings: Settings) -> int:
    """The command.  Returns the exit code.  Raises PointglassError."""
    from .own_files import check_folder
    from .places import chosen_places
    from .publication import Form, Publication

    wanted, workers = parse_places(options.at), workers_of(options)
    check_folder(options.out)
    from ...work.project import is_project

    if options.second == settings.view:
        second_view(settings.view, options.second)  # refused before scans are read

    def publication(scene: "Scene", document: "Document") -> Publication:
        form = Form(side=options.size, second=second_view(settings.view, options.second, document))
        places = chosen_places(scene, document, wanted)
        project = options.scans[0] if is_project(options.scans[0]) else None
        more = len(options.scans) - 1
        title = options.title or options.scans[0].resolve().stem + (f" and {more:,} more" if more else "")
        return Publication(scene, document, settings, places, options.out, with_whole_characters(title), form, project)

    if workers is None:
        with _opened_renderer(options, settings) as (scene, document, renderer, composer):
            made = publication(scene, document)
            rendered, size = made.write(renderer, composer, _warn)
    else:
        made = publication(*_opened(options, workers=workers))  # builds a grid that is not in the cache once
        rendered, size = made.write_by(_Places(options, settings, made.places, made.form), workers, _warn)
    places = made.places
    kept = f", {len(places) - rendered:,} kept" if rendered < len(places) else ""
    print(f"{counted(len(places), 'place')}{kept}, {bytes_text(size)}: open {options.out / 'index.html'}")
    return 0


