"""Reference implementation of a frame: model/reference/projection.py on all packed points, in float64 throughout.

The float32 rasteriser, filter and fill are compared with it.  View frame: x right, y down, z forward, file units.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..picture.camera import Camera
    from ..picture.settings import Settings

_CHUNK = 1 << 20
"""Points processed at a time, which limits the memory."""


def reference_frame(scene: "Scene", camera: "Camera", settings: "Settings", metre: float) -> tuple[np.ndarray, np.ndarray]:
    """Filled picture (H, W, 3) uint8, background included, and keep-mask (H, W) bool.  metre: file units per metre."""
    import torch

    from ...model.reference.fill_constants import FOR_PICTURE
    from ...model.reference.noise_level import pixel_noise
    from ...model.reference.projection import SoftZ, frame, network_input, pixels, unpack_points, view_points
    from ...model.reference.station_weights import station_weights
    from ..render.passes.averaging import widening_of
    from ..render.raster.stations import ScannerPositions, uses_station_weights

    soft = SoftZ.preset(settings.soft_z, scene.spacing, metre, unlit=scene.unlit)
    corners = scene.cell_min - camera.position + 0.5 * scene.step
    cell_view = torch.from_numpy(corners @ camera.view_rotation.T)
    axes = torch.from_numpy(camera.view_rotation * scene.step)
    found: list[tuple] = []
    for start in range(0, scene.count, _CHUNK):
        stop = min(start + _CHUNK, scene.count)
        steps, rgb, station = unpack_points(torch.from_numpy(np.asarray(scene.points[start:stop], np.int64)))
        cells = torch.from_numpy(scene.cell_of_points(start, stop).astype(np.int64))
        x, y, z = view_points(steps, cells, cell_view, axes)
        index, inside = pixels(x, y, z, camera, rounded=soft.rounded)
        found.append((index, z[inside], rgb[inside], x[inside], y[inside], station[inside]))
    index, z, rgb, x, y, station = (torch.cat(part) for part in zip(*found, strict=True))
    weight = None
    if uses_station_weights(settings, ScannerPositions(scene)):
        places = torch.from_numpy((scene.station_places - camera.position) @ camera.view_rotation.T)
        weight = station_weights(x, y, z, station, places)
    raster, mask = frame(index, z, rgb, camera, soft, preset=settings.filter, strength=settings.filter_strength,
                         levels=settings.filter_levels, metre=metre, weight=weight)
    noise = pixel_noise(scene.noise, raster, camera, camera.view_rotation.T, camera.position)
    widened = widening_of(settings, None, scene.noise, FOR_PICTURE)
    overall = scene.noise.overall if scene.noise is not None and widened else 0.0
    filled = network_input(raster, mask, camera.fx, scene.spacing, noise, overall, FOR_PICTURE)[:3]
    picture = (filled.clamp(0, 1) * 255.0 + 0.5).floor().to(torch.uint8)
    return picture.permute(1, 2, 0).numpy(), mask.numpy()
