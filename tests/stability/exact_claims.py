"""The exact picture of a stress scene, and errors of a rendered one.

The exact picture is computed in float64 from the points before packing, relative to the camera.  ``agreement`` compares
pictures statistically, as a point on the border of two pixels may fall into either.  ``depth_faults`` allows only such
rounding: the depth of each pixel must lie within the bounds given by its points.
File units; the view frame is x right, y down, z forward.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pointglass.viewer.grid.scene import Scene
    from pointglass.viewer.picture.camera import Camera

_FLOAT32 = 2.0**-21
"""Largest rounding error relative to the largest coordinate: eight roundings of 2**-24 each."""
_HALF_DIAGONAL = 0.87
"""Largest displacement by packing, packed steps: half the diagonal of a unit cube, sqrt(3) / 2, rounded up."""
_RATIO = 2.0**-19
"""Largest rounding error relative to a pixel coordinate: a GPU's reciprocal of z, two products and a sum."""


@dataclass(frozen=True)
class Truth:
    """An exact picture: depth (H, W) float64, +inf where empty; mask (H, W) bool; filled (H, W, 3) float64, 0..255."""

    depth: np.ndarray
    mask: np.ndarray
    filled: np.ndarray


def exact_view(xyz: np.ndarray, camera: "Camera") -> np.ndarray:
    """(N, 3) float64 view coordinates of points xyz (N, 3)."""
    return (xyz - camera.position) @ camera.view_rotation.T


def exact_picture(xyz: np.ndarray, rgb: np.ndarray, camera: "Camera", spacing: float, scan: np.ndarray | None = None,
                  places: np.ndarray | None = None) -> Truth:
    """The picture by ``model.reference.projection`` in float64 from unpacked points, with presets ``auto``.  spacing: file
    units.

    scan, places: (N,) station of each point and (S, 3) scanner positions, file coordinates, for view-dependent blending; None:
    equal weights.
    """
    import torch

    from pointglass.model.reference.projection import SoftZ, frame, network_input, pixels
    from pointglass.model.reference.station_weights import station_weights

    x, y, z = torch.from_numpy(exact_view(xyz, camera)).unbind(1)
    index, inside = pixels(x, y, z, camera)
    x, y, z, colours = x[inside], y[inside], z[inside], torch.from_numpy(rgb)[inside].long()
    weight = None
    if scan is not None and places is not None:
        station = torch.from_numpy(scan)[inside].long()
        weight = station_weights(x, y, z, station, torch.from_numpy(exact_view(places, camera)))
    raster, mask = frame(index, z, colours, camera, SoftZ.preset("auto", spacing, 1.0), weight=weight)
    filled = network_input(raster, mask, camera.fx, spacing)[:3]
    return Truth(raster.depth.numpy(), mask.numpy(), filled.permute(1, 2, 0).numpy() * 255)


@dataclass(frozen=True)
class Agreement:
    """Errors of a rendered picture against the exact one.

    depth, depth_99: median and 99th percentile of |z - truth| over the pixels with a depth in both, in units of ``unit``.
    moved: share of pixels with a depth in one only, or whose depth differs by more than ``unit``, as another point is in front.
    mask: share of pixels where the keep-masks differ.  filled: PSNR in dB.  background: share of pixels left empty.
    """

    depth: float
    depth_99: float
    moved: float
    mask: float
    filled: float
    background: float


def agreement(depth: np.ndarray, mask: np.ndarray, filled: np.ndarray, truth: Truth, unit: float) -> Agreement:
    """depth (H, W), mask (H, W) bool, filled (H, W, 4) uint8: of a Frame.  unit: point spacing, file units."""
    both = np.isfinite(depth) & np.isfinite(truth.depth)
    gap = np.abs(depth[both].astype(np.float64) - truth.depth[both]) / unit
    alone = np.isfinite(depth) != np.isfinite(truth.depth)
    shown = filled[..., 3] > 0
    error = ((filled[..., :3].astype(np.float64) - truth.filled)[shown] ** 2).mean() if shown.any() else np.inf
    return Agreement(
        float(np.median(gap)) if gap.size else float("nan"), float(np.percentile(gap, 99)) if gap.size else float("nan"),
        float((alone.sum() + (gap > 1).sum()) / depth.size), float((mask != truth.mask).mean()),
        float(10 * np.log10(255**2 / max(error, 1e-12))), float((~shown).mean()),
    )


