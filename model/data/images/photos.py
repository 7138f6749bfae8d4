"""Photographs on disk, undistorted when they are read, and the check of a folder's pictures before training.

Camera frames are OpenGL's.  A pixel spans [i, i + 1], as in COLMAP.
"""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from ...common.errors import DataError
from ..dataset import reason
from .lens import Lens, pinhole_focal, undistort


@dataclass(frozen=True, eq=False)
class Photograph:
    """A TruePicture on disk, undistorted to a pinhole with square pixels when it is read.

    mask: a picture of the same size, 255 where the photograph is usable (not anonymised), or None.
    """

    path: Path
    lens: Lens
    camera_to_world: np.ndarray
    mask: Path | None = None

    @property
    def name(self) -> str:
        """Of the file, without its ending."""
        return self.path.stem

    @property
    def width(self) -> int:
        return self.lens.width

    @property
    def height(self) -> int:
        return self.lens.height

    @property
    def fl(self) -> float:
        """Focal length, pixels.  Raises DataError where no pinhole fits inside the lens's picture."""
        try:
            return self.lens.fx if self.lens.plain else pinhole_focal(self.lens)
        except DataError as error:
            raise DataError(f"{error}", file=self.path) from None

    @property
    def cx(self) -> float:
        return self.lens.cx if self.lens.plain else self.width / 2

    @property
    def cy(self) -> float:
        return self.lens.cy if self.lens.plain else self.height / 2

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        picture = np.asarray(Image.open(self.path).convert("RGB"))
        return picture if self.lens.plain else undistort(picture, self.lens)

    def depth(self) -> np.ndarray | None:
        """None: a photograph has no depth."""
        return None

    def coverage(self) -> np.ndarray | None:
        """None: every pixel is covered."""
        return None

    def known(self) -> np.ndarray | None:
        """(H, W) bool, True where the mask is 255; None without a mask."""
        if self.mask is None:
            return None
        usable = np.asarray(Image.open(self.mask).convert("L"))
        return (usable if self.lens.plain else undistort(usable, self.lens)) == 255


MAX_NAMED = 10
"""Files that a message names before it counts the rest."""


def check_pictures(where: Path, wanted: Iterable[tuple[Path, tuple[int, int] | None]], depths: Iterable[Path] = ()) -> None:
    """Decodes every picture, because a truncated file may have a valid header.

    wanted: files and their (width, height), None for any.  depths: those of them that must have one value per pixel.
    Raises DataError naming the first MAX_NAMED files that are missing, unreadable, of another size or not depth pictures.
    """
    wanted = list(dict.fromkeys(wanted))
    if wrong := wrong_pictures(where, wanted, depths):
        more = f" and {len(wrong) - MAX_NAMED} more" if len(wrong) > MAX_NAMED else ""
        raise DataError(f"{where}: {len(wrong)} of {len(wanted)} files cannot be used: {'; '.join(wrong[:MAX_NAMED])}{more}",
                        remedy="download or extract them again")


def wrong_pictures(where: Path, wanted: Iterable[tuple[Path, tuple[int, int] | None]],
                   depths: Iterable[Path] = ()) -> list[str]:
    """A message for each picture that cannot be used; arguments as in :func:`check_pictures`."""
    flat = set(depths)
    with ThreadPoolExecutor() as pool:
        return [text for text in pool.map(lambda item: _wrong(where, *item, depth=item[0] in flat), wanted) if text]


def _wrong(where: Path, path: Path, size: tuple[int, int] | None, *, depth: bool) -> str | None:
    name = path.relative_to(where) if path.is_relative_to(where) else path
    try:
        if not path.is_file():
            return f"{name} is missing"
        if path.suffix == ".npy":
            array = np.load(path, mmap_mode="r")
            rows, columns = array.shape
            found, numbers = (columns, rows), array.dtype.kind in "iuf" and array.size > 0
        else:
            with Image.open(path) as image:
                image.load()
                found, numbers = image.size, image.mode in ("F", "L") or image.mode.startswith("I")
    except Exception as error:  # Pillow raises nearly anything for damaged pictures
        return f"{name} cannot be read ({reason(error)})"
    if depth and not numbers:
        return f"{name} is not a depth picture: expected one value per pixel"
    return None if size in (None, found) else f"{name} has {found[0]}x{found[1]} pixels, not {size[0]}x{size[1]}"
