"""Photographs in a folder with their cameras: nerfstudio's transforms.json, COLMAP, and ScanNet++'s layout of both."""

import logging
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from ...common.errors import InputError, Option
from ...common.progress import progress
from ...readers.decoded_picture import decoded_picture
from ...readers.photographs.placed_photographs import bytes_of
from ...readers.photographs.posed_photograph import PosedPhotograph
from ..cameras.camera_files import CAMERA_FORMATS, read_cameras

log = logging.getLogger(__name__)

PHOTO_ENDINGS = (".jpg", ".jpeg", ".png")
_TRIED = 64
"""Pixels: a JPEG is decoded at an eighth of its size then."""
_NAMED = 3
"""Names of absent photographs that a message holds."""
_OTHERS = ("mask", "depth", "semantic", "normal", "thumb")
"""Parts of the names of folders whose pictures are no photographs but are named like them."""


def photographs_in(folder: Path, *, tell: bool = True) -> list[PosedPhotograph]:
    """The photographs of a folder that have a camera, not decoded; their poses are in the scan's coordinates.

    tell: whether the log names cameras that have no photograph.
    Raises InputError where the folder holds no cameras, a lens is distorted, or no camera has its photograph.
    """
    pictures: dict[str, Path] = {}
    for path in _pictures(folder):
        pictures.setdefault(path.stem, path)
    found, absent = [], []
    for camera in read_cameras(folder):
        if (path := pictures.get(camera.name)) is None:
            absent.append(camera.name)
            continue
        lens = camera.fx, camera.fy, camera.cx, camera.cy
        found.append(PosedPhotograph(str(path), "pinhole", camera.width, camera.height, lens, False, camera.camera_to_world,
                                     partial(_decode, path, (camera.width, camera.height)), path.name))
    if not found:
        raise InputError("holds no JPEG or PNG named like its cameras", file=folder)
    if absent and tell:
        cameras = "a camera has" if len(absent) == 1 else f"{len(absent)} cameras have"
        names = ", ".join(absent[:_NAMED]) + (" ..." if len(absent) > _NAMED else "")
        log.warning("%s: %s no photograph there: %s", folder, cameras, names)
    return found


def without_cameras(folder: Path) -> list[Path]:
    """The JPEG and PNG files of a folder that has no file of cameras; empty where it has one.  Raises InputError where there is
    no such folder, or nothing of both in it."""
    found = _pictures(folder)
    if any(row.place(folder) is not None for row in CAMERA_FORMATS):
        return []
    if not found:
        raise InputError("holds no photographs: no JPEG or PNG, and no cameras", file=folder,
                         remedy="name a folder of photographs, with or without transforms.json or a COLMAP model")
    return found


def decodable(paths: Sequence[Path]) -> tuple[list[Path], list[InputError]]:
    """The pictures that can be decoded, tried at a small size, and why the others cannot.  Reports progress."""
    kept, errors = [], []
    with progress(len(paths), "checking photographs", "photograph") as meter:
        for path in paths:
            try:
                decoded_picture(bytes_of(path), str(path), _TRIED)
                kept.append(path)
            except InputError as error:
                errors.append(error)
            meter.update(1)
    return kept, errors


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
    picture, full = decoded_picture(bytes_of(path), str(path), longest)
    if full != size:
        raise InputError(f"has {full[0]}x{full[1]} pixels, its camera {size[0]}x{size[1]}", file=path)
    return picture, None
