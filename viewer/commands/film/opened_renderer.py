"""The scene of a command's options, and what draws it."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ...common.workers.worker_choice import Workers
from ..options import memory_of
from ..photo_option import give_photographs, photographs_of_folder

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...picture.settings import Settings
    from ...render.renderer import Renderer


@contextmanager
def opened_renderer(options: argparse.Namespace, settings: "Settings", cameras: "Sequence[Camera]", *,
                    say: bool = True) -> "Iterator[tuple[Scene, Renderer]]":
    """The scene of the options, and what draws it.  cameras, say: as for opened_scene.  Raises PointglassError."""
    photographs = photographs_of_folder(settings)
    from ...render.device.context import create_context
    from ...render.renderer import Renderer

    context = create_context()
    scene = opened_scene(options, cameras, say=say)
    renderer = Renderer(context, scene, memory=memory_of(options))
    give_photographs(renderer, settings, photographs)
    try:
        yield scene, renderer
    finally:
        renderer.release()
        context.release()


def opened_scene(options: argparse.Namespace, cameras: "Sequence[Camera]", workers: Workers | None = None, *,
                 say: bool = True) -> "Scene":
    """The scene of the options.  cameras, say: as for viewer.stream.scene_in_view.  workers: who converts the files of a place.
    Raises InputError."""
    from ...grid.open_scene import say_degrees
    from ...stream.scene_in_view import open_scene_for

    scene = open_scene_for(options.scans, cameras, cache=not options.no_cache, match=options.exposures == "matched",
                           columns=options.columns, workers=workers, say=say)
    say_degrees(scene)
    return scene
