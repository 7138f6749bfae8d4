"""Pictures of strangers: JPEG and PNG alone, told by their first bytes, with a bound on their pixels."""

import io

import numpy as np

from ..common.errors import InputError

MOST_PIXELS = 1 << 28
"""Of a stored picture; larger ones are refused before decoding: 800 MB as RGB."""
_LEAST_MOST, _PIXELS_A_BYTE = 1 << 26, 8
"""Pixels that any picture may have (200 MB as RGB), and further ones for each of its bytes: real photographs have 1 to 5, an
empty picture a thousand."""
_ENDINGS = {b"\xff\xd8": ".jpg", b"\x89P": ".png"}
"""First bytes of a picture -> the usual ending of its file."""


def most_pixels(size: int) -> int:
    """Pixels that a picture of so many bytes may have."""
    return min(MOST_PIXELS, _LEAST_MOST + _PIXELS_A_BYTE * size)


def ending_of(data: bytes, label: str) -> str:
    """``.jpg`` or ``.png``.  label: of the picture, for messages.  Raises InputError where it is neither."""
    ending = _ENDINGS.get(data[:2])
    if ending is None:
        raise InputError(f"{label} is neither JPEG nor PNG (first bytes {data[:4]!r})", remedy="export it again")
    return ending


def decoded_picture(data: bytes, label: str, longest: int) -> tuple[np.ndarray, tuple[int, int]]:
    """The picture, (H, W, 3) uint8 sRGB, at most ``longest`` pixels wide and high, and the (width, height) of its file.

    Raises InputError where it is damaged, larger than :func:`most_pixels`, or not of 8 bits.
    """
    from PIL import Image, JpegImagePlugin, PngImagePlugin, UnidentifiedImageError

    ending = ending_of(data, label)
    try:
        image = (JpegImagePlugin.JpegImageFile if ending == ".jpg" else PngImagePlugin.PngImageFile)(io.BytesIO(data))
        full = image.size
        if image.mode.startswith(("I", "F")):
            raise InputError(f"{label} is a picture of kind {image.mode}, not of 8-bit colour", remedy="export it again")
        if full[0] * full[1] > (most := most_pixels(len(data))):
            raise InputError(f"{label}: {full[0]}x{full[1]} pixels, more than {most:,}", remedy="export it smaller")
        share = min(1.0, longest / max(full))
        size = max(1, round(full[0] * share)), max(1, round(full[1] * share))
        if ending == ".jpg" and share < 1.0:
            image.draft("RGB", size)  # decodes only as finely as needed
        image.load()
        rgb = image.convert("RGB")
        return np.asarray(rgb if rgb.size == size else rgb.resize(size, Image.Resampling.BOX)), full
    except (OSError, SyntaxError, ValueError, EOFError, UnidentifiedImageError) as error:
        raise InputError(f"{label} cannot be decoded ({error})", remedy="export it again") from None
