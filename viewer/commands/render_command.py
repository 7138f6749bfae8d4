"""``pointglass render``: pictures of a list of cameras, made here or by workers."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..common.files import out_folder
from ..common.replaced_files import replaced_told
from ..common.text import counted
from ..common.workers.run_tasks import run_tasks
from ..common.workers.worker_choice import Workers
from ..readers.meshes.mesh_formats import scans_and_meshes
from .mesh_files import beside, with_meshes
from .neural_setup import check_weights
from .options import memory_of
from .photo_option import Photographs, UnplacedFolder, give_photographs, photographs_of_folder
from .render_pictures import check_aux, export_picture, export_pictures, parse_shard, parse_size, picture_files
from .workers_option import workers_of

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..picture.settings import Memory, Settings
    from ..picture.spec import PictureSpec
    from ..render.renderer import Renderer
    from ..work.pictures.shot_metadata import Shot


@dataclass(frozen=True)
class _Pictures:
    """What each process opens to make pictures.  options: of the command.  scans: its files that are no meshes.  shot: of
    ``--like``.  cameras: of all pictures, also those of other shards; none where all points are needed."""

    options: argparse.Namespace
    scans: list[Path]
    settings: "Settings"
    memory: "Memory"
    exposures: str
    shot: "Shot | None"
    cameras: "tuple[Camera, ...]"

    def scene(self, workers: Workers | None = None, *, say: bool = True) -> "Scene":
        """workers: who converts the files of a place.  say: as for open_scene_for."""
        from ..grid.open_scene import moves_as
        from ..stream.scene_in_view import open_scene_for
        from ..work.ghosts import prepared

        options, shot = self.options, self.shot
        scene = open_scene_for(self.scans, self.cameras, cache=not options.no_cache, match=self.exposures == "matched",
                               columns=options.columns, moves=moves_as(self.scans, shot.moves if shot else ()), say=say)
        return prepared(scene, shot.spec.edits.ghosts) if shot else scene

    @contextmanager
    def renderer(self, photographs: "Photographs | None", tell: "Callable[[Scene], object]", *,
                 say: bool = True) -> "Iterator[Renderer]":
        """tell: is given the scene before the renderer is made.  say: as for :meth:`scene`."""
        from ..render.device.context import create_context
        from ..render.renderer import Renderer

        context = create_context()
        scene = self.scene(say=say)
        tell(scene)
        renderer = Renderer(context, scene, memory=self.memory)
        renderer.choice.repeat(self.shot.raster if self.shot else "")
        give_photographs(renderer, self.settings, photographs)
        try:
            yield renderer
        finally:
            renderer.release()
            context.release()

    @contextmanager
    def opened(self) -> "Iterator[Callable[[PictureSpec], bool]]":
        """For run_tasks: makes a picture, and returns whether it was not there yet."""
        check_weights(self.settings)
        options = self.options
        with self.renderer(photographs_of_folder(self.settings), lambda scene: None, say=False) as renderer:
            yield lambda spec: export_picture(renderer, spec, options.out, aux=options.aux, exposures=self.exposures,
                                              resume=options.resume)


def run(options: argparse.Namespace, settings: "Settings", ready: Callable[[], object]) -> int:
    """The command.  ready: called once what the pictures need is loaded.  Returns the exit code.  Raises PointglassError."""
    from ..picture.spec import PictureSpec
    from ..work.cameras.camera_files import read_cameras
    from ..work.pictures.shot_metadata import read_shot

    workers, memory = workers_of(options), memory_of(options)
    scans, meshes = scans_and_meshes(options.scans)
    exposures, shot, size = options.exposures, None, parse_size(options.size) if options.size else None
    if options.like:
        shot = with_meshes(read_shot(options.like), meshes, scans, options.like)
        settings, exposures = shot.spec.settings, shot.exposures
        specs = [shot.spec if size is None else replace(shot.spec, camera=shot.spec.camera.resized(*size))]
    else:
        specs = [PictureSpec(camera, settings, background=options.background)
                 for camera in read_cameras(options.cameras, size=size)]
    cameras = tuple(spec.camera for spec in specs) if all(spec.plain for spec in specs) else ()
    part, parts = parse_shard(options.shard) if options.shard else (0, 1)
    specs = specs[part::parts]
    check_weights(settings)
    photographs = photographs_of_folder(settings)
    work = _Pictures(options, scans, settings, memory, exposures, shot, cameras)
    written = picture_files(options.out, [spec.camera for spec in specs], aux=options.aux)

    def tell(scene: "Scene") -> None:
        from ..grid.open_scene import say_degrees

        say_degrees(scene)
        if meshes and not shot:
            specs[:] = beside(specs, meshes, scene)
        if shot:
            _tell_differences(options.like, scene, shot, exposures)

    if workers is None:
        with work.renderer(photographs, tell) as renderer:
            ready()
            with replaced_told(written):
                count = export_pictures(renderer, specs, options.out, aux=options.aux, exposures=exposures,
                                        resume=options.resume)
    else:
        tell(work.scene(workers))  # where its grid is not in the cache yet, it is built once
        if isinstance(photographs, UnplacedFolder):
            with work.renderer(photographs, lambda scene: None, say=False):  # places them once; each worker reads the cache
                pass
        check_aux(specs, aux=options.aux)
        ready()
        with replaced_told(written), out_folder(options.out):
            count = sum(run_tasks(work, specs, workers, label="rendering", unit="picture", name=lambda spec: spec.camera.name))
    there = f" ({counted(len(specs) - count, 'picture')} already there)" if count < len(specs) else ""
    print(f"{counted(len(specs), 'picture')} in {options.out}{there}")
    return 0


def _tell_differences(like: Path, scene: "Scene", shot: "Shot", exposures: str) -> None:
    from ..work.pictures.shot_metadata import describe_shot, differences

    for line in differences(shot, describe_shot(scene, shot.spec, exposures=exposures)):
        print(f"pointglass: {like}: {line}; the picture may differ", file=sys.stderr)