def depth_faults(depth: np.ndarray, xyz: np.ndarray, camera: "Camera", scene: "Scene") -> int:
    """Number of pixels whose depth is outside the bounds given by the points.

    depth: (H, W) float32 as rendered, +inf where empty.  xyz: (N, 3) points before packing.  Allowed are the rounding of
    packing, half a step, and float32 rounding of coordinates relative to the camera.
    """
    view = exact_view(xyz, camera)
    x, y, z = view.T
    error = _HALF_DIAGONAL * scene.step + _FLOAT32 * (np.abs(view).max(axis=1) + 2 * scene.cell_size)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        certain = z > 2 * error  # the others may be in front of or behind the camera
        centre, reach = [], []
        for a, focal, offset in ((x, camera.fx, camera.cx), (y, camera.fy, camera.cy)):
            at = focal * a / z + offset
            slack = focal * error * (1 + np.abs(a) / z) / (z - error) + _RATIO * (np.abs(at) + 2 * abs(offset))
            centre.append(np.where(certain, at, offset))
            reach.append(np.where(certain, slack, np.inf))
    near, far = z - error, z + error
    possible = z > -2 * error
    low = [np.floor(np.clip(c - r, -1, n)).astype(np.int64) for c, r, n in zip(centre, reach, depth.shape[::-1])]
    high = [np.floor(np.clip(c + r, -1, n)).astype(np.int64) for c, r, n in zip(centre, reach, depth.shape[::-1])]
    possible &= (high[0] >= 0) & (low[0] < depth.shape[1]) & (high[1] >= 0) & (low[1] < depth.shape[0])
    faults, allowed = _missing(depth, possible & certain, low, high, far), _Allowed(depth)
    wide = possible & ((high[0] - low[0] > 1) | (high[1] - low[1] > 1))
    for i in np.flatnonzero(wide):  # few points, mostly near the camera plane
        allowed.add_box(low[0][i], high[0][i], low[1][i], high[1][i], near[i])
    narrow = possible & ~wide
    for column in (low[0], high[0]):
        for row in (low[1], high[1]):
            allowed.add(column[narrow], row[narrow], near[narrow])
    return faults + allowed.unexplained()


def _missing(depth, certain, low, high, far) -> int:
    """Number of pixels whose depth is larger than that of a point certainly within them."""
    height, width = depth.shape
    sure = certain & (low[0] == high[0]) & (low[1] == high[1])
    sure &= (low[0] >= 0) & (low[0] < width) & (low[1] >= 0) & (low[1] < height)
    index = low[1][sure] * width + low[0][sure]
    return len(np.unique(index[depth.ravel()[index] > far[sure]]))


class _Allowed:
    """Least possible depth of each pixel with a depth.  The memory grows with their number, not with the picture size."""

    def __init__(self, depth: np.ndarray):
        self._shape = depth.shape
        self._index = np.flatnonzero(np.isfinite(depth) | np.isnan(depth))
        self._depth = depth.ravel()[self._index]
        self._nearest = np.full(len(self._index), np.inf)

    def add(self, column: np.ndarray, row: np.ndarray, near: np.ndarray) -> None:
        """Adds points that may fall into a pixel, at depth ``near`` or behind."""
        inside = (column >= 0) & (column < self._shape[1]) & (row >= 0) & (row < self._shape[0])
        index = row[inside] * self._shape[1] + column[inside]
        at = np.searchsorted(self._index, index)
        known = at < len(self._index)
        known[known] = self._index[at[known]] == index[known]
        np.minimum.at(self._nearest, at[known], near[inside][known])

    def add_box(self, left: int, right: int, top: int, bottom: int, near: float) -> None:
        """Adds a point that may fall into any pixel of a box."""
        row, column = np.divmod(self._index, self._shape[1])
        inside = (column >= left) & (column <= right) & (row >= top) & (row <= bottom)
        self._nearest[inside] = np.minimum(self._nearest[inside], near)

    def unexplained(self) -> int:
        """Number of pixels whose depth is NaN, not positive, or less than possible."""
        return int((~((self._depth > 0) & (self._depth >= self._nearest))).sum())
