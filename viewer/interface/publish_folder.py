"""Publishes a scan for browsers from Python, as ``pointglass publish`` does."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..commands.publishing.command import VIEWS_SHOWN
from ..commands.publishing.places import chosen_places, parse_places
from ..commands.publishing.publication import Publication, check_folder
from ..common.errors import InputError
from ..common.text import with_whole_characters
from ..work.document import Document
from .arguments import settings_of

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..render.renderer import Renderer

_log = logging.getLogger(__name__)


def publish_folder(scene: Scene, renderer: Renderer, folder: Path, places: str | int, view: str, title: str,
                   prepare_network: Callable[[], object]) -> int:
    """See Scan.publish.  The context of the renderer is the current one.  prepare_network: called before a neural view."""
    from ..render.described_picture import Composer

    if view not in VIEWS_SHOWN:
        raise InputError(f"expected {' or '.join(VIEWS_SHOWN)}", option="view", value=view)
    wanted = parse_places(str(places))
    check_folder(folder)
    if view == "neural":
        prepare_network()
    document, settings = Document(), settings_of(view, {})
    chosen = chosen_places(scene, document, wanted)
    composer = Composer(renderer.context)
    try:
        made = Publication(scene, document, settings, chosen, folder, with_whole_characters(title))
        made.write(renderer, composer, lambda text: _log.warning("%s", text))
    finally:
        composer.release()
    return len(chosen)
