"""Trajectories of the TUM RGB-D benchmark: ``time tx ty tz qx qy qz qw`` a line, camera to world, OpenCV camera axes.

A trajectory knows no lens: that stands beside it in ``NAME.intrinsics.txt``, ``intrinsics.txt`` or COLMAP's
``cameras.txt``, looked for in this order.
"""

from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.camera import Camera
from .colmap import read_lenses
from .parse import TO_OPENGL, Lens, camera, checked, numbers, read_text, rotation, shown


def read_tum(path: Path, size: tuple[int, int] | None) -> list[Camera]:
    """The trajectory's poses, each named by its time as written.  size: width and height where none is written."""
    rows = []
    for line_number, line in enumerate(read_text(path).split("\n"), 1):
        parts = line.replace(",", " ").split()
        if not parts or parts[0].startswith("#"):
            continue
        where = f"{path}: line {line_number}"
        if len(parts) != 8:
            raise InputError(f"{where}: expected `time tx ty tz qx qy qz qw`, got {shown(line)}")
        where = f"{where} ({shown(parts[0])})"
        rows.append((where, parts[0], numbers(parts, 8, where)))
    if not rows:
        return []
    lens = _lens_beside(path, size)
    cameras = []
    for where, time, values in rows:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation(values[[7, 4, 5, 6]], where), values[1:4]
        cameras.append(camera(where, lens, matrix @ TO_OPENGL, time))
    return cameras


def _lens_beside(path: Path, size: tuple[int, int] | None) -> Lens:
    for name in (f"{path.stem}.intrinsics.txt", "intrinsics.txt"):
        if path.with_name(name).is_file():
            return _intrinsics(path.with_name(name), size)
    colmap = path.with_name("cameras.txt")
    if not colmap.is_file():
        raise InputError("a trajectory needs intrinsics beside it", file=path,
                         remedy="add intrinsics.txt with `fx fy cx cy width height`")
    lenses = list(read_lenses(colmap).values())
    if len(lenses) > 1:
        raise InputError(f"holds {len(lenses)} cameras; for the trajectory {path.name} leave only its own", file=colmap)
    return lenses[0]


def _intrinsics(path: Path, size: tuple[int, int] | None) -> Lens:
    """``fx fy cx cy [w h]``, or the matrix fx 0 cx / 0 fy cy / 0 0 1 and perhaps ``w h``."""
    text = " ".join(line for line in read_text(path).split("\n") if not line.lstrip().startswith("#"))
    words = text.replace(",", " ").split()
    if len(words) not in (4, 6, 9, 11):
        raise InputError(f"expected `fx fy cx cy [width height]` or a 3x3 matrix, got {len(words)} numbers", file=path)
    values = numbers(words, len(words), str(path))
    if len(values) < 9:
        (fx, fy, cx, cy), rest = values[:4], values[4:]
    else:
        matrix, rest = values[:9].reshape(3, 3), values[9:]
        if not np.array_equal([*matrix[[0, 1, 2, 2], [1, 0, 0, 1]], matrix[2, 2]], [0, 0, 0, 0, 1]):
            # nine numbers may also be a lens and its distortion
            raise InputError(f"{shown(matrix.tolist())} is not a matrix fx 0 cx, 0 fy cy, 0 0 1", file=path)
        fx, fy, cx, cy = matrix[[0, 1, 0, 1], [0, 1, 2, 2]]
    width, height = rest if len(rest) else size or np.rint([2 * cx, 2 * cy])
    if not np.isfinite([width, height]).all():
        raise InputError(f"principal point ({cx:g}, {cy:g}) is out of any picture", file=path)
    return checked(str(path), Lens(width, height, fx, fy, cx, cy))
