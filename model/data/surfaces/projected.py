"""Projection of a scan into a camera: the points and their pixels before decimation, and the raster of those kept."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import torch
from torch import Tensor

from ...appearance.noise import NoiseModel
from ...appearance.spacing import median_spacing
from ...common.jit import compiled
from ...common.scanner_positions import stations_differ
from ...reference.depth_filter import keep_mask
from ...reference.noise_level import pixel_noise
from ...reference.projection import Raster, SoftZ, network_input, pixels, rasterise
from ...reference.station_weights import station_weights
from ..dataset import MergedScan, TruePicture

MARGIN = 2.0
"""Pixels around a picture within which points are projected again in float32, as the renderer does; more than the rounding."""


@dataclass(frozen=True)
class Projected:
    """The points of a scan inside a picture, before decimation, in the scan's order.

    index (M,) int64 pixel.  z (M,) float32, view-space metres.  rgb (M, 3) uint8.  station (M,) uint8.  rank (M,) float32 in
    0..1: decimation to a share s keeps the points of rank < s.  point (M,) int64 rows of the scan, ascending.  weight (M,)
    int64 of view-dependent blending, None without scanner positions.  camera_to_world (4, 4), OpenGL axes.
    """

    index: Tensor
    z: Tensor
    rgb: Tensor
    station: Tensor
    rank: Tensor
    point: Tensor
    camera: SimpleNamespace
    camera_to_world: np.ndarray
    weight: Tensor | None = None

    def chosen(self, keep: Tensor) -> "Projected":
        """The points selected by ``keep`` (M,) bool."""
        index, z, rgb, station, rank = (part[keep] for part in (self.index, self.z, self.rgb, self.station, self.rank))
        weight = None if self.weight is None else self.weight[keep]
        return Projected(index, z, rgb, station, rank, self.point[keep], self.camera, self.camera_to_world, weight)

    def coloured_as(self, other: "Projected") -> "Projected":
        """The same points, those also in ``other``, a projection of the same scan, with their colours there."""
        if not len(other.point):
            return self
        place = torch.searchsorted(other.point, self.point).clamp_max(len(other.point) - 1)
        both = other.point[place] == self.point
        return replace(self, rgb=torch.where(both[:, None], other.rgb[place], self.rgb))

    def raster(self, soft: SoftZ) -> Raster:
        """Rasterises the points through the soft z-buffer."""
        return rasterise(self.index, self.z, self.rgb, self.camera.width, self.camera.height, soft, self.weight)


def project_scan(scan: MergedScan, view: TruePicture, seed: int = 0, reduce: int = 1,
                 camera_to_world: np.ndarray | None = None) -> Projected:
    """Projects a scan into a picture ``reduce`` times smaller: relative to the camera in float64, then in float32 like the
    renderer.

    The rank of a point depends on seed and scan only, not on the camera.  camera_to_world: replaces the view's.
    """
    matrix = view.camera_to_world if camera_to_world is None else camera_to_world
    to_view = matrix[:3, :3] * (1.0, -1.0, -1.0)
    camera = SimpleNamespace(
        width=view.width // reduce, height=view.height // reduce, fx=view.fl / reduce, fy=view.fl / reduce,
        cx=view.cx / reduce, cy=view.cy / reduce,
    )
    rank = torch.rand(len(scan.xyz), generator=torch.Generator().manual_seed(seed))
    lens = np.array((camera.fx, camera.cx, camera.cy, camera.width, camera.height), np.float64)
    near = _rows_near_picture(scan.xyz, np.ascontiguousarray(to_view), matrix[:3, 3].copy(), lens)
    x, y, z = torch.from_numpy(((scan.xyz[near] - matrix[:3, 3]) @ to_view).astype(np.float32)).unbind(1)
    index, inside = pixels(x, y, z, camera)
    rows = torch.from_numpy(near)[inside]
    z, rgb, station = z[inside], torch.from_numpy(scan.rgb)[rows], torch.from_numpy(scan.station)[rows]
    weight = None
    if scan.places is not None and stations_differ(scan.places):
        places = torch.from_numpy(((scan.places - matrix[:3, 3]) @ to_view).astype(np.float32))
        weight = station_weights(x[inside], y[inside], z, station.long(), places)
    return Projected(index, z, rgb, station, rank[rows], rows, camera, matrix, weight)


@compiled(nogil=True)
def _rows_near_picture(xyz, to_view, eye, lens):
    """Rows (ascending) of the points in front of the camera inside its picture or at most MARGIN pixels outside.

    lens: fx = fy, cx, cy, width, height, pixels.
    """
    rows, found = np.empty(len(xyz), np.int64), 0
    for i in range(len(xyz)):
        a, b, c = xyz[i, 0] - eye[0], xyz[i, 1] - eye[1], xyz[i, 2] - eye[2]
        z = a * to_view[0, 2] + b * to_view[1, 2] + c * to_view[2, 2]
        if not z > 0.0:
            continue
        u = lens[0] * (a * to_view[0, 0] + b * to_view[1, 0] + c * to_view[2, 0]) / z + lens[1]
        v = lens[0] * (a * to_view[0, 1] + b * to_view[1, 1] + c * to_view[2, 1]) / z + lens[2]
        if -MARGIN <= u <= lens[3] + MARGIN and -MARGIN <= v <= lens[4] + MARGIN:
            rows[found] = i
            found += 1
    return rows[:found].copy()


def raster_of(seen: Projected, keep: Tensor, spacing: float) -> Raster:
    """Rasterises the points selected by ``keep``.  spacing: of the decimated scan, file units."""
    return seen.chosen(keep).raster(SoftZ.preset("auto", spacing, 1.0))


def picture(seen: Projected, keep: Tensor, spacing: float, preset: str = "auto", strength: float = 1.0) -> Tensor:
    """(6, H, W) network input from the points selected by ``keep``.  spacing: of the decimated scan, file units."""
    raster = raster_of(seen, keep, spacing)
    return network_input(raster, keep_mask(raster.depth, preset, strength=strength), seen.camera.fx, spacing)


def scan_spacing(scan: MergedScan) -> float:
    """Median point spacing of a scan, from a sample of it; 1.0 without points."""
    if not len(scan.xyz):
        return 1.0
    pick = np.random.default_rng(0).choice(len(scan.xyz), min(len(scan.xyz), 2_000_000), replace=False)
    return median_spacing(scan.xyz[pick]) * float(np.sqrt(len(pick) / len(scan.xyz)))


def seen_noise(noise: NoiseModel | None, raster: Raster, seen: Projected) -> Tensor:
    """:func:`model.reference.noise_level.pixel_noise` of a projected scan, in whose frame ``noise`` is."""
    pose = seen.camera_to_world
    return pixel_noise(noise, raster, seen.camera, pose[:3, :3] * (1.0, -1.0, -1.0), pose[:3, 3])
