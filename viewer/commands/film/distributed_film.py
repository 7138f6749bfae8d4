"""The frames of a film, rendered by workers.  They write those of a folder; those of a video are encoded here, in their order.
"""

import argparse
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...common.files import out_folder
from ...common.replaced_files import replaced_told
from ...common.text import counted
from ...common.workers.run_tasks import Workers, run_tasks
from ...picture.edits import NO_EDITS, Edits
from ...work.pictures.film_titles import NO_TITLES, FilmTitles
from ..mesh_files import layers_of
from ..neural_setup import check_weights
from .encode import begin_folder, check_mp4, encode_mp4, frame_files, frames_left, write_frame
from .film_record import MP4, describe, folder_line, ingredients
from .frames import FrameMaker, check_form, rendered_cameras
from .opened_renderer import opened_renderer, opened_scene

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...picture.settings import Settings

_AHEAD = 32
"""Frames rendered beyond the one that is encoded next, in memory: 200 MB at 1920x1080."""


@dataclass(frozen=True)
class _Frames:
    """What each process opens.  size: of the frames.  returned: whether tasks return their pictures, or write them.
    cameras: of all that is rendered."""

    options: argparse.Namespace
    settings: "Settings"
    size: tuple[int, int]
    returned: bool
    edits: Edits
    titles: FilmTitles
    cameras: "Sequence[Camera]"

    @contextmanager
    def opened(self) -> "Iterator[Callable[[Camera], Any]]":
        check_weights(self.settings)
        options = self.options
        with opened_renderer(options, self.settings, self.cameras, say=False) as (scene, renderer):
            maker = FrameMaker(renderer, self.settings, self.size, options.supersample, options.panorama, options.background,
                               edits=self.edits, titles=self.titles)

            def write(camera: "Camera") -> None:
                picture = maker.picture(camera)
                write_frame(options.out, camera, picture, describe(scene, maker, camera))

            try:
                yield maker.picture if self.returned else write
            finally:
                maker.release()


def film_by_workers(options: argparse.Namespace, settings: "Settings", cameras: "Sequence[Camera]", rate: float,
                    workers: Workers, meshes: "Sequence[Path]" = (), titles: FilmTitles = NO_TITLES) -> str:
    """Makes the film; returns the line that tells a person what was made.  Raises PointglassError."""
    size = cameras[0].width, cameras[0].height
    check_form(size, options.supersample, panorama=options.panorama)
    video = options.out.suffix.lower() in MP4
    if video:
        check_mp4(options.out, size)
    rendered = rendered_cameras(cameras, options.supersample, panorama=options.panorama)
    scene = opened_scene(options, rendered, workers)  # where its grid is not in the cache yet, it is built once
    edits = Edits(meshes=layers_of(meshes, scene)) if meshes else NO_EDITS
    work = _Frames(options, settings, size, video, edits, titles, rendered)

    def results(asked: "Sequence[Camera]") -> "Generator[Any, None, None]":
        return run_tasks(work, asked, workers, label="filming", unit="frame", name=lambda camera: camera.name,
                         ahead=_AHEAD if video else None)

    if video:
        with closing(results(cameras)) as pictures:
            encode_mp4(options.out, pictures, size=size, fps=Fraction(rate).limit_denominator(1001))
        return f"{counted(len(cameras), 'frame')} at {rate:g} a second in {options.out}"
    made_of = ingredients(scene, cameras, settings, panorama=options.panorama, supersample=options.supersample,
                          background=options.background, edits=edits, titles=titles)
    with replaced_told(options.out / name for name in frame_files(cameras)):
        left = frames_left(options.out, cameras, made_of=made_of, resume=options.resume)
        with out_folder(options.out):
            begin_folder(options.out, made_of)
            for _ in results(left):
                pass
    return folder_line(options.out, len(cameras), len(left))
