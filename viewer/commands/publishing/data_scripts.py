"""Data as classic scripts: ``POINTGLASS("key", {...});``.

Browsers let a page that was opened as a file neither fetch files nor read the pixels of pictures beside it; they do run
scripts.  So pictures and depth are base64 text in scripts, which are loaded by need.
"""

import base64
import io
import json
from typing import Any

import numpy as np

WEBP_EFFORT = 5
"""libwebp's method, 0 to 6."""


def webp_bytes(picture: np.ndarray, quality: int) -> bytes:
    """A picture (H, W, 3) uint8 as WebP.  quality: 0 to 100."""
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(picture).save(data, "WEBP", quality=quality, method=WEBP_EFFORT)
    return data.getvalue()


def alpha_png(alpha: np.ndarray) -> bytes:
    """A picture of one colour, black, with this opacity, (H, W) uint8, as PNG."""
    from PIL import Image

    data = io.BytesIO()
    Image.merge("LA", (Image.new("L", alpha.shape[::-1], 0), Image.fromarray(alpha))).save(data, "PNG", optimize=True)
    return data.getvalue()


def base64_text(data: bytes) -> str:
    """The bytes as text."""
    return base64.b64encode(data).decode("ascii")


def script(key: str, value: Any, comment: str = "") -> bytes:
    """The script that gives a value to the page.  comment: in front of it, without ``*``; :func:`comment_of` reads it."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f"/*{comment}*/POINTGLASS({json.dumps(key)},{text});\n".encode("ascii")


def comment_of(script_bytes: bytes) -> str:
    """The comment of :func:`script`; "" where there is none."""
    begin, star, _ = script_bytes.partition(b"*/")
    return begin[2:].decode("ascii", "replace") if star and begin.startswith(b"/*") else ""
