"""Pictures for Python: arrays that notebooks show, and that are saved with the description by which they can be drawn again."""

import io
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError
from ..picture.settings import BACKGROUNDS
from .arguments import PathLike, path_of

if TYPE_CHECKING:
    from ..work.pictures.shot_metadata import Shot

_OTHER_ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff", ".webp")
"""Endings besides .png that a picture may be saved with; such files hold no description."""


class Picture(np.ndarray):
    """A NumPy array, (H, W, 4) or (H, W, 3) uint8, row 0 at the top, that notebooks show as a picture.

    Four channels are sRGB premultiplied by alpha, alpha 0 is background; three are sRGB.  Arithmetic gives ordinary arrays;
    ``np.asarray(picture)`` is the same memory without what this class adds.
    """

    _shot: "Shot | None"
    _checksum: int

    def __array_finalize__(self, other: object) -> None:
        self._shot = getattr(other, "_shot", None)
        self._checksum = getattr(other, "_checksum", 0)

    def __array_wrap__(self, array: np.ndarray, context: object = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else np.asarray(array)

    def __reduce__(self) -> Any:
        make, arguments, state = super().__reduce__()  # type: ignore[misc]
        return make, arguments, (state, self._shot, self._checksum)

    def __setstate__(self, state: Any) -> None:
        array, self._shot, self._checksum = state
        super().__setstate__(array)

    def save(self, path: PathLike, *, background: str = "black") -> None:
        """Writes the picture; an existing file is replaced, in one step.

        path: with the ending .png the file says inside how the picture was made, so that ``pointglass render SCAN --like PNG``
        draws it again, unless the pixels were changed; .jpg, .tif and .webp hold no description.
        background: behind pixels without points: black, transparent (PNG, WebP and TIFF), plain, gradient or sky.
        Raises InputError naming the argument, or the file where it cannot be written.
        """
        file = path_of(path)
        image = self._over(background)
        ending = file.suffix.lower()
        if ending not in (".png", *_OTHER_ENDINGS):
            raise InputError(f"expected a file name that ends in .png, {', '.join(_OTHER_ENDINGS)}", option="path",
                             value=str(file))
        if ending in (".jpg", ".jpeg") and image.shape[-1] == 4:
            raise InputError('background "transparent": a JPEG has no transparency',
                             remedy="save a PNG, or choose another background")
        try:
            if ending == ".png":
                from ..common.files import write_png

                write_png(file, image, self._description(file, background))
            else:
                from PIL import Image

                from ...model.common.files.atomic_write import write_atomic

                write_atomic(file, lambda beside: Image.fromarray(image).save(beside, Image.registered_extensions()[ending]))
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror or error})", file=file) from None

    def _over(self, background: str) -> np.ndarray:
        """The array as it is written to a file, with three channels, or four that are not premultiplied."""
        from ..picture.background import as_saved

        if background not in BACKGROUNDS:
            raise InputError(f"expected one of {', '.join(BACKGROUNDS)}", option="background", value=background)
        if self.dtype != np.uint8 or self.ndim != 3 or self.shape[2] not in (3, 4) or 0 in self.shape:
            raise InputError(f"a picture of shape {self.shape} and type {self.dtype} cannot be written as an image; expected "
                             "(H, W, 3) or (H, W, 4) uint8")
        plain = np.ascontiguousarray(np.asarray(self))
        return plain if plain.shape[2] == 3 else as_saved(plain, background)

    def _description(self, file: Path, background: str) -> dict[str, str] | None:
        """How the picture was made; None where that is not known, or the pixels are not those that were made."""
        from ..work.pictures.shot_metadata import KEY

        shot = self._shot
        if shot is None or checksum(self) != self._checksum:
            return None
        camera = shot.spec.camera
        if (camera.height, camera.width, 4) != self.shape:
            return None
        named = camera if camera.name else replace(camera, name=file.stem)
        return {KEY: replace(shot, spec=replace(shot.spec, camera=named, background=background)).text()}

    def _repr_png_(self) -> bytes | None:
        try:
            image = self._over("black")
        except InputError:  # a slice that is no picture: shown as numbers
            return None
        from PIL import Image

        made = io.BytesIO()
        Image.fromarray(image).save(made, "PNG", compress_level=3)
        return made.getvalue()


def checksum(array: np.ndarray) -> int:
    """CRC-32 of the pixels: a saved picture describes only pixels as they were made."""
    return zlib.crc32(np.ascontiguousarray(np.asarray(array)).data)


def as_picture(array: npt.NDArray[np.uint8], shot: "Shot | None" = None) -> Picture:
    """The array as a picture, without copying.  shot: how it was made."""
    picture = array.view(Picture)
    picture._shot, picture._checksum = shot, checksum(array) if shot is not None else 0
    return picture


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture and what is known about each of its pixels; arrays of your own, row 0 at the top.

    image: (H, W, 4) uint8, sRGB premultiplied by alpha; alpha 0 is background.  Notebooks show it; ``save`` writes it.
    depth: (H, W) float32, distance along the viewing axis in file units, of the foremost points; +inf where there are none.
        It is measured from the centre of projection along ``camera.forward``, not along the ray through the pixel.  Before the
        filter: it has a value where the mask is False because the points there are hidden.
    mask: (H, W) bool, True where points were kept by the filter (it runs for the mask in the raw view too).
    provenance: (H, W) uint8, a key of PROVENANCE: 0 background, 1 measured, 2 measured and repainted by the network, 3 filled,
        4 from a photograph, 5 a mesh.  In the raw view every point shown is 1, also where the mask is False.
    stats: ``total_ms``, milliseconds by stage, points and cells drawn, network and device, approximations in force.
    """

    image: Picture
    depth: npt.NDArray[np.float32]
    mask: npt.NDArray[np.bool_]
    provenance: npt.NDArray[np.uint8]
    stats: dict[str, Any]

    def save(self, path: PathLike, *, background: str = "black") -> None:
        """Writes the image, as :meth:`Picture.save`."""
        self.image.save(path, background=background)

    def _repr_png_(self) -> bytes | None:
        return self.image._repr_png_()

    def __repr__(self) -> str:
        height, width = self.depth.shape
        return f"<pointglass.Frame: {width}x{height}, {self.stats.get('total_ms', 0.0):.0f} ms>"
