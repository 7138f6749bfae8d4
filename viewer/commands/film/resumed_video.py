"""A video that goes on where it was interrupted: its frames are kept beside it until it is encoded.

``FILE.mp4.frames`` holds one PNG a frame and what they are made of (viewer.commands.film.encode).  The encoder begins when all
are there, so that an interrupted video has the same bytes as one that was not; a folder of another film is replaced.
"""

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.camera import Camera
from .encode import RECORD, Draw, check_mp4, encode_mp4, frame_files, frames_left, write_folder


def frames_beside(path: Path) -> Path:
    """The folder of the frames of an unfinished video."""
    return path.with_name(f"{path.name}.frames")


def write_resumed_mp4(path: Path, cameras: Sequence[Camera], draw: Draw, *, size: tuple[int, int], fps: Fraction, made_of: dict,
                      describe: Callable[[Camera], dict[str, str]] | None = None) -> int:
    """Encodes one picture a camera; returns how many were made now.  made_of, describe: as of write_folder.

    Raises InputError as write_folder and encode_mp4; the frames that are there stay then."""
    check_mp4(path, size)
    folder = frames_beside(path)
    try:
        frames_left(folder, cameras, made_of=made_of, resume=True)
    except InputError:
        remove_frames(path)
    made = write_folder(folder, cameras, draw, made_of=made_of, resume=True, describe=describe)
    encode_mp4(path, (_read(folder / name) for name in frame_files(cameras) if name != RECORD), size=size, fps=fps)
    remove_frames(path)
    return made


def remove_frames(path: Path) -> None:
    """Removes the frames of an unfinished video, where there are some; nothing else that is in their folder."""
    folder = frames_beside(path)
    if not (folder / RECORD).is_file():
        return
    for file in (*folder.glob("*.png"), folder / RECORD):
        file.unlink(missing_ok=True)
    if not any(folder.iterdir()):
        folder.rmdir()


def _read(path: Path) -> np.ndarray:
    """(H, W, 3) uint8."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except OSError as error:
        raise InputError(f"cannot be read ({error})", file=path, remedy="begin again: it is made anew") from None
