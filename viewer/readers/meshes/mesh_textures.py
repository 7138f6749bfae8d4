"""Pictures on meshes: those of materials, in levels of half the size, for sampling without flicker."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .mesh_data import Textures

LONGEST = 4096
"""Pixels along a side of a picture; larger ones are reduced."""
MOST_PIXELS = 1 << 26
"""Of a picture before it is reduced: 200 MB as RGB."""
MOST_TEXELS = 1 << 26
"""Of all pictures of a mesh together, 200 MB; later ones are reduced to fit."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A material's picture; equal where it is the same object of the file.  tint: (3,) factor of its colours."""

    image: Any
    tint: tuple[float, ...]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Picture) and other.image is self.image and other.tint == self.tint

    def __hash__(self) -> int:
        return hash((id(self.image), self.tint))


def _is_read(image: Any) -> bool:
    """Whether a picture of which Pillow has read the head is decoded: JPEG and PNG alone, with a bound on pixels."""
    return getattr(image, "format", None) in ("JPEG", "PNG") and image.width * image.height <= MOST_PIXELS


def picture_of(visual: Any) -> Picture | None:
    """The picture of a textured part, with the factor of its base colour; None where its material has none that is read."""
    material = visual.material
    image = getattr(material, "baseColorTexture", None)
    if image is None:
        image = getattr(material, "image", None)
        return Picture(image, (1.0, 1.0, 1.0)) if _is_read(image) else None
    if not _is_read(image):
        return None
    factor = getattr(material, "baseColorFactor", None)
    tint = (1.0, 1.0, 1.0) if factor is None else tuple(float(value) / 255.0 for value in np.asarray(factor)[:3])
    return Picture(image, tint)


def packed_textures(pictures: list[Picture], of_face: np.ndarray, uv: np.ndarray) -> Textures:
    """The pictures of a mesh with their levels.  of_face: (F,) number of the picture.  uv: (V, 2), v upwards."""
    from PIL import Image

    texels, rows, used = [], [], 0
    for picture in pictures:
        image = picture.image.convert("RGB")
        left = max(MOST_TEXELS - used, 1 << 16)
        share = min(1.0, LONGEST / max(image.size), (0.7 * left / (image.width * image.height)) ** 0.5)
        if share < 1.0:
            image = image.resize([max(1, int(side * share)) for side in image.size], Image.Resampling.BOX)
        levels = []
        while True:
            pixels = np.asarray(image, np.float32).reshape(-1, 3) * np.array(picture.tint, np.float32)
            levels.append((used, image.width, image.height))
            texels.append(np.clip(pixels + 0.5, 0, 255).astype(np.uint8))
            used += image.width * image.height
            if image.size == (1, 1):
                break
            image = image.resize([max(1, side // 2) for side in image.size], Image.Resampling.BOX)
        rows.append(levels)
    deepest = max(map(len, rows))
    table = np.array([levels + [levels[-1]] * (deepest - len(levels)) for levels in rows], np.int64)
    finite = np.where(np.isfinite(uv) & (np.abs(uv) < 1e6), uv, 0.0)
    return Textures(of_face, finite.astype(np.float32), np.concatenate(texels), table)
