"""The reference implementation in torch, on the points and draw list of the renderer, for comparison pixel by pixel."""

from dataclasses import dataclass

import numpy as np
import torch

from pointglass.model.reference.depth_filter import keep_mask
from pointglass.model.reference.fill_constants import FOR_NETWORK, FOR_PICTURE
from pointglass.model.reference.hole_test import coverage
from pointglass.model.reference.noise_level import pixel_noise
from pointglass.model.reference.projection import Raster, SoftZ, network_input, pixels, rasterise, unpack_points, view_points
from pointglass.model.reference.ray_march import march, rays_of, sparse_depth
from pointglass.model.reference.station_weights import station_weights
from pointglass.viewer.render.culling.cull import Culler
from pointglass.viewer.render.culling.enclosed_directions import OPEN, Directions, Enclosure, cell_of
from pointglass.viewer.render.raster.stations import ScannerPositions, uses_station_weights


@dataclass
class ReferenceFrame:
    raster: Raster
    mask: np.ndarray
    filled: np.ndarray
    shown: np.ndarray
    alpha: np.ndarray
    met: torch.Tensor | None


def looked_up(closed: np.ndarray, camera) -> np.ndarray:
    """(H, W): what ``closed``, by cell of the directions, has for each pixel's."""
    i, j = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    view = np.stack([(i - camera.cx) / camera.fx, (j - camera.cy) / camera.fy, np.ones_like(i)], -1)
    return closed.ravel()[cell_of((view @ camera.view_rotation).reshape(-1, 3))].reshape(camera.height, camera.width)


def rays_met(around: Directions, camera) -> torch.Tensor | None:
    """What the rays of a picture met, by the reference implementation; None in a room."""
    occupancy = around.occupancy
    if occupancy is None:
        return None
    rays, sizes = rays_of(camera, camera.view_rotation.T)
    sparse = sparse_depth(camera, occupancy.spacing) / occupancy.side
    return torch.from_numpy(march(occupancy.codes, (camera.position - occupancy.origin) / occupancy.side, rays, sizes, sparse))


def directions(scene, camera) -> np.ndarray:
    """(H, W) int8: what the direction of each pixel is, OPEN, CLOSED or SEALED."""
    return looked_up(Enclosure(scene).closed(camera.position), camera)


def reference_frame(scene, camera, settings, *, metre=1.0) -> ReferenceFrame:
    """Renders with ``model.reference.projection`` in float32.  All points of the draw list, in any order."""
    draw = Culler(scene).select(camera, settings.lod)
    take = np.repeat(draw.first - np.concatenate([[0], np.cumsum(draw.count)[:-1]]), draw.count) + np.arange(draw.points)
    cells = torch.from_numpy(np.repeat(draw.slot, draw.count))
    steps, rgb, station = unpack_points(torch.from_numpy(np.asarray(scene.points[take], np.int64)))
    x, y, z = view_points(steps, cells, torch.from_numpy(draw.cell_view), torch.from_numpy(draw.axes))
    soft = SoftZ.preset(settings.soft_z, scene.spacing, metre, unlit=scene.unlit)
    index, inside = pixels(x, y, z, camera, rounded=soft.rounded)
    weight, places = None, ScannerPositions(scene)
    if uses_station_weights(settings, places):
        seen = places.seen_from(camera)
        where = torch.from_numpy(np.where(seen[:, 3:] > 0, seen[:, :3], np.nan))
        weight = station_weights(x[inside], y[inside], z[inside], station[inside], where)
    raster = rasterise(index, z[inside], rgb[inside], camera.width, camera.height, soft, weight)
    mask = keep_mask(
        raster.depth, settings.filter, strength=settings.filter_strength, levels=settings.filter_levels, metre=metre
    ) & (raster.count > 0)
    noise = pixel_noise(scene.noise, raster, camera, camera.view_rotation.T, camera.position)
    overall = 0.0 if scene.noise is None or settings.filter != "auto" or settings.soft_z != "auto" else scene.noise.overall
    packed, shown = (network_input(raster, mask, camera.fx, scene.spacing, noise, overall, averaging).numpy()
                     for averaging in (FOR_NETWORK, FOR_PICTURE))
    around = Enclosure(scene).around(camera.position)
    met = rays_met(around, camera)
    alpha = np.where(looked_up(around.closed, camera) != OPEN, 1.0, coverage(mask, met).numpy()) * bool(mask.any())
    return ReferenceFrame(raster, mask.numpy(), packed, shown[:3], alpha, met)
