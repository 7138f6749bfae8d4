"""Checks of the arguments of the Python interface: each returns the value in its final type, or raises InputError."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError, Option, PointglassError
from ..picture.camera import Camera
from ..picture.settings import Settings

PathLike = str | os.PathLike[str]

_NAMES = {"filter strength": "filter_strength", "filter levels": "filter_levels", "level of detail": "lod",
          "field of view": "fov", "--out": "path", "--no-cache": "cache=False"}  # fmt: skip
"""What an error calls an option or a setting -> the argument in Python, where it is another word."""


@contextmanager
def python_names() -> Iterator[None]:
    """Errors raised in the block name Python arguments, ``filter="off"``, where the command line has ``--filter off``."""
    try:
        yield
    except PointglassError as error:
        error.name_options(python_option)
        raise


def python_option(option: Option) -> str:
    """An option as the argument that it is in Python, with its value where it names one."""
    name = _NAMES.get(option.name, option.name)
    name = name.removeprefix("--").replace("-", "_") if name.startswith("--") else name
    return name if option.choice is None else f'{name}="{option.choice}"'


class RenderSettings(TypedDict, total=False):
    """Keyword arguments of :meth:`Scan.render`: the fields of viewer.picture.settings.Settings but the view, whose tables say
    what each choice means (so does ``pointglass render --help``).

    quality: which network.  detail: from 0 (smooth) to 2 (every measured grain); 1: by the
    scan's noise.  weights: a weights file of your own.  precision: auto, fp32, bf16 or fp16.  device: auto, cuda or cpu; of the
    network.  filter: auto, paper-code, paper-text, npbg++ or off.  filter_strength: multiplies the depth tolerance.
    filter_levels: pyramid levels, None: the filter's own.  lod: points drawn per pixel, None: every point.
    raster: auto, points or compute.  soft_z: auto, paper-code or paper-text.  stations: auto or equal.
    photos: auto (those of E57 files), off, or a folder with cameras.
    """

    quality: str
    detail: float
    weights: PathLike | None
    precision: str
    device: str
    filter: str
    filter_strength: float
    filter_levels: int | None
    lod: float | None
    raster: str
    soft_z: str
    stations: str
    photos: PathLike


def settings_of(view: str, given: RenderSettings) -> Settings:
    """Raises InputError naming the first setting that does not exist or has a value it cannot have."""
    known = [field.name for field in fields(Settings) if field.name != "view"]
    for name in given:
        if name not in known:
            meant = get_close_matches(name, known, 1)
            hint = f"did you mean {meant[0]}?" if meant else f"expected one of {', '.join(known)}"
            raise InputError(f"render has no setting {name!r}; {hint}")
    values: dict[str, Any] = dict(given)
    if values.get("weights") is not None:
        values["weights"] = str(path_of(values["weights"]))
    if "photos" in values:
        values["photos"] = str(path_of(values["photos"]))
    try:
        with python_names():
            return Settings(view=view, **values)
    except TypeError:  # compared with a number, or looked up in a table
        shown = ", ".join(f"{name}={value!r}" for name, value in {"view": view, **values}.items())
        raise InputError(f"render({shown}): a value is of the wrong kind", remedy="see pointglass.RenderSettings") from None


def path_of(path: PathLike) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise InputError(f"{path!r}: expected the path of a file or folder", remedy="give several as open(a, b)") from None


def vector_of(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        vector = np.array(value, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError("expected three finite numbers, x, y and z", option=name, value=value)
    return vector


def numbers_of(index: object, count: int) -> npt.NDArray[np.int64]:
    """(n,) running numbers from 0, of one whole number, an array of them, or a mask (count,)."""
    array = np.atleast_1d(np.asarray(index))
    if array.ndim == 1 and array.dtype == bool and len(array) == count:
        return np.flatnonzero(array)
    if array.ndim != 1 or (array.dtype.kind not in "iu" and array.size):
        raise InputError(f"points[{index!r}]: expected a slice, whole numbers, or a mask of {count:,} booleans")
    numbers = array.astype(np.int64)
    if numbers.size and not (-count <= numbers.min() and numbers.max() < count):
        raise IndexError(f"points[{index!r}]: there are {count:,} points")
    return np.where(numbers < 0, numbers + count, numbers)


def memory_of(gpu_memory: int | None) -> int | None:
    """Bytes that points may take on the GPU, None: by the device."""
    if gpu_memory is not None and not (isinstance(gpu_memory, int) and not isinstance(gpu_memory, bool) and gpu_memory > 0):
        raise InputError("expected a number of bytes, such as 4 << 30, or None", option="gpu_memory", value=gpu_memory)
    return gpu_memory


def cameras_of(given: object) -> list[Camera]:
    """The cameras of a list of them.  Raises InputError naming the first that is none."""
    wrong = given
    if isinstance(given, Iterable) and not isinstance(given, (str, bytes, np.ndarray)):
        cameras = list(given)
        others = [camera for camera in cameras if not isinstance(camera, Camera)]
        if not others:
            return cameras
        wrong = others[0]
    raise InputError("expected a pointglass.Camera, as look_at makes one, or a list of them", option="camera", value=wrong)
