"""The scene of a command's options, and what draws it."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ...common.workers.worker_choice import Workers
from ..options import memory_of
from ..photo_option import give_photographs, photographs_of_folder

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.settings import Settings
    from ...render.renderer import Renderer


@contextmanager
def opened_renderer(options: argparse.Namespace, settings: "Settings") -> "Iterator[tuple[Scene, Renderer]]":
    """The scene of the options, and what draws it.  Raises PointglassError."""
    photographs = photographs_of_folder(settings)
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    context = create_context()
    scene = opened_scene(options)
    renderer = Renderer(context, scene, memory=memory_of(options))
    give_photographs(renderer, settings, photographs)
    try:
        yield scene, renderer
    finally:
        renderer.release()
        context.release()


def opened_scene(options: argparse.Namespace, workers: Workers | None = None) -> "Scene":
    """The scene of the options.  workers: who converts the files of a place.  Raises InputError."""
    from ...grid.open_scene import open_scene, say_degrees

    scene = open_scene(options.scans, cache=not options.no_cache, match=options.exposures == "matched", columns=options.columns,
                       workers=workers)
    say_degrees(scene)
    return scene
