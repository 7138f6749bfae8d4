"""Cameras from files: nerfstudio, COLMAP text and TUM trajectories, decided by name and content.

Whatever a file's own axes, what comes back is :class:`viewer.camera.Camera`: OpenGL camera axes, camera to world, the
scan's coordinates.  Distortion is refused, never ignored.  Every error is one line with file, frame and value.
"""

import json
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.errors import InputError
from viewer.tools.files import write_json

_TO_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # camera axes: OpenCV (y down, z forward) <-> OpenGL (y up, z backward)
_DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")
_COLMAP_MODELS = {  # name: (focal lengths, other parameters behind cx cy, all of them distortion)
    "SIMPLE_PINHOLE": (1, 0), "PINHOLE": (2, 0), "SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4),
    "FULL_OPENCV": (2, 8),
}


def read_cameras(path: Path, *, size: tuple[int, int] | None = None) -> list[Camera]:
    """All cameras of a file, or of a COLMAP folder, in its order, with names that are safe and unique as file names.

    size: width and height that every camera is resized to; for formats that hold none, the size itself.
    Raises InputError.
    """
    path = Path(path)
    if path.is_dir():
        folder = next((f for f in (path, path / "sparse" / "0", path / "sparse") if (f / "images.txt").is_file()), None)
        if folder is None:
            raise InputError(f"{path}: no cameras.txt and images.txt in this folder")
        cameras = _colmap(folder)
    elif not path.is_file():
        raise InputError(f"{path}: no such camera file")
    elif path.name in ("images.txt", "cameras.txt"):
        cameras = _colmap(path.parent)
    elif path.suffix.lower() == ".json":
        cameras = _json(path, size)
    else:
        cameras = _tum(path, size)
    if not cameras:
        raise InputError(f"{path}: holds no cameras")
    if size is not None:
        cameras = [camera.resized(*size) for camera in cameras]
    return _named(cameras)


def write_camera_path(path: Path, cameras: Iterable[Camera]) -> None:
    """Writes nerfstudio's camera_path.json (vertical field of view; the principal point must be the centre)."""
    cameras = list(cameras)
    if not cameras:
        raise InputError(f"{path}: no cameras to write")
    frames = [
        {
            "camera_to_world": camera.camera_to_world.ravel().tolist(), "fov": camera.vertical_fov,
            "aspect": camera.width / camera.height, "name": camera.name,
        }
        for camera in cameras
    ]
    write_json(path, {
        "camera_type": "perspective", "render_width": cameras[0].width, "render_height": cameras[0].height, "fps": 24,
        "seconds": len(frames) / 24, "camera_path": frames,
    })


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file") from None


def _numbers(values, count: int, where: str) -> np.ndarray:
    """``count`` finite numbers, or an InputError that starts with ``where``."""
    try:
        array = np.asarray(values, np.float64).ravel()
    except (TypeError, ValueError):
        raise InputError(f"{where}: expected {count} numbers, got {str(values)[:60]!r}") from None
    if array.size != count:
        raise InputError(f"{where}: expected {count} numbers, got {array.size}")
    if not np.isfinite(array).all():
        raise InputError(f"{where}: holds a value that is not finite ({array[~np.isfinite(array)][0]})")
    return array


def _number(entry: dict, key: str, where: str) -> float:
    if key not in entry:
        raise InputError(f"{where}: {key} is missing")
    return float(_numbers(entry[key], 1, f"{where}: {key}")[0])


def _json(path: Path, size: tuple[int, int] | None) -> list[Camera]:
    try:
        data = json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: not JSON (line {error.lineno}: {error.msg})") from None
    if isinstance(data, dict) and isinstance(data.get("frames"), list):
        return [_transforms_frame(path, data, frame, n) for n, frame in enumerate(data["frames"])]
    if isinstance(data, dict) and isinstance(data.get("camera_path"), list):
        return [_path_frame(path, data, frame, n, size) for n, frame in enumerate(data["camera_path"])]
    raise InputError(f"{path}: neither a transforms.json (\"frames\") nor a camera_path.json (\"camera_path\")")


