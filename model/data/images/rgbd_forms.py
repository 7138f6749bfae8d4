"""Reads RGB-D frames with poses from folders in three formats.

nerfstudio: ``transforms.json`` with ``depth_file_path`` in its frames.  TUM: ``rgb.txt``, ``depth.txt`` and
``groundtruth.txt``.
ScanNet: ``color/``, ``depth/`` and ``pose/``, and similarly 7-Scenes: ``frame-*.color.png`` with ``.depth.png`` and
``.pose.txt``, both with a file of intrinsics.

World frame: the poses' own, metres.  Camera frames are OpenGL's, as in nerfstudio; those of TUM, ScanNet and 7-Scenes are
OpenCV's and are converted.  Their principal points are relative to pixel centres, ours to pixel corners, so half a pixel is
added.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation, Slerp

from ...common.errors import DataError
from ..dataset import FAR, MAX_FOCAL, reason
from .lens import Lens
from .photos import check_pictures
from .rgbd_frame import MILLIMETRE, RgbdFrame

APART = 0.02
"""Largest time between a picture and its depth, seconds: as in TUM's own tool for association."""
POSE_GAP = 0.2
"""Largest time between the poses before and after a picture, seconds.  A camera that accelerates by 1 m/s2 is then at most 5 mm
off the straight line between them (a t2 / 8), as much as a Kinect's depth at 2 m (Khoshelham and Elberink 2012)."""
TUM_UNIT = 1 / 5000
"""Metres of one step of depth in TUM's format."""
TUM_ROS = (525.0, 525.0, 319.5, 239.5)
"""fx, fy, cx, cy, pixels, that TUM recommends for all its sequences: their depth was registered with these values."""
TO_OPENGL = np.diag((1.0, -1.0, -1.0, 1.0))
"""OpenCV to OpenGL camera axes."""
_NERFSTUDIO_DISTORTIONS = {"PINHOLE": (), "OPENCV": ("k1", "k2", "p1", "p2"), "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4")}
"""nerfstudio's camera models and their distortion parameters."""
INTRINSICS = ("intrinsic/intrinsic_color.txt", "intrinsic_color.txt", "intrinsics.txt", "camera-intrinsics.txt",
              "calibration.txt", "camera.txt")


def read_frames(folder: Path, unit: float | None) -> list[RgbdFrame]:
    """The folder's frames in order.  unit: metres of one step of depth; None: the format's.

    Raises DataError where the folder has none of the formats or its files are invalid.  Whether all pictures exist is not
    checked.
    """
    if (folder / "transforms.json").is_file():
        return _nerfstudio(folder, unit)
    if all((folder / name).is_file() for name in ("rgb.txt", "depth.txt", "groundtruth.txt")):
        return _tum(folder, unit)
    if (folder / "pose").is_dir():
        names = [(p, folder / "color", folder / "depth", p.stem, "") for p in (folder / "pose").glob("*.txt")]
        return _posed(folder, names, unit)
    if any(folder.glob("*.pose.txt")):
        names = [(p, folder, folder, p.name.removesuffix(".pose.txt"), k) for p in folder.glob("*.pose.txt") for k in ["."]]
        return _posed(folder, names, unit)
    raise DataError("neither transforms.json, nor rgb.txt, depth.txt and groundtruth.txt, nor color/, depth/ and pose/, nor "
                    "frame-*.pose.txt in this folder", file=folder)


