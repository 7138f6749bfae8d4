"""Photographs in a folder with their cameras: nerfstudio's transforms.json, COLMAP, and ScanNet++'s layout of both."""

from functools import partial
from pathlib import Path

import numpy as np

from ...common.errors import InputError, Option
from ...readers.decoded_picture import decoded_picture
from ...readers.photographs.posed_photograph import PosedPhotograph
from ..cameras.camera_files import CAMERA_FORMATS, read_cameras

PHOTO_ENDINGS = (".jpg", ".jpeg", ".png")
_OTHERS = ("mask", "depth", "semantic", "normal", "thumb")
"""Parts of the names of folders whose pictures are no photographs but are named like them."""


def photographs_in(folder: Path) -> list[PosedPhotograph]:
    """The photographs of a folder that have a camera, not decoded; their poses are in the scan's coordinates.

    Raises InputError where the folder holds no cameras, a lens is distorted, or no camera has its photograph.
    """
    pictures: dict[str, Path] = {}
    for path in _pictures(folder):
        pictures.setdefault(path.stem, path)
    found = []
    for camera in read_cameras(folder):
        if (path := pictures.get(camera.name)) is not None:
            lens = camera.fx, camera.fy, camera.cx, camera.cy
            found.append(PosedPhotograph(str(path), "pinhole", camera.width, camera.height, lens, False, camera.camera_to_world,
                                         partial(_decode, path, (camera.width, camera.height))))
    if not found:
        raise InputError("holds no JPEG or PNG named like its cameras", file=folder)
    return found


def without_cameras(folder: Path) -> list[Path]:
    """The JPEG and PNG files of a folder that has no file of cameras; empty where it has one.  Raises InputError where there is
    no such folder."""
    found = _pictures(folder)
    return [] if any(row.place(folder) is not None for row in CAMERA_FORMATS) else found


def _pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InputError("no such folder", option=Option("--photos").name, value=folder,
                         remedy="give auto, off, or a folder of photographs, with or without transforms.json or a COLMAP model")
    found = []
    for path in sorted(folder.rglob("*")):
        inner = [part.lower() for part in path.relative_to(folder).parts[:-1]]
        if path.suffix.lower() in PHOTO_ENDINGS and not any(word in part for part in inner for word in _OTHERS):
            found.append(path)
    return found


def _decode(path: Path, size: tuple[int, int], longest: int) -> tuple[np.ndarray, None]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None
    picture, full = decoded_picture(data, str(path), longest)
    if full != size:
        raise InputError(f"has {full[0]}x{full[1]} pixels, its camera {size[0]}x{size[1]}", file=path)
    return picture, None