def _transforms_frame(path: Path, shared: dict, frame: object, number: int) -> Camera:
    if not isinstance(frame, dict):
        raise InputError(f"{path}: frame {number} is not an object")
    name = Path(str(frame.get("file_path", f"frame_{number:05d}")).replace("\\", "/")).stem
    where = f"{path}: frame {number} ({name})"
    both = {**shared, **frame}
    model = str(both.get("camera_model", "OPENCV")).upper()
    if model not in ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE"):
        raise InputError(f"{where}: camera_model {model} is not supported; undistort the pictures to PINHOLE first")
    for key in _DISTORTION:
        if key in both and (value := _number(both, key, where)) != 0:
            raise InputError(f"{where}: distortion {key} = {value:g} is not supported; undistort the pictures first")
    width, height = _number(both, "w", where), _number(both, "h", where)
    if "fl_x" in both:
        fx = _number(both, "fl_x", where)
        fy = _number(both, "fl_y", where) if "fl_y" in both else fx
    else:
        fx = fy = 0.5 * width / np.tan(0.5 * _number(both, "camera_angle_x", f"{where}: no fl_x, and"))
    cx = _number(both, "cx", where) if "cx" in both else width / 2
    cy = _number(both, "cy", where) if "cy" in both else height / 2
    pose = frame.get("transform_matrix")
    if isinstance(pose, list) and len(pose) == 3:
        pose = [*pose, [0, 0, 0, 1]]
    matrix = _numbers(pose, 16, f"{where}: transform_matrix").reshape(4, 4)
    return _camera(where, int(width), int(height), fx, fy, cx, cy, matrix, name)


