"""Pictures of a film, one after the other: plain, supersampled, or 360-degree panoramas."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.linear_light import TO_LINEAR, TO_SRGB
from ...common.errors import InputError, Option
from ...picture.background import composite
from ...picture.edits import NO_EDITS, Edits
from ...picture.settings import Settings
from ...picture.spec import PictureSpec
from ...render.described_picture import Composer, render
from ...work.cameras.path import frame_number
from ...work.pictures.film_titles import NO_TITLES, FilmTitles
from .equirectangular import Panorama

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...render.renderer import Renderer

LARGEST_SUPERSAMPLE = 4


def check_form(size: tuple[int, int], supersample: int, *, panorama: bool) -> None:
    """Raises InputError for values that a FrameMaker cannot have."""
    if not 1 <= supersample <= LARGEST_SUPERSAMPLE:
        raise InputError(f"expected 1 to {LARGEST_SUPERSAMPLE}", option="--supersample", value=supersample)
    if panorama and size[0] != 2 * size[1]:
        raise InputError((Option("--size"), f" {size[0]}x{size[1]}: a panorama is twice as wide as high, such as 4096x2048"))


@dataclass(frozen=True)
class FrameMaker:
    """Makes a film's pictures.  The same camera gives the same bytes.

    size: (width, height) of the pictures.  supersample: each picture is rendered this many times wider and higher and averaged
    in linear light, 1 to 4.  panorama: equirectangular pictures of all directions, around each camera's position, with its
    heading in the middle.  background: a key of viewer.picture.background.COLOURS.  edits: of a project.
    titles: drawn over pictures of cameras that are named as frames are.
    Owns GL objects: release it.
    """

    renderer: "Renderer"
    settings: Settings
    size: tuple[int, int]
    supersample: int = 1
    panorama: bool = False
    background: str = "black"
    edits: Edits = NO_EDITS
    titles: FilmTitles = NO_TITLES
    _composer: Composer = field(init=False)

    def __post_init__(self) -> None:
        check_form(self.size, self.supersample, panorama=self.panorama)
        object.__setattr__(self, "_composer", Composer(self.renderer.context))

    def picture(self, camera: "Camera") -> np.ndarray:
        """(H, W, 3) uint8 sRGB."""
        width, height = self.size[0] * self.supersample, self.size[1] * self.supersample
        if self.panorama:
            made = Panorama(width, height).picture(camera, self._draw)
        else:
            made = self._draw(self.framed(camera))
        picture = composite(averaged(made, self.supersample), self.background)
        return self.titles.over(picture, frame_number(camera.name)) if self.titles.shown else picture

    def framed(self, camera: "Camera") -> "Camera":
        """The camera at the size that is rendered."""
        sides = (side * self.supersample for side in self.size)
        return replace(camera.resized(*sides), name=camera.name)

    def spec(self, camera: "Camera") -> PictureSpec:
        """The description of what is rendered of a camera at its own size."""
        return PictureSpec(camera, self.settings, edits=self.edits, background=self.background)

    def _draw(self, camera: "Camera") -> np.ndarray:
        spec = self.spec(camera)
        return self._composer.images(render(self.renderer, spec), spec)[0]

    def release(self) -> None:
        self._composer.release()


def rendered_cameras(cameras: "Sequence[Camera]", supersample: int, *, panorama: bool) -> "list[Camera]":
    """The cameras that a FrameMaker renders for frames of ``cameras``, which have its size."""
    width, height = (side * supersample for side in (cameras[0].width, cameras[0].height))
    if panorama:
        return [face for camera in cameras for _, face in Panorama(width, height).faces(camera)]
    return [camera.resized(width, height) for camera in cameras]


def averaged(image: np.ndarray, factor: int) -> np.ndarray:
    """(H, W, 4) uint8, premultiplied sRGB, from (factor * H, factor * W, 4): the mean of each block in linear light."""
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    blocks = image.reshape(height, factor, width, factor, 4)
    rgb = TO_LINEAR[blocks[..., :3]].astype(np.uint32).sum(axis=(1, 3))
    alpha = blocks[..., 3].astype(np.uint32).sum(axis=(1, 3))
    count = factor * factor
    mean = TO_SRGB[(rgb + count // 2) // count]
    return np.concatenate([mean, ((alpha + count // 2) // count)[..., None]], axis=2).astype(np.uint8)
