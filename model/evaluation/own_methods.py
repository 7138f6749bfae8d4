"""Methods and networks of your own in an evaluation: an object in a Python file, given as ``NAME=FILE.py:OBJECT``.

``--method``: OBJECT is a function ``picture(scan, camera)``.  It gets the points of one view at one density, which every other
method gets, as a :class:`model.data.dataset.MergedScan` (``xyz`` (N, 3) float64 metres, ``rgb`` (N, 3) uint8 sRGB,
``station`` (N,) uint8, ``places`` (S, 3) or None), and a :class:`PinholeCamera`.  It returns the picture (H, W, 3), uint8 or
floats from 0 to 1, as an array or a tensor.

``--network``: OBJECT is a function without arguments that returns a torch.nn.Module.  The module gets (1, 6, H, W) float32, the
input of pointglass's own networks (:func:`model.reference.projection.filled_input`): RGB 0..1 filled by pull-push behind the
depth filter; confidence, 0 where nothing was measured; depth feature; noise level.  Its first three output channels are the
picture, (1, 3 or more, H, W), 0..1.

The file is run as a program of yours: only give files that you trust.
"""

import importlib.util
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from ..common.errors import DataError
from ..data.dataset import MergedScan
from ..data.surfaces.projected import Projected


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """width, height: pixels.  fx, fy, cx, cy: pixels; a pixel spans [i, i + 1], row 0 at the top.  camera_to_world: (4, 4)
    float64, OpenGL axes (x right, y up, looking along -z)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_to_world: np.ndarray

    @staticmethod
    def of(seen: Projected) -> "PinholeCamera":
        """The camera of a projection."""
        lens = seen.camera
        return PinholeCamera(lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy, seen.camera_to_world)


@dataclass(frozen=True)
class OwnObject:
    """name: in tables.  option, what: as given, for messages.  value: the function."""

    name: str
    option: str
    what: str
    value: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        """Calls it.  Raises DataError naming the line where an exception was raised."""
        try:
            return self.value(*arguments)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(last.filename).name}, line {last.lineno}"
            raise DataError(f"{type(error).__name__} at {place}: {error}", option=self.option, value=self.what) from error


@dataclass(frozen=True)
class OwnPicture:
    """A picture by a function of yours."""

    made_by: OwnObject

    @property
    def name(self) -> str:
        """In tables."""
        return self.made_by.name

    def picture(self, scan: MergedScan, seen: Projected) -> Tensor:
        """(3, H, W) in 0..1 from the points ``seen`` of a scan.  Raises DataError where the function returns something else."""
        rows = seen.point.numpy()
        given = MergedScan(scan.xyz[rows], seen.rgb.numpy(), scan.station[rows], scan.places)
        camera = PinholeCamera.of(seen)
        made = self.made_by(given, camera)
        return _planes(made, (camera.height, camera.width, 3), self.made_by.what)


def _planes(made: object, shape: tuple[int, int, int], what: str) -> Tensor:
    known = isinstance(made, (np.ndarray, Tensor))
    if not known or tuple(made.shape) != shape:
        found = tuple(made.shape) if known else type(made).__name__
        raise DataError(f"expected a picture {shape}, found {found}", option="--method", value=what)
    picture = torch.as_tensor(np.ascontiguousarray(made) if isinstance(made, np.ndarray) else made.detach().cpu())
    if picture.dtype == torch.uint8:
        return picture.permute(2, 0, 1) / 255
    if not picture.is_floating_point() or not torch.isfinite(picture).all():
        raise DataError("expected uint8, or finite floats from 0 to 1", option="--method", value=what)
    return picture.permute(2, 0, 1).float().clamp(0, 1)


@dataclass(frozen=True)
class OwnNetwork:
    """A network of yours, in evaluation mode."""

    name: str
    what: str
    module: nn.Module
    device: str = "cpu"

    @torch.inference_mode()
    def __call__(self, given: Tensor) -> Tensor:
        """(6, H, W) network input -> (3, H, W) in 0..1.  Raises DataError where the module returns something else."""
        made = OwnObject(self.name, "--network", self.what, self.module)(given[None].float().to(self.device))
        if not isinstance(made, Tensor) or made.ndim != 4 or made.shape[1] < 3 or made.shape[2:] != given.shape[1:]:
            found = tuple(made.shape) if isinstance(made, Tensor) else type(made).__name__
            raise DataError(f"expected (1, 3 or more, {given.shape[1]}, {given.shape[2]}), found {found}", option="--network",
                            value=self.what)
        return made[0, :3].float().clamp(0, 1)


def own_methods(texts: Sequence[str]) -> list[OwnPicture]:
    """Methods of arguments ``NAME=FILE.py:FUNCTION``.  Raises DataError."""
    return [OwnPicture(given) for given in _objects(texts, "--method")]


def own_networks(texts: Sequence[str], device: str = "cpu") -> list[OwnNetwork]:
    """Networks of arguments ``NAME=FILE.py:FACTORY``, on a device.  Raises DataError."""
    found = []
    for given in _objects(texts, "--network"):
        module = given()
        if not isinstance(module, nn.Module):
            raise DataError(f"expected a torch.nn.Module, found {type(module).__name__}", option="--network", value=given.what)
        found.append(OwnNetwork(given.name, given.what, module.eval().to(device), device))
    return found


def _objects(texts: Sequence[str], option: str) -> list[OwnObject]:
    found: dict[str, OwnObject] = {}
    for text in texts:
        name, equals, rest = text.partition("=")
        file, colon, wanted = rest.rpartition(":")
        name = name.strip()
        if not (name and equals and file and colon and wanted):
            raise DataError("expected NAME=FILE.py:OBJECT", option=option, value=text)
        if name in found:
            raise DataError(f"the name {name!r} is given twice", option=option, value=text)
        found[name] = OwnObject(name, option, text, _loaded(Path(file), wanted, option, text))
    return list(found.values())


def _loaded(file: Path, wanted: str, option: str, text: str) -> Callable[..., Any]:
    """An object of a Python file, which is run."""
    if not file.is_file():
        raise DataError("no such file", file=file, remedy=f"give {option} NAME=FILE.py:OBJECT")
    spec = importlib.util.spec_from_file_location(f"pointglass_own_{file.stem}", file)
    if spec is None or spec.loader is None:
        raise DataError("is not a Python file", file=file, remedy="its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise DataError(f"cannot be run: {type(error).__name__}: {error}", file=file) from error
    value = getattr(module, wanted, None)
    if not callable(value):
        there = ", ".join(name for name, held in vars(module).items() if callable(held) and not name.startswith("_"))
        raise DataError(f"no function {wanted} in {file.name}; it has {there or 'none'}", option=option, value=text)
    return value
