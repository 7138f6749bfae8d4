"""Whether the files of a camera are already there: complete, and made as they would be made now.  For ``render --resume``.

Files of one camera are written together (viewer.common.files), so that an interrupted run leaves none of them torn; but a
folder may have been copied halfway, or a disk been full.  Whatever cannot be read to its end is rendered again.
"""

import io
import json
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.file_names import safe_name
from .shot_metadata import KEY, TIMED, Shot, png_text

_END = b"IEND\xaeB`\x82"
"""The last bytes of a complete PNG."""


def is_finished(out: Path, shot: Shot, *, newer_than: float, aux: bool) -> bool:
    """Whether ``out`` holds the picture that ``shot`` describes, and with ``aux`` the files beside it.

    newer_than: seconds since 1970; a picture from before is not taken.
    """
    name = safe_name(shot.spec.camera.name, "picture")
    picture = out / f"{name}.png"
    texts = [shot.drawn_with(kind).text() for kind in ("", *TIMED)]  # which one a GPU chose is not known before it draws
    try:
        if not picture.is_file() or picture.stat().st_mtime < newer_than or png_text(picture, KEY) not in texts:
            return False
        size = shot.spec.camera.height, shot.spec.camera.width
        return whole_png(picture, size) and (not aux or _whole_aux(out, name, size))
    except (OSError, InputError):
        return False


def whole_png(path: Path, size: tuple[int, int] | None = None) -> bool:
    """Whether every chunk and every pixel of the PNG can be read.  size: (height, width) that it must have, None: any."""
    from PIL.PngImagePlugin import PngImageFile  # the plug-in itself, without Pillow's limit of pixels

    try:
        data = path.read_bytes()
        PngImageFile(io.BytesIO(data)).verify()  # the checksums of the chunks
        image = PngImageFile(io.BytesIO(data))
        image.load()
        return data.endswith(_END) and (size is None or image.size == size[::-1])
    except (OSError, ValueError, SyntaxError, EOFError):
        return False


def _whole_aux(out: Path, name: str, size: tuple[int, int]) -> bool:
    for ending, kind in (("depth", np.float32), ("mask", np.bool_)):
        try:
            array = np.load(out / f"{name}.{ending}.npy", allow_pickle=False)
        except (OSError, ValueError, EOFError, SyntaxError, MemoryError):
            return False
        if array.dtype != kind or array.shape != size:
            return False
    try:
        json.loads((out / f"{name}.stats.json").read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return whole_png(out / f"{name}.provenance.png", size)
