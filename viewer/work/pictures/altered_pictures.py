"""Pictures as a project shows them: clips, hidden stations, colours and tones applied; and comparisons with their labels.

``render --like``, the window's F12 and films of a project use this, so that they give the same bytes.
"""

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.errors import InputError
from ...picture.background import as_saved
from ...render.developed_views import DevelopedViews
from ...render.passes.develop import read_picture
from ...render.raster.edits import Edits
from ..document import Alterations

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...picture.settings import Settings
    from ...render.frame import Frame
    from ...render.renderer import Renderer
    from .shot_metadata import Shot

_LETTERS, _MARGIN = 0.028, 0.018
"""Height of a comparison's labels and their distance from the edges, shares of the picture's height."""


def edits_of(alterations: Alterations) -> Edits:
    """What alterations do to the points that are drawn."""
    return Edits(alterations.clips, frozenset(alterations.hidden_stations), alterations.look, alterations.up,
                 alterations.ghosts)


class AlteredPictures:
    """Renders pictures of one scene with alterations.  Owns GL objects: release it."""

    def __init__(self, renderer: "Renderer", alterations: Alterations):
        from ...render.device.shader import Programs

        self._renderer, self._alterations, self._edits = renderer, alterations, edits_of(alterations)
        self._programs = Programs(renderer.context)
        self._views = DevelopedViews(self._programs)

    def images(self, camera: "Camera", settings: "Settings", views: tuple[str, ...]) -> list[np.ndarray]:
        """(H, W, 4) uint8, premultiplied, of each of ``views``."""
        locked = self._alterations.lock_measured and "neural" in views
        frame = self._renderer.render(camera, settings, tuple(dict.fromkeys((*views, *(("filtered",) if locked else ())))),
                                      edits=self._edits)
        return [self._developed(frame, view) for view in views]

    def _developed(self, frame: "Frame", view: str) -> np.ndarray:
        texture = self._views.texture(frame, view, self._alterations.look, tint=False, lock=self._alterations.lock_measured)
        return frame.image(view) if texture is frame.textures[view] else read_picture(texture)

    def release(self) -> None:
        self._views.release()
        self._programs.release()


def shot_picture(renderer: "Renderer", shot: "Shot") -> np.ndarray:
    """The picture that a shot describes, as it is saved: (H, W, 3) uint8, with a transparent background (H, W, 4)."""
    pictures = AlteredPictures(renderer, shot.alterations)
    views = (shot.settings.view, shot.other_view) if shot.other_view else (shot.settings.view,)
    try:
        return joined(pictures.images(shot.camera, shot.settings, views), shot.background, views, shot.split_at)
    finally:
        pictures.release()


def joined(images: "list[np.ndarray]", background: str, views: tuple[str, ...], split_at: float) -> np.ndarray:
    """One picture, or two side by side with their labels, over a background.

    images: (H, W, 4) uint8, premultiplied, one or two.  views: their names.  split_at: share of the width at which the second
    begins.
    """
    picture = as_saved(images[0], background).copy()
    if len(images) == 1:
        return picture
    if background == "transparent":
        raise InputError("a comparison has no transparent background; choose another")
    column = split_column(split_at, picture.shape[1])
    picture[:, column:] = as_saved(images[1], background)[:, column:]
    return labelled(picture, column, (views[0], views[1]))


def split_column(split_at: float, width: int) -> int:
    """Column at which the second picture of a comparison begins."""
    return round(split_at * width)


def labelled(picture: np.ndarray, column: int, names: tuple[str, str]) -> np.ndarray:
    """A comparison with the name of each side at its top, on a dark plate.  picture: (H, W, 3) uint8; changed in place."""
    height, width = picture.shape[:2]
    size = max(round(_LETTERS * height), 9)
    margin, pad = max(round(_MARGIN * height), 4), max(size // 2, 3)
    for name, left, right in ((names[0], 0, column), (names[1], column, width)):
        mask = _lettering(name, size)
        tall, wide = mask.shape[0] + pad, mask.shape[1] + 2 * pad
        if right - left < wide + 2 * margin or height < tall + 2 * margin:
            continue  # no room on this side
        x = margin if left == 0 else right - margin - wide
        plate = picture[margin : margin + tall, x : x + wide]
        plate[:] = plate // 4
        inner = plate[pad // 2 : pad // 2 + mask.shape[0], pad : pad + mask.shape[1]]
        share = mask[..., None].astype(np.uint16)
        inner[:] = ((255 - share) * inner + share * 240 + 127) // 255
    return picture


@cache
def _lettering(text: str, size: int) -> np.ndarray:
    """(h, w) uint8: how much of each pixel a text covers."""
    from PIL import Image, ImageDraw, ImageFont

    font: Any = ImageFont.load_default(size)
    left, top, right, bottom = font.getbbox("Ag" + text)
    canvas = Image.new("L", (int(right - left) + size, int(bottom - top) + 2))
    ImageDraw.Draw(canvas).text((0, -top + 1), text, fill=255, font=font)
    mask = np.asarray(canvas)
    return mask[:, : int(np.nonzero(mask.any(axis=0))[0][-1]) + 1]
