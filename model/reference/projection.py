"""Reference implementation of an OpenGL frame in torch: points to picture, on any device, in float32 or float64.

Training uses it, because it needs no OpenGL, and the OpenGL passes are tested against it on the same packed points.  The
network is therefore trained on the same input as the renderer gives it.

View frame: x right, y down, z forward, file units.  A pixel spans [i, i + 1] x [j, j + 1], row 0 at the top.  In float32
the operations and their order are those of ``shaders/common_project.glsl``; do not fuse or reorder them.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from ..common.linear_light import TO_LINEAR, TO_SRGB
from ..network.network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE, NOISE_SCALE, TYPICAL_WEIGHT
from .depth_filter import keep_mask
from .fill_constants import FOR_NETWORK, Averaging
from .pull_push import averaging_weight, pull_push
from .soft_z import MAX_AVERAGED, SoftZ
from .station_weights import confidence_of, match_tone

MEASURED_CHANNELS = 6
"""Channels of :func:`measured_input`."""


@dataclass(frozen=True)
class Raster:
    """A rasterised picture.

    colour: (3, H, W) float, integers 0..255.  depth: (H, W) nearest view-space z, +inf where empty.  count: (H, W) int64, the
    number of points averaged, or the sum of their weights; 0 where there is no point, or none with a colour.
    weighted: whether the points had weights (model/reference/station_weights.py).
    """

    colour: Tensor
    depth: Tensor
    count: Tensor
    weighted: bool = False

    def with_confidence(self, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Input of the fill: (3, H, W) colours 0..255, and (H, W) float32 confidence 0..1.  mask: (H, W) bool keep-mask."""
        if self.weighted:
            return match_tone(self.colour, confidence_of(self.count, mask))
        return self.colour, mask.to(torch.float32)


