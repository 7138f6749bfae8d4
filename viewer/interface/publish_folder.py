"""Publishes a scan for browsers from Python, as ``pointglass publish`` does."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..commands.publishing.command import SIDES, second_view
from ..commands.publishing.own_files import check_folder
from ..commands.publishing.place_choice import parse_places
from ..commands.publishing.places import chosen_places
from ..commands.publishing.publication import Form, Publication
from ..common.errors import InputError
from ..common.text import with_whole_characters
from ..picture.views import VIEWS
from ..work.document import Document
from .arguments import settings_of

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..render.renderer import Renderer

_log = logging.getLogger(__name__)


def publish_folder(scene: Scene, renderer: Renderer, folder: Path, at: object, view: object, size: object, title: str,
                   prepare_network: Callable[[], object]) -> int:
    """See Scan.publish; arguments of wrong kinds are refused here.  The context of the renderer is the current one.
    prepare_network: called before a neural view."""
    from ..render.described_picture import Composer

    if not isinstance(view, str) or view not in VIEWS:
        raise InputError(f"expected {', '.join(VIEWS)}", option="view", value=view)
    if not isinstance(size, int) or size not in SIDES:
        raise InputError(f"expected {', '.join(map(str, SIDES))}", option="size", value=size)
    wanted = parse_places(os.fspath(at) if isinstance(at, os.PathLike) else "" if isinstance(at, bool) else str(at))
    check_folder(folder)
    if view == "neural":
        prepare_network()
    document, settings = Document(), settings_of(view, {})
    chosen = chosen_places(scene, document, wanted)
    composer = Composer(renderer.context)
    try:
        form = Form(size, second=second_view(view))
        made = Publication(scene, document, settings, chosen, folder, with_whole_characters(title), form)
        made.write(renderer, composer, lambda text: _log.warning("%s", text))
    finally:
        composer.release()
    return len(chosen)
