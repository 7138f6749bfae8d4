"""The pictures inside an E57 as files: all of them, also those without a camera or a pose, to be listed, looked at and saved.

:mod:`viewer.readers.e57.e57_photographs` has those that can be shown in place.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ..decoded_picture import decoded_picture, ending_of
from ..formats import check_file
from .e57_images import structures
from .e57_nodes import child, first_line, library, open_e57, pose_of, text_of, value_of

REPRESENTATIONS = ("pinhole", "spherical", "cylindrical", "visualReference")


@dataclass(frozen=True)
class StoredPicture:
    """One picture of ``file``.

    number: its place in images2D.  kind: of REPRESENTATIONS.  width, height: pixels as the file declares them, 0 where it
    does not.  size: bytes.  placed: whether the file says where it was taken.  focal: pixels, of a pinhole; None where the file
    states none.
    """

    file: Path
    number: int
    name: str
    kind: str
    width: int
    height: int
    size: int
    placed: bool
    focal: float | None = None

    @property
    def text(self) -> str:
        """Name and size for a list."""
        return f"{self.name}, {self.width} x {self.height}" if self.width else self.name


def stored_pictures(path: Path) -> list[StoredPicture]:
    """The pictures of an E57, in its order; images that hold none are left out.  Raises InputError where it cannot be read."""
    check_file(path)
    with open_e57(path) as file:
        found = []
        for number, image in enumerate(structures(file.root(), "images2D")):
            kind, node, blob = _blob(image)
            if blob is None:
                continue
            width, height = (_count(node, f"image{side}") for side in ("Width", "Height"))
            name = text_of(image, "name") or f"picture {number + 1}"
            placed = kind != "visualReference" and pose_of(image) is not None
            focal = _focal(node) if kind == "pinhole" else None
            found.append(StoredPicture(path, number, name, kind, width, height, blob.byteCount(), placed, focal))
        return found


def _blob(image):
    """(kind, representation, blob of the picture) of an image; the blob is None where it holds none."""
    for kind in REPRESENTATIONS:
        node = child(image, f"{kind}Representation", "Structure")
        for name in ("jpegImage", "pngImage") if node is not None else ():
            blob = child(node, name, "Blob")
            if blob is not None:
                return kind, node, blob
    return "", None, None


def _count(node, name: str) -> int:
    value = value_of(node[name]) if node.isDefined(name) else None
    return int(value) if value is not None and 0 < value < 1e9 else 0


def _focal(node) -> float | None:
    """Pixels; None where the numbers of a pinhole are missing or impossible."""
    length, pixel = (value_of(node[name]) if node.isDefined(name) else None for name in ("focalLength", "pixelWidth"))
    found = length / pixel if length and pixel and pixel > 0 else 0.0
    return found if 1.0 < found < 1e7 else None


def picture_file(stored: StoredPicture) -> tuple[bytes, str]:
    """The bytes of the picture's file as they are stored, and the ending of its name.  Raises InputError."""
    label = f"{stored.file}: photograph {stored.name!r}"
    with open_e57(stored.file) as file:
        images = structures(file.root(), "images2D")
        blob = _blob(images[stored.number])[2] if stored.number < len(images) else None
        if blob is None:
            raise InputError(f"{label} is not there any more", remedy="open the scan again")
        if not 0 < blob.byteCount() <= stored.file.stat().st_size:
            raise InputError(f"{label} has {blob.byteCount()} bytes, which the file does not hold", remedy="export it again")
        try:
            data = blob.read_buffer().tobytes()
        except library().E57Exception as error:
            raise InputError(f"{label}: {first_line(error)}", remedy="copy or export it again") from None
    return data, ending_of(data, label)


def picture_of(stored: StoredPicture, longest: int) -> tuple[np.ndarray, tuple[int, int]]:
    """The picture, (H, W, 3) uint8 sRGB, at most ``longest`` pixels wide and high, and the (width, height) of its file.

    Raises InputError where it is damaged, larger than it may be, or not of 8 bits.
    """
    return decoded_picture(picture_file(stored)[0], f"{stored.file}: photograph {stored.name!r}", longest)


def pictures_in(sources: Iterable[str]) -> list[StoredPicture]:
    """The pictures of all E57 files among the sources of a scene that are still there; a file that cannot be read has none."""
    found: list[StoredPicture] = []
    for source in map(Path, sources):
        if source.suffix.lower() == ".e57" and source.is_file():
            try:
                found += stored_pictures(source)
            except InputError:
                continue
    return found
