"""nerfstudio's ``transforms.json`` (pictures a scene was trained on) and ``camera_path.json`` (pictures to render).

Both hold camera-to-world matrices, row-major, with OpenGL camera axes, in the scene's coordinates.  ns-process-data turns and
scales the scene first and states how (applied_transform, applied_scale); that is taken back, so that cameras fit the scan.
"""

import json
import logging
from pathlib import Path

import numpy as np

from ...common.errors import InputError, Option
from ...picture.camera import Camera
from .parse import Lens, camera, json_numbers, number, pose_matrix, read_text, shown

_MODELS = ("OPENCV", "FULL_OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE")
_PICTURES = ("", ".png", ".jpg", ".jpeg", ".JPG", ".PNG")  # endings that file_path may lack
_log = logging.getLogger(__name__)
_DISTORTION = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")


def read_json(path: Path, size: tuple[int, int] | None) -> list[Camera]:
    """Cameras of either file, told apart by their keys.  size: width and height where the file holds none."""
    text = read_text(path)
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"not JSON (line {error.lineno}: {error.msg})", file=path) from None
    except (ValueError, RecursionError):  # thousands of digits, thousands of brackets
        raise InputError("not JSON of any camera file", file=path) from None
    if isinstance(data, dict) and isinstance(data.get("frames"), list):
        undo = _undone(path, data)
        return [_picture(path, data, frame, n, size, undo) for n, frame in enumerate(data["frames"])]
    if isinstance(data, dict) and isinstance(data.get("camera_path"), list):
        return [_path_frame(path, data, frame, n, size) for n, frame in enumerate(data["camera_path"])]
    keys = f"keys {', '.join(map(shown, list(data)[:5])) or '(none)'}" if isinstance(data, dict) else shown(data)
    raise InputError(f'neither a transforms.json (a list "frames") nor a camera_path.json (a list "camera_path"): {keys}',
                     file=path)


def _undone(path: Path, data: dict) -> np.ndarray | None:
    """(4, 4): from the frame of the file's poses to that of the scene before ns-process-data; None where they are the same."""
    if data.get("applied_transform") is None and data.get("applied_scale") is None:
        return None
    applied = np.eye(4)
    if (rows := data.get("applied_transform")) is not None:
        if not isinstance(rows, list) or len(rows) not in (3, 4):
            raise InputError(f"applied_transform: expected 3 or 4 rows of 4 numbers, got {shown(rows)}", file=path)
        applied = pose_matrix(rows if len(rows) == 4 else [*rows, [0, 0, 0, 1]], f"{path}: applied_transform")
    scale = number(data, "applied_scale", str(path)) if data.get("applied_scale") is not None else 1.0
    applied[:3] *= scale
    if not scale > 0 or not abs(np.linalg.det(applied)) > 0:
        raise InputError(f"applied_transform and applied_scale ({scale:g}) cannot be taken back", file=path,
                         remedy="remove them")
    if np.array_equal(applied, np.eye(4)):
        return None
    _log.warning("%s: cameras are taken back by its applied_transform to the coordinates before ns-process-data", path)
    return np.linalg.inv(applied)


def _refuse_bent(both: dict, where: str) -> None:
    """A distorted or fisheye picture drawn as a pinhole would be wrong everywhere, so it is refused by name."""
    for key in ("camera_model", "camera_type"):
        if (model := str(both.get(key, "PINHOLE"))).upper() not in _MODELS:
            raise InputError(f"{where}: {key} {shown(model)} is not supported",
                             remedy="undistort the pictures to PINHOLE first")
    for key in ("is_fisheye", "is_equirectangular"):
        if both.get(key):
            raise InputError(f"{where}: {key} {shown(both[key])} is not supported", remedy="undistort the pictures first")
    for key in _DISTORTION:
        if key in both and (value := number(both, key, where)) != 0:
            raise InputError(f"{where}: distortion {key} = {value:g} is not supported", remedy="undistort the pictures first")
    listed = both.get("distortion_params")
    values = list(listed.values()) if isinstance(listed, dict) else listed if isinstance(listed, list) else [listed]
    if listed is not None and any(json_numbers(values, len(values), f"{where}: distortion_params")):
        raise InputError(f"{where}: distortion_params {shown(listed)} is not supported", remedy="undistort the pictures first")


