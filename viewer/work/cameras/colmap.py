"""COLMAP models: lenses (``cameras``) and world-to-camera poses with OpenCV camera axes (``images``), the text form here.

pycolmap, a compiled package of COLMAP as a whole, would be a dependency for these two tables alone.
"""

from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.text import whole_number
from ...picture.camera import Camera
from .parse import TO_OPENGL, Lens, camera, checked, numbers, read_text, rotation, shown

MODELS = {  # name: (focal lengths, parameters behind cx cy, all of them distortion)
    "SIMPLE_PINHOLE": (1, 0), "PINHOLE": (2, 0), "SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4),
    "FULL_OPENCV": (2, 8),
}
_PLACES = ("", "sparse/0", "sparse", "dense/sparse", "dense/0/sparse", "undistorted/sparse", "colmap/sparse/0", "colmap/sparse",
           "colmap", "distorted/sparse/0", "dslr/colmap", "iphone/colmap")  # fmt: skip
"""Folders below the given one in which a model is looked for; undistorted ones come before distorted ones."""
_FIELDS = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"


def find_model(folder: Path) -> Path | None:
    """The folder itself or the sub-folder that holds the model, as COLMAP, nerfstudio, 3D Gaussian splatting and ScanNet++ lay
    it out, text before binary; None if none does."""
    places = [folder / place for place in _PLACES]
    for below in ("sparse", "colmap/sparse"):  # of several models the first
        places += sorted(path for path in (folder / below).glob("[0-9]*") if path.is_dir())
    return next((f for name in ("images.txt", "images.bin") for f in places if (f / name).is_file()), None)


def read_text_model(folder: Path) -> list[Camera]:
    """The model's images in their order.  Raises InputError naming file and line."""
    lenses = read_lenses(folder / "cameras.txt")
    path = folder / "images.txt"
    lines = ((n, line.strip()) for n, line in enumerate(read_text(path).split("\n"), 1))
    lines = ((n, line) for n, line in lines if not line.startswith("#"))
    cameras = []
    for line_number, line in lines:
        if not line:
            continue
        where = f"{path}: line {line_number}"
        cameras.append(_image(where, line, lenses, folder / "cameras.txt"))
        _skip_points(path, *next(lines, (line_number + 1, "")))
    return cameras


def _image(where: str, line: str, lenses: dict[str, Lens], lens_file: Path) -> Camera:
    parts = line.split(maxsplit=9)
    if len(parts) < 10:
        raise InputError(f"{where}: expected {_FIELDS}, got {shown(line)}")
    name = stem(parts[9])
    where = f"{where} ({shown(name)})"
    pose = numbers(parts[1:8], 7, where)
    if parts[8] not in lenses:
        raise InputError(f"{where}: camera {shown(parts[8])} is not in {lens_file}")
    return posed(where, lenses[parts[8]], pose, name)


def stem(name: str) -> str:
    """A picture's name without folders and ending."""
    return Path(name.replace("\\", "/")).stem


def posed(where: str, lens: Lens, pose: np.ndarray, name: str) -> Camera:
    """pose: (7,) QW QX QY QZ TX TY TZ, world to camera, OpenCV camera axes."""
    camera_to_world = np.eye(4)
    camera_to_world[:3, :3] = rotation(pose[:4], where).T
    camera_to_world[:3, 3] = -camera_to_world[:3, :3] @ pose[4:]
    return camera(where, lens, camera_to_world @ TO_OPENGL, name)


def _skip_points(path: Path, line_number: int, line: str) -> None:
    """The second line of an image: X Y POINT3D_ID for each of its points, or empty.  Where somebody left it out, the
    next image stands here and would be lost without a word."""
    parts = line.split()
    if len(parts) % 3 or (parts and whole_number(parts[-1].removeprefix("-")) is None):
        raise InputError(f"line {line_number}: expected the points of the image above (an empty line will do), got "
                         f"{shown(line)}", file=path)


def read_lenses(path: Path) -> dict[str, Lens]:
    """CAMERA_ID as written -> lens, from cameras.txt.  Distortion and models that have no pinhole are refused."""
    lenses = {}
    for line_number, line in enumerate(read_text(path).split("\n"), 1):
        parts = line.split()
        if not parts or parts[0].startswith("#"):
            continue
        where = f"{path}: line {line_number}"
        if len(parts) < 5:
            raise InputError(f"{where}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS..., got {shown(line)}")
        if parts[1] not in MODELS:
            raise InputError(f"{where}: camera model {shown(parts[1])} is not supported ({', '.join(MODELS)} are)")
        values = numbers(parts[2:], 2 + parameters(parts[1]), f"{where}: {parts[1]}")
        lens = lens_of(where, parts[1], values)
        if lenses.setdefault(parts[0], lens) != lens:
            raise InputError(f"{where}: camera {shown(parts[0])} is there already, with another lens",
                             remedy="give each its own number")
    if not lenses:
        raise InputError("holds no cameras", file=path)
    return lenses


def parameters(model: str) -> int:
    """How many parameters a camera of this model has."""
    focals, others = MODELS[model]
    return focals + 2 + others


def lens_of(where: str, model: str, values: np.ndarray) -> Lens:
    """values: WIDTH HEIGHT PARAMS...  Raises InputError where the picture is distorted."""
    focals, _ = MODELS[model]
    if values[4 + focals :].any():
        bent = shown(values[4 + focals :].tolist())
        raise InputError(f"{where}: distortion {bent} is not supported", remedy="run `colmap image_undistorter` first")
    cx, cy = values[2 + focals : 4 + focals]
    return checked(where, Lens(values[0], values[1], values[2], values[1 + focals], cx, cy))
