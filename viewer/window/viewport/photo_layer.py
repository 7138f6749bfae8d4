"""The photograph that is shown over a view: laid there as the picture's own photographs are, blended, and kept until the
picture is another."""

from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...preprocess.closed_depth import filled_depth
from ...render.photographs.lone_photograph import photograph_alone
from ..session.work import ShownPhoto
from .photo_blend import agreement, blended, strength
from .pixel_reader import PixelReader

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera
    from ...render.frame import Frame
    from ...render.photographs.photo_pool import PhotoPool
    from ...render.renderer import Renderer


IN_PLACE = 0.05
"""Metres from its place within which a photograph hides nothing from itself."""


class PhotoLayer:
    """Owns the texture of one blended picture per view.  psnr: dB between the photograph and the view that was blended last, at
    pixels that both show; None where there are none.  waits: whether the photograph is being prepared.  problem: why it cannot
    be shown, else empty."""

    def __init__(self, context: "moderngl.Context", pixels: PixelReader):
        self._context, self._pixels = context, pixels
        self.psnr: float | None = None
        self.waits, self.problem = False, ""
        self._laid: tuple[Frame, PhotoPool, bool, np.ndarray] | None = None
        self._textures: dict[str, moderngl.Texture] = {}
        self._made: dict[str, tuple] = {}

    def over(self, frame: "Frame", view: str, picture: "moderngl.Texture", camera: "Camera", chosen: ShownPhoto,
             renderer: "Renderer", *, wait: bool, whole: bool) -> "moderngl.Texture":
        """``picture`` with the photograph over it; itself where the photograph has faded out, or is not there yet.

        wait: for the picture to be read; otherwise the last blended one is returned until then.  whole: for the photograph,
        too.  frame: of the picture, for its depth.  camera: its camera, at any size.  renderer: of the scene shown.
        """
        distance = float(np.linalg.norm(camera.position - chosen.photo.position))
        metres = renderer.scene.meta.metres_per_unit
        share = strength(distance, metres, chosen.blend)
        self.waits, self.problem = False, ""
        if share <= 0.0:
            self.psnr = None
            return picture
        try:
            pool = renderer.photographs.alone(chosen.photo, wait=whole)
        except InputError as error:
            self.psnr, self.problem = None, str(error)
            return picture
        if pool is None:
            self.psnr, self.waits = None, True
            return picture
        width, height = picture.size
        sized = camera if camera.width == width and camera.height == height else camera.resized(width, height)
        hides = distance * (metres or 1.0) > IN_PLACE
        image = self._pixels.read(frame, f"shown {view} {picture.glo}", texture=picture, wait=wait or whole)
        depth = self._pixels.read(frame, "depth", wait=wait or whole)
        if image is None or depth is None:
            before = self._textures.get(view)
            return before if view in self._made and before is not None and before.size == picture.size else picture
        photo = self._photo(frame, depth, sized, pool, hides)
        split = round(chosen.split_at * width) if chosen.split else None
        key = (id(photo), picture.glo, frame.facts.network_pending, share, split)
        if self._made.get(view) == key:
            return self._textures[view]
        self.psnr = agreement(image, photo)
        texture = self._textures.get(view)
        if texture is None or texture.size != picture.size:
            if texture is not None:
                texture.release()
            texture = self._textures[view] = self._context.texture(picture.size, 4, dtype="f1", alignment=1)
        texture.write(blended(image, photo, share, split).tobytes(), alignment=1)
        self._made[view] = key
        return texture

    def _photo(self, frame: "Frame", depth: np.ndarray, camera: "Camera", pool: "PhotoPool", hides: bool) -> np.ndarray:
        """The photograph in the view, made once for a frame.  depth: of the frame."""
        kept = self._laid
        if kept is None or kept[0] is not frame or kept[1] is not pool or kept[2] != hides:
            photo = photograph_alone(filled_depth(depth), camera, pool, 0, hides=hides)
            kept = self._laid = frame, pool, hides, photo
        return kept[3]

    def clear(self) -> None:
        """Forgets the scene and its photograph."""
        self._laid = None
        self._made.clear()
        self.psnr, self.waits, self.problem = None, False, ""

    def release(self) -> None:
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self.clear()
