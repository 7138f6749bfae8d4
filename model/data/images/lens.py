"""Camera models with distortion, and undistortion of their pictures to a pinhole with square pixels.

Models and parameters are COLMAP's.  Rays are (x, y, 1) in OpenCV's camera axes.  A pixel spans [i, i + 1].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.ndimage import map_coordinates

from ...common.errors import DataError
from ..dataset import MAX_FOCAL

MODELS = {  # number of focal lengths and of distortion parameters, COLMAP's names and order
    "SIMPLE_PINHOLE": (1, 0), "PINHOLE": (2, 0), "SIMPLE_RADIAL": (1, 1), "RADIAL": (1, 2), "OPENCV": (2, 4),
    "OPENCV_FISHEYE": (2, 4),
}


@dataclass(frozen=True)
class Lens:
    """A camera model.  fx, fy, cx, cy: pixels.  distortion: in COLMAP's order; OPENCV may have a fifth parameter, k3."""

    model: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    @staticmethod
    def colmap(where: str, model: str, width: int, height: int, parameters: Sequence[float]) -> "Lens":
        """A lens from a line of cameras.txt.  where: file and line, for the DataError of an invalid one."""
        if model not in MODELS:
            raise DataError(f"{where}: camera model {model!r} is not supported ({', '.join(MODELS)} are)")
        focals, distortions = MODELS[model]
        if len(parameters) != focals + 2 + distortions:
            raise DataError(f"{where}: {model} has {focals + 2 + distortions} parameters, not {len(parameters)}")
        fx, fy = parameters[0], parameters[focals - 1]
        if not (np.all(np.abs(parameters) < MAX_FOCAL) and fx > 0 and fy > 0 and width > 0 and height > 0):
            raise DataError(f"{where}: {width}x{height} pixels, parameters {list(parameters)}: not a valid camera")
        return Lens(model, width, height, fx, fy, *parameters[focals : focals + 2], distortion=tuple(parameters[focals + 2 :]))

    @property
    def plain(self) -> bool:
        """Whether it is a pinhole with square pixels, without distortion."""
        return not any(self.distortion) and self.model != "OPENCV_FISHEYE" and abs(self.fx - self.fy) <= 1e-6 * self.fx

    @property
    def _radial(self) -> tuple[float, ...]:
        """k1, k2, ... of t (1 + k1 t^2 + k2 t^4 + ...)."""
        return (*self.distortion[:2], *self.distortion[4:]) if self.model == "OPENCV" else self.distortion

    @cached_property
    def limit(self) -> float:
        """Largest t (a radius, or an angle for a fisheye) up to which the distortion is monotonic; may be infinite."""
        slope = [(2 * n + 1) * k for n, k in enumerate((1.0, *self._radial))]
        roots = np.roots(slope[::-1]) if any(slope[1:]) else np.zeros(0)
        turns = roots.real[(abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(np.sqrt(turns.min())) if len(turns) else np.inf

    def pixel(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Projects rays (x, y, 1), OpenCV axes: u, v in pixels, NaN beyond :attr:`limit`."""
        r = np.hypot(x, y)
        t = np.arctan(r) if self.model == "OPENCV_FISHEYE" else r
        t2 = t * t
        scale = np.ones_like(t2)
        for n, k in enumerate(self._radial):
            scale = scale + k * t2 ** (n + 1)
        if self.model == "OPENCV_FISHEYE":
            scale = np.where(r > 1e-12, scale * t / np.maximum(r, 1e-12), 1.0)
        scale = np.where(t <= self.limit, scale, np.nan)
        u, v = x * scale, y * scale
        if self.model == "OPENCV":
            p1, p2 = self.distortion[2:4] if self.distortion else (0.0, 0.0)
            r2 = r * r
            u, v = u + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), v + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        return self.fx * u + self.cx, self.fy * v + self.cy


@lru_cache(maxsize=64)
def pinhole_focal(lens: Lens) -> float:
    """Focal length, pixels, of the widest centred pinhole of the same size whose view lies inside the lens's picture."""
    w, h = lens.width, lens.height
    i, j = np.arange(w) + 0.5 - w / 2, np.arange(h) + 0.5 - h / 2
    x = np.concatenate([i, i, np.full(h, i[0]), np.full(h, i[-1])])
    y = np.concatenate([np.full(w, j[0]), np.full(w, j[-1]), j, j])

    def fits(focal: float) -> bool:
        u, v = lens.pixel(x / focal, y / focal)
        return bool(np.all((u >= 0) & (u <= w) & (v >= 0) & (v <= h)))

    low, high = np.log(lens.fx / 50), np.log(lens.fx * 50)
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if fits(np.exp(middle)) else (middle, high)
    if not fits(np.exp(high)):
        raise DataError(f"{lens}: no pinhole picture fits inside its picture; is the principal point outside the picture?")
    return float(np.exp(high))


@lru_cache(maxsize=2)
def undistortion_map(lens: Lens) -> np.ndarray:
    """(2, H, W) float32: row and column in the lens's picture, pixel centres at integers, of each undistorted pixel."""
    focal = pinhole_focal(lens)
    y, x = np.mgrid[0 : lens.height, 0 : lens.width] + 0.5
    u, v = lens.pixel((x - lens.width / 2) / focal, (y - lens.height / 2) / focal)
    return np.stack([v - 0.5, u - 0.5]).astype(np.float32)


def undistort(picture: np.ndarray, lens: Lens) -> np.ndarray:
    """Undistorts a picture (H, W) or (H, W, C) uint8 to the pinhole of :func:`pinhole_focal`, bilinear."""
    layers = picture[..., None] if picture.ndim == 2 else picture
    where = undistortion_map(lens)
    out = [map_coordinates(layers[..., c].astype(np.float32), where, order=1, mode="nearest") for c in range(layers.shape[2])]
    return np.rint(np.stack(out, -1)).astype(np.uint8).reshape(picture.shape)
