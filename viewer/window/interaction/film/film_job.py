"""A film rendered beside the window: on a thread, with an OpenGL context and a renderer of its own."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ....commands.film.command import MP4, film
from ....commands.film.resumed_video import remove_frames
from ....common.errors import Cancelled, InputError
from ....picture.edits import NO_EDITS, Edits
from ....picture.settings import Settings
from ....work.ghosts import prepared
from ....work.pictures.film_titles import NO_TITLES, FilmTitles
from ...kit.worker import BESIDE, Worker
from ...planning.folder_photographs import give_folder
from ...saving.capture import name_kept, unwritable

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ....picture.camera import Camera


@dataclass(frozen=True)
class FilmJob:
    """All that a film is made of, taken when it is started: later changes in the window do not reach it."""

    scene: "Scene | None"
    cameras: "tuple[Camera, ...]"
    fps: float
    settings: Settings
    out: Path
    panorama: bool = False
    supersample: int = 1
    background: str = "black"
    edits: Edits = NO_EDITS
    titles: FilmTitles = NO_TITLES

    def render(self) -> str:
        """Makes the film; frames of the same film that are there are kept: those of a folder, and of a video that a crash
        interrupted.  Returns what was made, in words.

        Raises PointglassError.
        """
        self.titles.check()
        if self.scene is None or not self.cameras:
            raise InputError("a film needs a scan and a keyframe", remedy="add a keyframe first")
        if self.out.suffix.lower() not in MP4:
            return self._render(self.scene)
        with name_kept(self.out):
            try:
                return self._render(self.scene)
            except Cancelled:
                remove_frames(self.out)
                raise

    def _render(self, scene: "Scene") -> str:
        from ....render.device.context import create_context
        from ....render.renderer import Renderer

        if self.settings.view == "neural":
            from .....model.common.process.torch_process import prepare_inference

            prepare_inference()
        context = create_context()
        try:
            scene = prepared(scene, self.edits.ghosts)
            renderer = Renderer(context, scene)
            try:
                give_folder(renderer, self.settings.photos)
                return film(scene, renderer, self.cameras, self.fps, self.settings, self.out, panorama=self.panorama,
                            supersample=self.supersample, background=self.background, edits=self.edits, resume=True,
                            titles=self.titles)
            except OSError as error:  # of the folder's record
                raise unwritable(self.out, error) from None
            finally:
                renderer.release()
        finally:
            context.release()


def film_worker(job: FilmJob, wake: Callable[[], None]) -> Worker:
    """Starts a film; its progress counts frames, and cancelling leaves no half file."""
    return Worker(job.render, "Rendering the film", wake, niceness=BESIDE)