def _focal(side: float, angle: float) -> float:
    """Pixels, from the angle in radians across ``side`` pixels; infinite, and refused later, for one next to 0."""
    return float(0.5 * side / np.tan(np.float64(angle) / 2))


def _from_angle(both: dict, key: str, side: float, where: str) -> float:
    angle = number(both, key, where)
    if not 0 < angle < np.pi:
        raise InputError(f"{where}: {key} {angle:g}: expected radians above 0 and below pi")
    return _focal(side, angle)


def _picture(path: Path, shared: dict, frame: object, index: int, size: tuple[int, int] | None,
             undo: np.ndarray | None) -> Camera:  # fmt: skip
    if not isinstance(frame, dict):
        raise InputError(f"frame {index} is not an object: {shown(frame)}", file=path)
    name = Path(str(frame.get("file_path") or f"frame_{index:05d}").replace("\\", "/")).stem
    where = f"{path}: frame {index} ({shown(name)})"
    both = {**shared, **frame}
    _refuse_bent(both, where)
    if not {"fl_x", "camera_angle_x"} & both.keys():
        raise InputError(f"{where}: neither fl_x nor camera_angle_x is there")
    if size and not {"w", "h", "fl_x"} & both.keys():
        width, height = size  # an angle fits any size; a focal length in pixels only its own
    elif not {"w", "h"} & both.keys() and (found := _size_of(path, frame)):
        width, height = found
    else:
        width, height = number(both, "w", where), number(both, "h", where)
    if "fl_x" in both:
        fx = number(both, "fl_x", where)
        fy = number(both, "fl_y", where) if "fl_y" in both else fx
    else:
        fx = _from_angle(both, "camera_angle_x", width, where)
        fy = _from_angle(both, "camera_angle_y", height, where) if "camera_angle_y" in both else fx
    cx = number(both, "cx", where) if "cx" in both else width / 2
    cy = number(both, "cy", where) if "cy" in both else height / 2
    pose = frame.get("transform_matrix")
    if isinstance(pose, list) and len(pose) == 3:
        pose = [*pose, [0, 0, 0, 1]]
    matrix = pose_matrix(pose, f"{where}: transform_matrix")
    if undo is not None:
        matrix = undo @ matrix
        matrix[:3, :3] /= np.linalg.norm(undo[:3, 0]) or 1.0  # the scene was scaled, not the camera
    return camera(where, Lens(width, height, fx, fy, cx, cy), matrix, name)


def _size_of(path: Path, frame: dict) -> tuple[int, int] | None:
    """Width and height of a frame's picture, where it lies beside the file; None where it does not."""
    from PIL import Image

    name = str(frame.get("file_path") or "").replace("\\", "/")
    for ending in _PICTURES if name else ():
        try:
            if (beside := path.parent / f"{name}{ending}").is_file():
                with Image.open(beside) as picture:
                    return picture.size
        except (OSError, ValueError, Image.DecompressionBombError):
            continue
    return None


def _path_frame(path: Path, shared: dict, frame: object, index: int, size: tuple[int, int] | None) -> Camera:
    if not isinstance(frame, dict):
        raise InputError(f"frame {index} is not an object: {shown(frame)}", file=path)
    name = str(frame.get("name") or f"frame_{index:05d}")
    where = f"{path}: frame {index} ({shown(name)})"
    _refuse_bent({**shared, **frame}, where)
    matrix = pose_matrix(frame.get("camera_to_world"), f"{where}: camera_to_world")
    fov = number(frame, "fov", where)
    if not 0 < fov < 180:
        raise InputError(f"{where}: fov {fov:g}: expected degrees above 0 and below 180")
    if "render_height" in shared:
        height = number(shared, "render_height", str(path))
        aspect = number(frame, "aspect", where) if "aspect" in frame else 1.0
        width = number(shared, "render_width", str(path)) if "render_width" in shared else round(height * aspect)
    elif size is not None:
        width, height = size
    else:
        raise InputError("holds no render_width and render_height", file=path, remedy=("give ", Option("--size")))
    focal = _focal(height, np.radians(fov))
    return camera(where, Lens(width, height, focal, focal, width / 2, height / 2), matrix, name)