def unpack_points(packed: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """(N, 3) int64 words of packed points -> steps in the cell (N, 3), sRGB 0..255 (N, 3), scan numbers (N,), all int64."""
    w0, w1, w2 = packed.unbind(1)
    return (
        torch.stack([w0 & 0xFFFF, w0 >> 16, w1 & 0xFFFF], 1),
        torch.stack([w2 & 0xFF, (w2 >> 8) & 0xFF, (w2 >> 16) & 0xFF], 1),
        w2 >> 24,
    )


def view_points(steps: Tensor, cells: Tensor, cell_view: Tensor, axes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """View-space positions of packed points: x, y, z, (N,) each.

    steps: (N, 3) int.  cells: (N,) int64 indices into cell_view.  cell_view: (C, 3) view-space position of the centre of each
    cell's first step.  axes: (3, 3) view rotation times the step size, columns are the cell's x, y, z.
    """
    qx, qy, qz = steps.to(axes.dtype).unbind(1)
    origin = cell_view[cells]
    x, y, z = (origin[:, k] + ((axes[k, 0] * qx + axes[k, 1] * qy) + axes[k, 2] * qz) for k in range(3))
    return x, y, z


def pixels(x: Tensor, y: Tensor, z: Tensor, camera, *, rounded: bool = False) -> tuple[Tensor, Tensor]:
    """The pixel of each point.

    camera: an object with width, height, fx, fy, cx, cy (pixels), and maybe orthographic (viewer.picture.camera).
    rounded: round to the nearest pixel corner, as the published code does, instead of truncating.
    Returns inside (N,) bool, False for points at or behind the camera plane or outside the picture, and
    index (M,) int64 of row-major pixels for the points inside; index comes first.
    """
    scalar = torch.tensor((camera.fx, camera.fy, camera.cx, camera.cy), dtype=torch.float64).to(z)
    distance = getattr(camera, "orthographic", None)
    inverse = 1.0 / z if distance is None else torch.full_like(z, 1.0 / distance)
    u = scalar[0] * (x * inverse) + scalar[2]
    v = scalar[1] * (y * inverse) + scalar[3]
    if rounded:
        u, v = u + 0.5, v + 0.5
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return v[inside].long() * camera.width + u[inside].long(), inside


def rasterise(index: Tensor, z: Tensor, rgb: Tensor, width: int, height: int, soft: SoftZ,
              weight: Tensor | None = None) -> Raster:
    """Rasterises points of one pixel through the soft z-buffer (paper, "Point Cloud Projection").

    index: (N,) int64 pixel.  z: (N,) > 0.  rgb: (N, 3) 0..255.  weight: (N,) int64 of :mod:`model.reference.station_weights`;
    None: equal weights.  A pixel's colour is the integer weighted mean of the points within the depth tolerance, rounded half
    up, of sRGB values or of 12-bit linear light.
    """
    depth = torch.full((height * width,), torch.inf, dtype=z.dtype, device=z.device)
    depth.scatter_reduce_(0, index, z, "amin")
    limit = torch.maximum(depth * (1.0 + soft.relative), depth + soft.absolute)
    counted = z <= limit[index]
    if soft.unlit:
        counted &= (rgb > 0).any(1)
    index, rgb = index[counted], rgb[counted]
    if soft.linear:
        rgb = torch.from_numpy(TO_LINEAR).to(rgb.device)[rgb.long()]
    heavy = torch.ones_like(index) if weight is None else weight[counted]
    count, *sums = (torch.bincount(index, (heavy * part).double(), height * width).long() for part in (1, *rgb.unbind(1)))
    sums = torch.stack(sums)
    mean = (2 * sums + count) // (2 * count).clamp_min(1)
    if soft.linear:
        mean = torch.from_numpy(TO_SRGB).to(mean.device)[mean]
    return Raster(mean.to(z.dtype).reshape(3, height, width), depth.reshape(height, width), count.reshape(height, width),
                  weight is not None)


def depth_feature(depth: Tensor, focal: float, spacing: float) -> Tensor:
    """Scale-free depth for the network: log2(z / (focal x spacing)) x 1/4, clipped to +-2; 0 where empty.

    focal: pixels.  spacing: file units between neighbouring points.  The feature is 0 where neighbouring points are one pixel
    apart and positive where they are closer.
    """
    value = torch.log2(depth / (focal * spacing)) * DEPTH_FEATURE_SCALE
    return torch.where(torch.isfinite(depth), value.clamp(-DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_LIMIT), 0.0)


def averaging(count: Tensor, *, weighted: bool) -> Tensor:
    """(H, W) float32, 1 / sqrt(n) for the n points averaged in each pixel: the noise of their mean relative to one point's.

    count: (H, W) int64, number of points or sum of their weights (``weighted``); 0, an empty pixel, gives 1.
    """
    points = count.clamp_max(MAX_AVERAGED).to(torch.float32)
    return (points / TYPICAL_WEIGHT if weighted else points).clamp_min(1.0).rsqrt()


def measured_input(raster: Raster, mask: Tensor, focal: float, spacing: float) -> Tensor:
    """(6, H, W), the network's input before filling: RGB 0..1; keep-mask, or confidence 0..1 where points have weights; depth
    feature; 1 / sqrt(points averaged).  All channels are 0 where nothing is kept."""
    colour, confidence = raster.with_confidence(mask)
    kept = confidence > 0
    planes = [colour / 255.0, confidence.to(raster.depth.dtype)[None], depth_feature(raster.depth, focal, spacing)[None],
              averaging(raster.count, weighted=raster.weighted).to(raster.depth.dtype)[None]]
    return torch.cat(planes) * kept


def filled_input(measured: Tensor, noise: Tensor | float = 0.0, overall: float = 0.0,
                 averaging: Averaging = FOR_NETWORK) -> Tensor:
    """(6, H, W), the network's input: filled RGB 0..1; confidence; filled depth feature; filled noise level.

    measured: (6, H, W) of :func:`measured_input`.  noise: standard deviation of a single point's colour, full brightness = 1,
    at each pixel (H, W) or one value for all.  The noise level is NOISE_SCALE times the standard deviation of a pixel's mean
    colour (a noise-level map: FFDNet, Zhang et al. 2018).  overall: noise of the scan, by which points are averaged where they
    are sparse (model/reference/pull_push.py); then ``noise`` is (H, W).  averaging: FOR_PICTURE where the first three channels
    are shown.
    """
    level, weight = NOISE_SCALE * noise * measured[5], measured[3]
    if averaging.applies(overall):
        weight = averaging_weight(weight, noise * measured[5], measured[4], averaging)
    filled = pull_push(torch.stack([*measured[:3], measured[4], level]), weight, widened=averaging.widening(overall))
    return torch.cat([filled[:3], weight[None], filled[3:]])


def network_input(raster: Raster, mask: Tensor, focal: float, spacing: float, noise: Tensor | float = 0.0,
                  overall: float = 0.0, averaging: Averaging = FOR_NETWORK) -> Tensor:
    """(6, H, W): the network's input, see :func:`filled_input`."""
    return filled_input(measured_input(raster, mask, focal, spacing), noise, overall, averaging)


def frame(index: Tensor, z: Tensor, rgb: Tensor, camera, soft: SoftZ, *, preset: str = "auto", strength: float = 1.0,
          levels: int | None = None, metre: float = 1.0, weight: Tensor | None = None) -> tuple[Raster, Tensor]:
    """Raster and keep-mask of one picture.  Arguments as in :func:`rasterise` and
    :func:`model.reference.depth_filter.keep_mask`."""
    raster = rasterise(index, z, rgb, camera.width, camera.height, soft, weight)
    return raster, keep_mask(raster.depth, preset, strength=strength, levels=levels, metre=metre) & (raster.count > 0)
