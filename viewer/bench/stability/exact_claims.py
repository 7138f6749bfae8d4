"""The exact picture of a stress scene, and how far a drawn one is from it.

The truth is drawn in float64 from the points as they were given, before packing, relative to the camera.  Two judgements:
``agreement`` compares pictures, in which a point on the border of two pixels may fall either way; ``depth_faults`` allows
just that and nothing else: every pixel's depth must lie between what its points could give and what they must.
File units; the view frame is x right, y down, z forward.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from viewer.camera import Camera
    from viewer.grid.scene import Scene

_FLOAT32 = 2.0**-21  # of the largest coordinate that enters: eight roundings to 2**-24 of it
_HALF_DIAGONAL = 0.87  # of a step: how far packing may move a point
_RATIO = 2.0**-19  # of a pixel coordinate: 1/z by a GPU's reciprocal, two products and a sum


@dataclass(frozen=True)
class Truth:
    """depth (H, W) float64, +inf where empty; mask (H, W) bool; filled (H, W, 3) float64, 0..255."""

    depth: np.ndarray
    mask: np.ndarray
    filled: np.ndarray


def exact_view(xyz: np.ndarray, camera: "Camera") -> np.ndarray:
    """(N, 3) float64 view coordinates of points as given."""
    return (xyz - camera.position) @ camera.view_rotation.T


def exact_picture(xyz: np.ndarray, rgb: np.ndarray, camera: "Camera", spacing: float, scan: np.ndarray | None = None,
                  places: np.ndarray | None = None) -> Truth:
    """The picture by ``model.projection`` in float64 from unpacked points, with the presets ``auto``.  spacing: file units.

    scan, places: (N,) and (S, 3) file coordinates, where points count by where their scanners stood; None: all alike.
    """
    import torch

    from model.projection import SoftZ, frame, network_input, pixels
    from model.station_weights import station_weights

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
    """A drawn picture against its truth.

    depth, depth_99: median and 99th percentile of |z - truth|, over the pixels both hold, in units of ``unit``.
    moved: share of pixels that only one holds, or whose depth differs by more than ``unit``: another point is in front.
    mask: share of pixels where the keep-masks differ.  filled: PSNR in dB.  void: share of pixels left open.
    """

    depth: float
    depth_99: float
    moved: float
    mask: float
    filled: float
    void: float


def agreement(depth: np.ndarray, mask: np.ndarray, filled: np.ndarray, truth: Truth, unit: float) -> Agreement:
    """depth (H, W), mask (H, W) bool, filled (H, W, 4) uint8: as a Frame gives them.  unit: point spacing, file units."""
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
    """Number of pixels whose depth no point explains, or that miss a point they must hold.

    depth: (H, W) float32 as drawn, +inf where empty.  xyz: (N, 3) the points as given.  The one freedom is the rounding
    of a point: half a packed step, and float32 of coordinates relative to the camera.
    """
    view = exact_view(xyz, camera)
    x, y, z = view.T
    error = _HALF_DIAGONAL * scene.step + _FLOAT32 * (np.abs(view).max(axis=1) + 2 * scene.cell_size)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        certain = z > 2 * error  # the others may be in front of the camera or behind
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
    for i in np.flatnonzero(wide):  # points within an epsilon of the camera plane, and little else: few
        allowed.add_box(low[0][i], high[0][i], low[1][i], high[1][i], near[i])
    narrow = possible & ~wide
    for column in (low[0], high[0]):
        for row in (low[1], high[1]):
            allowed.add(column[narrow], row[narrow], near[narrow])
    return faults + allowed.unexplained()


def _missing(depth, certain, low, high, far) -> int:
    """Pixels farther away than a point that certainly lies in them."""
    height, width = depth.shape
    sure = certain & (low[0] == high[0]) & (low[1] == high[1])
    sure &= (low[0] >= 0) & (low[0] < width) & (low[1] >= 0) & (low[1] < height)
    index = low[1][sure] * width + low[0][sure]
    return len(np.unique(index[depth.ravel()[index] > far[sure]]))


class _Allowed:
    """Collects what may explain the pixels that hold something; the memory it takes grows with those, not the picture."""

    def __init__(self, depth: np.ndarray):
        self._shape = depth.shape
        self._index = np.flatnonzero(np.isfinite(depth) | np.isnan(depth))
        self._depth = depth.ravel()[self._index]
        self._nearest = np.full(len(self._index), np.inf)

    def add(self, column: np.ndarray, row: np.ndarray, near: np.ndarray) -> None:
        """Points that may lie in a pixel, at depth ``near`` or behind."""
        inside = (column >= 0) & (column < self._shape[1]) & (row >= 0) & (row < self._shape[0])
        index = row[inside] * self._shape[1] + column[inside]
        at = np.searchsorted(self._index, index)
        known = at < len(self._index)
        known[known] = self._index[at[known]] == index[known]
        np.minimum.at(self._nearest, at[known], near[inside][known])

    def add_box(self, left: int, right: int, top: int, bottom: int, near: float) -> None:
        """One point that may lie anywhere in a box of pixels."""
        row, column = np.divmod(self._index, self._shape[1])
        inside = (column >= left) & (column <= right) & (row >= top) & (row <= bottom)
        self._nearest[inside] = np.minimum(self._nearest[inside], near)

    def unexplained(self) -> int:
        """Pixels that are not a number, not in front of the camera, or nearer than anything that may lie in them."""
        return int((~((self._depth > 0) & (self._depth >= self._nearest))).sum())
