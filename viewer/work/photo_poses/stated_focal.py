"""The focal length that a photograph's file states: of its EXIF, in pixels."""

import io
from typing import Any

_FULL_FRAME = 43.27
"""Millimetres: the diagonal of 36 x 24 mm, by which the equivalent focal length is defined."""
_PER_UNIT = {2: 25.4, 3: 10.0}
"""Millimetres in an inch and a centimetre, by the number of the unit of FocalPlaneResolutionUnit."""
_EXIF, _LENGTH, _EQUIVALENT, _RESOLUTION, _UNIT, _WIDTH = 0x8769, 0x920A, 0xA405, 0xA20E, 0xA210, 0xA002


def stated_focal(data: bytes, size: tuple[int, int]) -> float | None:
    """Pixels; None where the file states none.  data: a JPEG or PNG.  size: (width, height) of the picture.

    A picture that was reduced keeps its EXIF: the equivalent focal length is right for it, the resolution of the focal plane is
    that of the width which the EXIF names.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data), formats=("JPEG", "PNG")) as image:
            tags: Any = image.getexif().get_ifd(_EXIF)
        if (equivalent := _number(tags.get(_EQUIVALENT))) > 0:
            found = equivalent / _FULL_FRAME * (size[0] ** 2 + size[1] ** 2) ** 0.5
        else:
            per_mm = _number(tags.get(_RESOLUTION)) / _PER_UNIT.get(tags.get(_UNIT, 2), 25.4)
            whole = _number(tags.get(_WIDTH)) or size[0]
            found = _number(tags.get(_LENGTH)) * per_mm * max(size) / max(whole, 1.0)
    except (OSError, ValueError, TypeError, KeyError, SyntaxError, ZeroDivisionError, UnidentifiedImageError, OverflowError):
        return None
    return found if 0.2 * max(size) < found < 20 * max(size) else None


def _number(value: Any) -> float:
    return float(value) if value is not None else 0.0
