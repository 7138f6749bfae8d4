"""The torch twin run on the very points and draw list the renderer used, for comparison pixel by pixel."""

from dataclasses import dataclass

import numpy as np
import torch

from model.depth_filter import keep_mask
from model.project import Raster, SoftZ, network_input, pixels, rasterise, unpack_points, view_points
from viewer.render.cull import Culler


@dataclass
class TwinFrame:
    raster: Raster
    mask: np.ndarray
    filled: np.ndarray


def twin_frame(scene, camera, settings, *, metre=1.0) -> TwinFrame:
    """Renders with ``model.project`` in float32.  All points of the draw list, in any order."""
    draw = Culler(scene).select(camera, settings.lod)
    take = np.repeat(draw.first - np.concatenate([[0], np.cumsum(draw.count)[:-1]]), draw.count) + np.arange(draw.points)
    cells = torch.from_numpy(np.repeat(draw.slot, draw.count))
    steps, rgb = unpack_points(torch.from_numpy(np.asarray(scene.points[take], np.int64)))
    x, y, z = view_points(steps, cells, torch.from_numpy(draw.cell_view), torch.from_numpy(draw.axes))
    soft = SoftZ.preset(settings.soft_z, scene.spacing, metre)
    index, inside = pixels(x, y, z, camera, rounded=soft.rounded)
    raster = rasterise(index, z[inside], rgb[inside], camera.width, camera.height, soft)
    mask = keep_mask(
        raster.depth, settings.filter, strength=settings.filter_strength, levels=settings.filter_levels, metre=metre
    )
    packed = network_input(raster, mask, camera.fx, scene.spacing)
    return TwinFrame(raster, mask.numpy(), packed.numpy())
