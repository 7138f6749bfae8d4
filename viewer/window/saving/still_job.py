"""A still rendered beside the window: F12 at two to four times the size, and panoramas.

It has a thread, an OpenGL context and a renderer of its own, so that the window stays usable meanwhile.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ...work.ghosts import prepared
from ...work.pictures.shot_metadata import KEY, Shot, cannot_repeat
from ..kit.worker import BESIDE, Worker
from ..planning.folder_photographs import give_folder
from .capture import save_png
from .over_picture import OverPicture

if TYPE_CHECKING:
    import numpy as np

    from ...grid.scene import Scene
    from ...render.renderer import Renderer


@dataclass(frozen=True)
class StillJob:
    """All that a still is made of, taken when it is asked for.

    shot: what is drawn; its camera has the size that is saved.  out: the PNG.  panorama: width and height of a 360-degree
    picture around the camera instead, twice as wide as high.  over: what is drawn over it, not over a panorama.
    """

    scene: "Scene"
    shot: Shot
    out: Path
    panorama: tuple[int, int] | None = None
    over: OverPicture = field(default_factory=OverPicture)

    def render(self) -> Path:
        """Makes the picture and saves it.  Raises PointglassError; then no file is left."""
        from ...render.described_picture import picture_of
        from ...render.device.context import create_context
        from ...render.renderer import Renderer

        spec = self.shot.spec
        if "neural" in spec.views:
            from ....model.common.process.torch_process import prepare_inference

            prepare_inference()
        context = create_context()
        try:
            renderer = Renderer(context, prepared(self.scene, spec.edits.ghosts))
            try:
                give_folder(renderer, spec.settings.photos)
                if self.panorama is None:
                    picture = self.over.drawn(picture_of(renderer, spec), spec.camera)
                    save_png(self.out, picture, {KEY: self.shot.drawn_with(renderer.choice.timed).text()})
                else:
                    save_png(self.out, self._panorama(renderer, self.panorama), cannot_repeat("a panorama"))
            finally:
                renderer.release()
        finally:
            context.release()
        return self.out

    def _panorama(self, renderer: "Renderer", size: tuple[int, int]) -> "np.ndarray":
        from ...commands.film.frames import FrameMaker

        spec = self.shot.spec
        maker = FrameMaker(renderer, spec.settings, size, panorama=True, background=spec.background, edits=spec.edits)
        try:
            return maker.picture(spec.camera)
        finally:
            maker.release()


def still_worker(job: StillJob, wake: Callable[[], None]) -> Worker:
    """Starts a still."""
    return Worker(job.render, "Rendering the picture", wake, niceness=BESIDE)
