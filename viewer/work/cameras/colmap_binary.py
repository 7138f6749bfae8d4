"""COLMAP's binary model: ``cameras.bin`` and ``images.bin``, little-endian, as COLMAP's ``reconstruction_io`` writes them.

Every count and length is checked against the file before it is trusted.
"""

import struct
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...picture.camera import Camera
from .colmap import MODELS, lens_of, parameters, posed, stem
from .parse import Lens, numbers, shown

_MODEL_IDS = {
    0: "SIMPLE_PINHOLE", 1: "PINHOLE", 2: "SIMPLE_RADIAL", 3: "RADIAL", 4: "OPENCV", 5: "OPENCV_FISHEYE", 6: "FULL_OPENCV",
    7: "FOV", 8: "SIMPLE_RADIAL_FISHEYE", 9: "RADIAL_FISHEYE", 10: "THIN_PRISM_FISHEYE",
}
_POINT_BYTES = 24
"""x, y and the number of the 3D point, for each point of an image."""
_LONGEST_NAME = 4096


class _Reader:
    """A file's bytes, read from the front."""

    def __init__(self, path: Path):
        self.path, self.at = path, 0
        try:
            self.data = path.read_bytes()
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None

    def _check(self, size: int, what: str) -> None:
        if size > len(self.data) - self.at:
            raise InputError(f"ends at byte {len(self.data)} within {what}; the file is cut off, or is no COLMAP model",
                             file=self.path)

    def take(self, layout: str, what: str) -> tuple:
        """The next values of a struct layout.  Raises InputError where the file ends before."""
        size = struct.calcsize(f"<{layout}")
        self._check(size, what)
        values = struct.unpack_from(f"<{layout}", self.data, self.at)
        self.at += size
        return values

    def skip(self, size: int, what: str) -> None:
        self._check(size, what)
        self.at += size

    def name(self, what: str) -> str:
        """A text that ends with a zero byte."""
        end = self.data.find(b"\0", self.at, self.at + _LONGEST_NAME)
        if end < 0:
            raise InputError(f"the name of {what} has no end; the file is cut off or no COLMAP model", file=self.path)
        text = self.data[self.at : end].decode("utf-8", "replace")
        self.at = end + 1
        return text

    def finish(self) -> None:
        if self.at != len(self.data):
            raise InputError(f"{len(self.data) - self.at} bytes follow its last entry; the file is damaged", file=self.path)


def read_binary_model(folder: Path) -> list[Camera]:
    """The model's images in their order.  Raises InputError naming file and entry."""
    lenses = _read_lenses(folder / "cameras.bin")
    reader = _Reader(folder / "images.bin")
    (count,) = reader.take("Q", "its count")
    cameras = []
    for index in range(count):
        what = f"image {index + 1} of {count:,}"
        number, *pose, lens = reader.take("I7dI", what)
        name = stem(reader.name(what))
        where = f"{reader.path}: image {number} ({shown(name)})"
        (points,) = reader.take("Q", what)
        reader.skip(_POINT_BYTES * points, f"the points of {what}")
        if lens not in lenses:
            raise InputError(f"{where}: camera {lens} is not in {folder / 'cameras.bin'}")
        cameras.append(posed(where, lenses[lens], numbers(pose, 7, where), name))
    reader.finish()
    return cameras


def _read_lenses(path: Path) -> dict[int, Lens]:
    """CAMERA_ID -> lens."""
    reader = _Reader(path)
    (count,) = reader.take("Q", "its count")
    lenses: dict[int, Lens] = {}
    for index in range(count):
        what = f"camera {index + 1} of {count:,}"
        number, kind, width, height = reader.take("iiQQ", what)
        where = f"{path}: camera {number}"
        model = _MODEL_IDS.get(kind, f"number {kind}")
        if model not in MODELS:
            raise InputError(f"{where}: camera model {model} is not supported ({', '.join(MODELS)} are)")
        values = numbers([width, height, *reader.take(f"{parameters(model)}d", what)], 2 + parameters(model), where)
        lens = lens_of(where, model, np.asarray(values))
        if lenses.setdefault(number, lens) != lens:
            raise InputError(f"{where}: is there already, with another lens", remedy="give each its own number")
    reader.finish()
    if not lenses:
        raise InputError("holds no cameras", file=path)
    return lenses