def _nerfstudio(folder: Path, unit: float | None) -> list[RgbdFrame]:
    path = folder / "transforms.json"
    try:
        data = json.loads(path.read_text())
        entries = data["frames"]
        if without := [str(e.get("file_path")) for e in entries if "depth_file_path" not in e]:
            raise DataError(f"{len(without)} of {len(entries)} frames have no depth_file_path: {', '.join(without[:10])}",
                            file=path)
        unit = unit or float(data.get("depth_unit_scale_factor", data.get("integer_depth_scale", MILLIMETRE)))
        frames = []
        for entry in entries:
            pose = _checked(f"{path}: {entry['file_path']}", np.asarray(entry["transform_matrix"], np.float64).reshape(4, 4))
            mask = folder / entry["mask_path"] if "mask_path" in entry else None
            lens = _nerfstudio_lens(f"{path}: {entry['file_path']}", {**data, **entry})
            frames.append(RgbdFrame(folder / entry["file_path"], lens, pose, mask, folder / entry["depth_file_path"], unit))
    except (OSError, KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        raise DataError(f"not a nerfstudio description ({reason(error)})", file=path) from None
    return sorted(frames, key=lambda frame: str(frame.path))


def _nerfstudio_lens(where: str, facts: dict) -> Lens:
    model = str(facts.get("camera_model", "OPENCV"))
    if model not in _NERFSTUDIO_DISTORTIONS or (model == "OPENCV" and facts.get("k4")):
        raise DataError(f"{where}: camera {model} is not supported (OPENCV without k4, OPENCV_FISHEYE and PINHOLE are)")
    fx = float(facts["fl_x"])
    values = [fx, float(facts.get("fl_y", fx)), float(facts["cx"]), float(facts["cy"])]
    distortion = [float(facts.get(key, 0.0)) for key in _NERFSTUDIO_DISTORTIONS[model]]
    lens = Lens.colmap(where, model, int(facts["w"]), int(facts["h"]), values + distortion)
    k3 = float(facts.get("k3", 0.0))
    return replace(lens, distortion=(*distortion, k3)) if model == "OPENCV" and k3 else lens


def _tum(folder: Path, unit: float | None) -> list[RgbdFrame]:
    pictures, depths, poses = (_listed(folder / name) for name in ("rgb.txt", "depth.txt", "groundtruth.txt"))
    try:
        rows = np.array([[time, *map(float, words[:7])] for time, words in poses], np.float64).reshape(-1, 8)
        if not (np.abs(rows[:, 1:]) < FAR).all() or not np.isfinite(rows).all():
            raise ValueError("invalid time, position or rotation")
        turns = Rotation.from_quat(rows[:, 4:])
    except ValueError:
        raise DataError("expected lines of: timestamp tx ty tz qx qy qz qw", file=folder / "groundtruth.txt") from None
    depth_times = np.array([time for time, _ in depths])
    frames = []
    for time, words in pictures:
        nearest = int(np.abs(depth_times - time).argmin()) if len(depth_times) else -1
        after = int(np.searchsorted(rows[:, 0], time))
        if nearest < 0 or abs(depth_times[nearest] - time) > APART or not 0 < after < len(rows):
            continue
        before = slice(after - 1, after + 1)
        if rows[after, 0] - rows[after - 1, 0] > POSE_GAP:
            continue
        pose = np.eye(4)
        pose[:3, :3] = Slerp(rows[before, 0], turns[before])(time).as_matrix()
        pose[:3, 3] = [np.interp(time, rows[before, 0], rows[before, axis]) for axis in (1, 2, 3)]
        frames.append((folder / words[0], pose @ TO_OPENGL, folder / depths[nearest][1][0]))
    if not frames:
        raise DataError(f"no picture has depth within {APART} s and poses around it within {POSE_GAP} s; do rgb.txt, "
                        "depth.txt and groundtruth.txt use the same clock?", file=folder)
    check_pictures(folder, [(p, None) for path, _, depth_path in frames for p in (path, depth_path)])
    lens = _tum_lens(folder, frames[0][0])
    return [RgbdFrame(path, lens, pose, None, depth_path, unit or TUM_UNIT) for path, pose, depth_path in frames]


def _listed(path: Path) -> list[tuple[float, list[str]]]:
    """Time and the other words of each line, sorted by time, with one line for each time."""
    try:
        rows = [line.split() for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
        listed = sorted(((float(words[0]), words[1:]) for words in rows), key=lambda row: row[0])
    except (OSError, ValueError) as error:
        raise DataError(f"not lines that begin with a timestamp ({error})", file=path) from None
    if any(not words for _, words in listed):
        raise DataError("a line has only a timestamp", file=path)
    return [row for k, row in enumerate(listed) if k == 0 or row[0] > listed[k - 1][0]]


def _tum_lens(folder: Path, picture: Path) -> Lens:
    found = _intrinsics(folder)
    if found is None and _size(picture) != (640, 480):
        raise DataError(f"{picture.name} is not 640x480, so TUM's intrinsics do not apply", file=folder,
                        remedy="put fx fy cx cy into calibration.txt")
    return _centred(found or TUM_ROS, _size(picture))


def _posed(folder: Path, names: list[tuple[Path, Path, Path, str, str]], unit: float | None) -> list[RgbdFrame]:
    """Frames with one pose file each.  A pose that is not finite means that tracking was lost; its frame is left out."""
    def order(entry: tuple[Path, Path, Path, str, str]):
        digits = "".join(c for c in entry[3] if c.isdigit())
        return int(digits or 0), entry[3]

    found = _intrinsics(folder)
    if found is None:
        raise DataError("no intrinsics", file=folder,
                        remedy=f"put fx fy cx cy, or a 3x3 matrix, into one of: {', '.join(INTRINSICS)}")
    own = folder / "intrinsic" / "intrinsic_depth.txt"
    frames, lens, depth_lens = [], None, None
    for pose_path, pictures, depths, stem, dot in sorted(names, key=order):
        colour, depth = (f"{stem}{dot}color", f"{stem}{dot}depth") if dot else (stem, stem)
        path = next((p for s in (".jpg", ".png", ".jpeg") if (p := pictures / f"{colour}{s}").is_file()),
                    pictures / f"{colour}.jpg")
        depth_path = next((p for s in (".png", ".npy", ".tiff") if (p := depths / f"{depth}{s}").is_file()),
                          depths / f"{depth}.png")
        try:
            pose = _table(pose_path).reshape(4, 4)
        except (OSError, ValueError):
            raise DataError("not 4x4 numbers", file=pose_path, remedy="extract or download it again") from None
        if not np.isfinite(pose).all():
            continue
        if lens is None and path.is_file():
            lens = _centred(found, _size(path))
        if depth_lens is None and own.is_file() and depth_path.is_file():
            depth_lens = _centred(_numbers(own), _size(depth_path))
        frames.append((path, _checked(str(pose_path), pose) @ TO_OPENGL, depth_path))
    if frames and (lens is None or (own.is_file() and depth_lens is None)):
        check_pictures(folder, [(p, None) for path, _, depth_path in frames for p in (path, depth_path)])
        raise DataError("no pictures beside its poses", file=folder)
    return [RgbdFrame(p, lens, c, None, d, unit or MILLIMETRE, depth_lens) for p, c, d in frames] if lens else []


def _checked(where: str, pose: np.ndarray) -> np.ndarray:
    near = (np.abs(pose) < FAR).all()  # false for NaN
    if not near or not np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-2):
        raise DataError(f"{where}: its pose is not a rotation and a translation in metres")
    return pose


def _size(path: Path) -> tuple[int, int]:
    try:
        if path.suffix == ".npy":
            rows, columns = np.load(path, mmap_mode="r").shape
            return columns, rows
        with Image.open(path) as image:
            return image.size
    except Exception as error:  # Pillow raises nearly anything for damaged pictures
        raise DataError(f"cannot be read ({reason(error)})", file=path) from None


def _intrinsics(folder: Path) -> tuple[float, ...] | None:
    path = next((p for name in INTRINSICS for p in (folder / name, folder.parent / name) if p.is_file()), None)
    return None if path is None else _numbers(path)


def _numbers(path: Path) -> tuple[float, ...]:
    """fx, fy, cx, cy from a row of them or from a 3x3 or 4x4 matrix."""
    try:
        table = _table(path)
    except (OSError, ValueError) as error:
        raise DataError(f"intrinsics are not a table of numbers ({error})", file=path) from None
    if table.shape in ((3, 3), (4, 4)):
        values = (table[0, 0], table[1, 1], table[0, 2], table[1, 2])
    elif table.shape == (1, 4):
        values = tuple(table[0])
    else:
        raise DataError(f"{table.shape[0]}x{table.shape[1]} numbers; expected fx fy cx cy or a 3x3 or 4x4 matrix", file=path)
    if not ((np.abs(values) < MAX_FOCAL).all() and values[0] > 0 and values[1] > 0):
        raise DataError(f"{[float(v) for v in values]}: not valid intrinsics of a camera", file=path)
    return tuple(float(v) for v in values)


def _table(path: Path) -> np.ndarray:
    """(rows, columns) float64.  Raises OSError, or ValueError where the file has no such table."""
    lines = [line for line in path.read_text().splitlines() if line.partition("#")[0].strip()] if path.is_file() else []
    if not lines:
        raise ValueError("it has no numbers")
    return np.loadtxt(lines, np.float64, ndmin=2)


def _centred(values: Sequence[float], size: tuple[int, int]) -> Lens:
    """A pinhole from intrinsics whose principal point is relative to the centre of the first pixel."""
    fx, fy, cx, cy = values
    return Lens("PINHOLE", *size, fx, fy, cx + 0.5, cy + 0.5)
