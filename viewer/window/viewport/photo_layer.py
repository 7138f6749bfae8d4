"""The photograph that is shown over a view: resampled on the processor, blended, and kept until the picture is another."""

from typing import TYPE_CHECKING

import numpy as np

from ...preprocess.closed_depth import filled_depth
from ...readers.e57.e57_photographs import StationPhoto
from ...work.pictures.photo_in_view import agreement, blended, nearest_ranges, resampled, strength
from ...work.places.standing_place import sample_scene
from ..session.work import ShownPhoto
from .pixel_reader import PixelReader

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...render.frame import Frame


IN_PLACE = 0.05
"""Metres from its place within which a photograph hides nothing from itself."""


class PhotoLayer:
    """Owns the texture of one blended picture per view.  psnr: dB between the photograph and the view that was blended last, at
    pixels that both show; None where there are none."""

    def __init__(self, context: "moderngl.Context", pixels: PixelReader):
        self._context, self._pixels = context, pixels
        self.psnr: float | None = None
        self._resampled: tuple[tuple, np.ndarray] | None = None
        self._ranges: tuple[StationPhoto, Scene, np.ndarray] | None = None
        self._textures: dict[str, moderngl.Texture] = {}
        self._made: dict[str, tuple[tuple, float]] = {}

    def over(self, frame: "Frame", view: str, picture: "moderngl.Texture", camera: "Camera", chosen: ShownPhoto,
             scene: "Scene", *, wait: bool) -> "moderngl.Texture":
        """``picture`` with the photograph over it; itself where the photograph has faded out.

        wait: for the picture to be read; otherwise the last blended one is returned until then.
        frame: of the picture, for its depth.  camera: its camera, at any size.  scene: the one shown.
        """
        distance = float(np.linalg.norm(camera.position - chosen.photo.position))
        metres = scene.meta.metres_per_unit
        share = strength(distance, metres, chosen.blend)
        if share <= 0.0:
            self.psnr = None
            return picture
        width, height = picture.size
        sized = camera if camera.width == width and camera.height == height else camera.resized(width, height)
        hidden = distance * (metres or 1.0) > IN_PLACE
        image = self._pixels.read(frame, f"shown {view} {picture.glo}", texture=picture, wait=wait)
        depth = self._pixels.read(frame, "depth", wait=wait)
        if image is None or depth is None:
            before = self._textures.get(view)
            return before if view in self._made and before is not None and before.size == picture.size else picture
        photo = self._photo(frame, depth, sized, chosen.photo, self._nearest(chosen.photo, scene) if hidden else None)
        split = round(chosen.split_at * width) if chosen.split else None
        key = (id(photo), picture.glo, frame.facts.network_pending, share, split)
        if self._made.get(view, (None,))[0] == key:
            return self._textures[view]
        self.psnr = agreement(image, photo)
        texture = self._textures.get(view)
        if texture is None or texture.size != picture.size:
            if texture is not None:
                texture.release()
            texture = self._textures[view] = self._context.texture(picture.size, 4, dtype="f1", alignment=1)
        texture.write(blended(image, photo, share, split).tobytes(), alignment=1)
        self._made[view] = key, share
        return texture

    def _nearest(self, photo: StationPhoto, scene: "Scene") -> np.ndarray:
        """The nearest points around a photograph, found once for a photograph and scene."""
        kept = self._ranges
        if kept is None or kept[0] is not photo or kept[1] is not scene:
            kept = self._ranges = photo, scene, nearest_ranges(photo, sample_scene(scene).points)
        return kept[2]

    def _photo(self, frame: "Frame", depth: np.ndarray, camera: "Camera", photo: StationPhoto, ranges: np.ndarray | None
               ) -> np.ndarray:
        """The resampled photograph, made once for a frame.  depth: of the frame."""
        key = (frame, photo)
        if self._resampled is None or self._resampled[0][0] is not frame or self._resampled[0][1] is not photo:
            self._resampled = key, resampled(photo, camera, filled_depth(depth), ranges)
        return self._resampled[1]

    def clear(self) -> None:
        """Forgets the scene and its photograph."""
        self._resampled = self._ranges = None
        self._made.clear()
        self.psnr = None

    def release(self) -> None:
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self.clear()
