"""COLMAP's text model: ``cameras.txt`` (lenses) and ``images.txt`` (world-to-camera poses, OpenCV camera axes)."""

from pathlib import Path

import numpy as np

from viewer.camera import Camera
from viewer.errors import InputError
from viewer.text import whole_number
from viewer.tools.camera_formats.parse import TO_OPENGL, Lens, camera, checked, numbers, read_text, rotation, shown

_MODELS = {  # name: (focal lengths, parameters behind cx cy, all of them distortion)
    "SIMPLE_PINHOLE": (1, 0), "PINHOLE": (2, 0), "SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4),
    "FULL_OPENCV": (2, 8),
}
_FIELDS = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"


def find_model(folder: Path) -> Path | None:
    """The folder itself or its usual sub-folder that holds the model, text before binary; None if neither does."""
    places = (folder, folder / "sparse" / "0", folder / "sparse")
    return next((f for name in ("images.txt", "images.bin") for f in places if (f / name).is_file()), None)


def read_colmap(folder: Path) -> list[Camera]:
    """The model's images in their order."""
    for name in ("cameras.txt", "images.txt"):
        if not (folder / name).is_file():
            if (folder / name).with_suffix(".bin").is_file():
                raise InputError(f"{(folder / name).with_suffix('.bin')}: COLMAP's binary model is not read; make it text by "
                                 f"`colmap model_converter --input_path {folder} --output_path {folder} --output_type TXT`")
            raise InputError(f"{folder / name}: no such file; COLMAP cameras need cameras.txt and images.txt together")
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
    name = Path(parts[9].replace("\\", "/")).stem
    where = f"{where} ({shown(name)})"
    pose = numbers(parts[1:8], 7, where)
    if parts[8] not in lenses:
        raise InputError(f"{where}: camera {shown(parts[8])} is not in {lens_file}")
    camera_to_world = np.eye(4)
    camera_to_world[:3, :3] = rotation(pose[:4], where).T
    camera_to_world[:3, 3] = -camera_to_world[:3, :3] @ pose[4:]
    return camera(where, lenses[parts[8]], camera_to_world @ TO_OPENGL, name)


def _skip_points(path: Path, line_number: int, line: str) -> None:
    """The second line of an image: X Y POINT3D_ID for each of its points, or empty.  Where somebody left it out, the
    next image stands here and would be lost without a word."""
    parts = line.split()
    if len(parts) % 3 or (parts and whole_number(parts[-1].removeprefix("-")) is None):
        raise InputError(
            f"{path}: line {line_number}: expected the points of the image above (an empty line will do), "
            f"got {shown(line)}"
        )


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
        if parts[1] not in _MODELS:
            raise InputError(f"{where}: camera model {shown(parts[1])} is not supported ({', '.join(_MODELS)} are)")
        focals, others = _MODELS[parts[1]]
        values = numbers(parts[2:], 2 + focals + 2 + others, f"{where}: {parts[1]}")
        if values[4 + focals :].any():
            bent = shown(values[4 + focals :].tolist())
            raise InputError(f"{where}: distortion {bent} is not supported; run `colmap image_undistorter` first")
        cx, cy = values[2 + focals : 4 + focals]
        lens = checked(where, Lens(values[0], values[1], values[2], values[1 + focals], cx, cy))
        if lenses.setdefault(parts[0], lens) != lens:
            raise InputError(f"{where}: camera {shown(parts[0])} is there already, with another lens; give each its own number")
    if not lenses:
        raise InputError(f"{path}: holds no cameras")
    return lenses
