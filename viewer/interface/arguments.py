"""Checks of the arguments of the Python interface: each returns the value in its final type, or raises InputError."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from ..common.errors import InputError, PointglassError
from ..picture.settings import CHOICES, Settings

PathLike = str | os.PathLike[str]

_OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]*[a-z])(?: ([\w+.-]+))?")
"""An option of the command line in a message, and the word behind it, which may be its value."""
_VALUES = {**CHOICES, "exposures": ("matched", "as-scanned")}
_FIELDS = {"filter strength": "filter_strength", "filter levels": "filter_levels", "level of detail": "lod",
           "field of view": "fov"}  # fmt: skip
"""How a message for the command line begins -> the argument's name in Python."""
_RENAMED = {"out": "path"}
_OF_THE_COMMAND = ("help", "verbose", "log-file", "version")


@contextmanager
def python_names() -> Iterator[None]:
    """Errors raised in the block name Python arguments, ``filter="off"``, where messages name options, ``--filter off``."""
    try:
        yield
    except PointglassError as error:
        if error.args:
            error.args = (in_python(str(error)), *error.args[1:])
        raise


def in_python(text: str) -> str:
    """A message with Python's names for arguments."""

    def argument(found: re.Match[str]) -> str:
        name, behind = found[1].replace("-", "_"), found[2] or ""
        name = _RENAMED.get(name, name)
        if found[1] in _OF_THE_COMMAND:
            return found[0]
        value = behind.rstrip(".,;:")
        if value in _VALUES.get(name, ()):
            return f'{name}="{value}"{behind[len(value) :]}'
        return f"{'cache=False' if name == 'no_cache' else name}{' ' if behind else ''}{behind}"

    for words, name in _FIELDS.items():
        if text.startswith(f"{words} "):
            text = name + text[len(words) :]
    return _OPTION.sub(argument, text)


class RenderSettings(TypedDict, total=False):
    """Keyword arguments of :meth:`Scan.render`: the fields of viewer.picture.settings.Settings but the view, whose tables say
    what each choice means (so does ``pointglass render --help``).

    quality: which network.  detail: from 0 (smooth) to 2 (every measured grain); 1: by the
    scan's noise.  weights: a weights file of your own.  precision: auto, fp32, bf16 or fp16.  device: auto, cuda or cpu; of the
    network.  filter: auto, paper-code, paper-text, npbg++ or off.  filter_strength: multiplies the depth tolerance.
    filter_levels: pyramid levels, None: the filter's own.  lod: points drawn per pixel, None: every point.
    raster: auto, points or compute.  soft_z: auto, paper-code or paper-text.  stations: auto or equal.
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
    try:
        with python_names():
            return Settings(view=view, **values)
    except TypeError:  # compared with a number, or looked up in a table
        shown = ", ".join(f"{name}={value!r}" for name, value in {"view": view, **values}.items())
        raise InputError(f"render({shown}): a value is of the wrong kind; see pointglass.RenderSettings") from None


def path_of(path: PathLike) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise InputError(f"{path!r}: expected the path of a file or folder; give several as open(a, b)") from None


def vector_of(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        vector = np.array(value, np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} {value!r}: expected three finite numbers, x, y and z")
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
        raise InputError(f"gpu_memory {gpu_memory!r}: expected a number of bytes, such as 4 << 30, or None")
    return gpu_memory