def _path_frame(path: Path, shared: dict, frame: object, number: int, size: tuple[int, int] | None) -> Camera:
    if not isinstance(frame, dict):
        raise InputError(f"{path}: camera {number} is not an object")
    name = str(frame.get("name") or f"frame_{number:05d}")
    where = f"{path}: camera {number} ({name})"
    matrix = _numbers(frame.get("camera_to_world"), 16, f"{where}: camera_to_world").reshape(4, 4)
    fov = _number(frame, "fov", where)
    if not 0 < fov < 180:
        raise InputError(f"{where}: fov {fov:g}: expected degrees above 0 and below 180")
    if "render_height" in shared:
        height = _number(shared, "render_height", str(path))
        default = height * _number(frame, "aspect", where) if "aspect" in frame else height
        width = _number(shared, "render_width", str(path)) if "render_width" in shared else default
    elif size is not None:
        width, height = size
    else:
        raise InputError(f"{path}: holds no render_width and render_height; give --size")
    try:
        return from_fov(round(width), round(height), fov, matrix, name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _camera(where: str, width: int, height: int, fx, fy, cx, cy, matrix: np.ndarray, name: str) -> Camera:
    try:
        return Camera(width, height, float(fx), float(fy), float(cx), float(cy), matrix, name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _rotation(quaternion: np.ndarray, where: str) -> np.ndarray:
    """(3, 3) from w, x, y, z of any length above 0."""
    length = np.linalg.norm(quaternion)
    if not length > 1e-9:
        raise InputError(f"{where}: the quaternion is zero")
    w, x, y, z = quaternion / length
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def _colmap(folder: Path) -> list[Camera]:
    for name in ("cameras.txt", "images.txt"):
        if not (folder / name).is_file():
            raise InputError(f"{folder / name}: no such file; COLMAP cameras need cameras.txt and images.txt side by side")
    lenses = _colmap_lenses(folder / "cameras.txt")
    path = folder / "images.txt"
    lines = [(n, line.strip()) for n, line in enumerate(_text(path).splitlines(), 1) if not line.lstrip().startswith("#")]
    while lines and not lines[0][1]:
        lines.pop(0)
    cameras = []
    for number, line in lines[::2]:  # the second line of each image lists its points, and may be empty
        if not line:
            continue
        where = f"{path}: line {number}"
        parts = line.split(maxsplit=9)
        if len(parts) < 10:
            raise InputError(f"{where}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, got {line[:60]!r}")
        pose = _numbers(parts[1:8], 7, where)
        if parts[8] not in lenses:
            raise InputError(f"{where}: camera {parts[8]} is not in {folder / 'cameras.txt'}")
        world_to_camera = np.eye(4)
        world_to_camera[:3, :3], world_to_camera[:3, 3] = _rotation(pose[:4], where), pose[4:]
        matrix = np.linalg.inv(world_to_camera) @ _TO_OPENGL
        cameras.append(_camera(where, *lenses[parts[8]], matrix, Path(parts[9].replace("\\", "/")).stem))
    return cameras


def _colmap_lenses(path: Path) -> dict[str, tuple[int, int, float, float, float, float]]:
    lenses = {}
    for number, line in enumerate(_text(path).splitlines(), 1):
        parts = line.split()
        if not parts or parts[0].startswith("#"):
            continue
        where = f"{path}: line {number}"
        if len(parts) < 5 or parts[1] not in _COLMAP_MODELS:
            model = parts[1] if len(parts) > 1 else line
            raise InputError(f"{where}: camera model {model!r} is not supported ({', '.join(_COLMAP_MODELS)} are)")
        focals, others = _COLMAP_MODELS[parts[1]]
        values = _numbers(parts[2:], 2 + focals + 2 + others, where)
        if values[4 + focals :].any():
            raise InputError(f"{where}: distortion {values[4 + focals:].tolist()} is not supported; undistort first")
        cx, cy = values[2 + focals : 4 + focals]
        lenses[parts[0]] = (int(values[0]), int(values[1]), values[2], values[1 + focals], cx, cy)
    if not lenses:
        raise InputError(f"{path}: holds no cameras")
    return lenses


def _tum(path: Path, size: tuple[int, int] | None) -> list[Camera]:
    """``time tx ty tz qx qy qz qw`` a line: camera to world, OpenCV camera axes, as in the TUM RGB-D data set."""
    rows = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            parts = line.replace(",", " ").split()
            where = f"{path}: line {number}"
            if len(parts) != 8:
                raise InputError(f"{where}: expected `time tx ty tz qx qy qz qw`, got {line[:60]!r}")
            rows.append((where, parts[0], _numbers(parts, 8, where)))
    if not rows:
        return []
    lens = _tum_lens(path, size)
    cameras = []
    for where, time, values in rows:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = _rotation(values[[7, 4, 5, 6]], where), values[1:4]
        cameras.append(_camera(where, *lens, matrix @ _TO_OPENGL, time))
    return cameras


def _tum_lens(path: Path, size: tuple[int, int] | None) -> tuple[int, int, float, float, float, float]:
    for beside in (path.with_name(f"{path.stem}.intrinsics.txt"), path.with_name("intrinsics.txt")):
        if beside.is_file():
            break
    else:
        if path.with_name("cameras.txt").is_file():
            return next(iter(_colmap_lenses(path.with_name("cameras.txt")).values()))
        raise InputError(f"{path}: a trajectory needs intrinsics beside it; add intrinsics.txt with `fx fy cx cy width height`")
    lines = [line for line in _text(beside).splitlines() if not line.lstrip().startswith("#")]
    words = " ".join(lines).replace(",", " ").split()
    if len(words) not in (4, 6, 9, 11):
        raise InputError(f"{beside}: expected `fx fy cx cy [width height]` or a 3x3 matrix, got {len(words)} numbers")
    values = _numbers(words, len(words), str(beside))
    if len(values) >= 9:
        fx, fy, cx, cy, rest = values[0], values[4], values[2], values[5], values[9:]
    else:
        (fx, fy, cx, cy), rest = values[:4], values[4:]
    width, height = rest if len(rest) else (size or (round(2 * cx), round(2 * cy)))
    return int(width), int(height), fx, fy, cx, cy


def _named(cameras: list[Camera]) -> list[Camera]:
    """Names without separators or leading dots, no two alike."""
    from dataclasses import replace

    out, seen = [], set()
    for number, camera in enumerate(cameras):
        base = re.sub(r"[^\w.+-]+", "_", camera.name).lstrip(".") or f"camera_{number:05d}"
        name, copy = base, 2
        while name in seen:
            name, copy = f"{base}_{copy}", copy + 1
        seen.add(name)
        out.append(camera if name == camera.name else replace(camera, name=name))
    return out
